"""Kept machine code is used only while all that went into it is as it was."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

HELPER = "from solver.kernels import inline_kernel\n@inline_kernel\ndef helper(x): return x + {0}\n"
CALLER = """
from helpers import helper
from limits import LIMIT
from solver.kernels import kernel

@kernel
def caller(x):
    return helper(x) * LIMIT

if __name__ == "__main__":
    from callers import caller
    print(caller(1.0), sum(caller.stats.cache_hits.values()))
"""


def call(folder: Path) -> tuple[float, int]:
    done = subprocess.run(
        [sys.executable, "callers.py"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.mark.parametrize(
    ("file", "text", "expected"),
    [("helpers.py", HELPER.format(2.0), 30.0), ("limits.py", "LIMIT = 100.0\n", 200.0)],
    ids=["a kernel of another file", "a constant of another file"],
)
def test_a_kernel_is_compiled_anew_when_what_it_takes_in_changes(
    tmp_path: Path, file: str, text: str, expected: float
) -> None:
    (tmp_path / "helpers.py").write_text(HELPER.format(1.0))
    (tmp_path / "limits.py").write_text("LIMIT = 10.0\n")
    (tmp_path / "callers.py").write_text(CALLER)
    assert call(tmp_path) == (20.0, 0)
    assert call(tmp_path) == (20.0, 1), "unchanged, it is kept"
    (tmp_path / file).write_text(text)
    os.utime(tmp_path / file, ns=(1, 1))
    assert call(tmp_path) == (expected, 0)


def test_helpers_further_down_in_the_file_count_too(tmp_path: Path) -> None:
    (tmp_path / "helpers.py").write_text(HELPER.format(1.0))
    (tmp_path / "limits.py").write_text("LIMIT = 10.0\n")
    early = CALLER.replace("helper(x) * LIMIT", "later(x) * LIMIT").replace(
        "if __name__", "@kernel\ndef later(x):\n    return helper(x)\n\nif __name__"
    )
    (tmp_path / "callers.py").write_text(early)
    assert call(tmp_path) == (20.0, 0)
    assert call(tmp_path) == (20.0, 1)
    (tmp_path / "helpers.py").write_text(HELPER.format(2.0))
    os.utime(tmp_path / "helpers.py", ns=(1, 1))
    assert call(tmp_path) == (30.0, 0)
