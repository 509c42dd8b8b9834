"""Figures as text."""

from __future__ import annotations

import math

from benchmarks.report.front import Reached


def seconds_text(seconds: float) -> str:
    """Two digits are all that a busy machine lets one tell; three from a second on."""
    if not math.isfinite(seconds):
        return "-"
    if seconds < 1.0:
        return f"{seconds:.2g}"
    return f"{seconds:.1f}" if seconds < 100.0 else f"{seconds:,.0f}"


def text_of(found: Reached) -> str:
    """The time with its sign; - for none."""
    return f"{found.sign}{seconds_text(found.seconds)}"


def memory_text(megabytes: float) -> str:
    """Whole MB."""
    return f"{megabytes:,.0f}"


def ratio_text(found: Reached, ours: Reached) -> str:
    """How many times as long as ours something takes."""
    if not math.isfinite(found.seconds) or not math.isfinite(ours.seconds):
        return "-"
    ratio = found.seconds / ours.seconds
    return found.sign + (f"{ratio:.2g}" if ratio < 10.0 else f"{ratio:,.0f}")
