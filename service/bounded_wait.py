"""How long a request may wait."""

from __future__ import annotations

from pydantic import BaseModel, Field


class BoundedWait(BaseModel):
    """What every query that may wait has."""

    timeout_ms: float | None = Field(
        default=None,
        ge=0.0,
        allow_inf_nan=False,
        description="Bounds every wait; then comes what there is, or 409 where there is nothing to show yet. "
        "The service has a bound of its own, ten minutes unless configured otherwise.",
    )

    def longest(self, most_ms: float) -> float:
        """Seconds that it may wait, where the service allows `most_ms`."""
        return (most_ms if self.timeout_ms is None else min(self.timeout_ms, most_ms)) / 1000.0
