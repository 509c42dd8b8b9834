"""What is said over the socket between the process that workers are forked from and who asks for them."""

from __future__ import annotations

import struct
from typing import Final

READY: Final = b"r"
"""Told once: from now on, workers can be asked for"""

FORK: Final = b"f"
"""Asks for a worker; with it go the socket that the worker is to serve, and its board."""

PID: Final = struct.Struct("!I")
"""Answers with a worker's process id; with it goes a descriptor of the process."""
