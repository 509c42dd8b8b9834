"""What the service refuses, as an exception."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import httpx


class ProblemError(Exception):
    """The service has refused a request, and changed nothing (RFC 9457)."""

    def __init__(self, status: int, kind: str, detail: str, errors: list[dict[str, Any]]) -> None:
        self.status = status
        self.kind = kind
        """A URI, as in `urn:halflight:revision-conflict`"""
        self.detail = detail
        self.errors = errors
        """Of bad input: `loc` and `msg` of each field"""
        super().__init__(f"{status}: {detail}")

    @classmethod
    def of(cls, answer: httpx.Response) -> ProblemError:
        """The problem that an answer tells."""
        try:
            told = answer.json()
        except ValueError:
            told = {}
        if not isinstance(told, dict):
            told = {}
        return cls.told({"detail": answer.reason_phrase, **told, "status": answer.status_code})

    @classmethod
    def told(cls, problem: Mapping[str, Any]) -> ProblemError:
        """From JSON."""
        return cls(
            int(problem["status"]),
            str(problem.get("type", "about:blank")),
            str(problem.get("detail", "")),
            list(problem.get("errors") or []),
        )
