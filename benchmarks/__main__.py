"""`python -m benchmarks`."""

from __future__ import annotations

from benchmarks.command import run

if __name__ == "__main__":
    run()
