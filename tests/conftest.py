"""How hypothesis runs: the same examples every time, however slow the machine is."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("halflight", deadline=None, derandomize=True)
settings.load_profile("halflight")
