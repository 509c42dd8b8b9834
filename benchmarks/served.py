"""A service of its own for a measurement."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def served(**settings: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """The address and the process of a service on a free port, by its defaults but for HALFLIGHT_ `settings`.

    Raises RuntimeError where it does not start.
    """
    environment = {k: v for k, v in os.environ.items() if not k.startswith("HALFLIGHT_")}
    process = subprocess.Popen(
        [sys.executable, "-m", "halflight", "serve", "--host", "127.0.0.1", "--port", "0"],
        env=environment | {f"HALFLIGHT_{name}": value for name, value in settings.items()},
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        told = process.stdout.readline()
        address = re.search(r"http://\S+", told)
        if address is None:
            raise RuntimeError(f"the service did not start: {told.strip() or 'it told nothing'}")
        yield address[0], process
    finally:
        process.terminate()
        process.communicate()
