"""What the service refuses, as an exception."""

from __future__ import annotations

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
        return cls(
            answer.status_code,
            str(told.get("type", "about:blank")),
            str(told.get("detail", answer.reason_phrase)),
            list(told.get("errors", [])),
        )
