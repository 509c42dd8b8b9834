"""What every refusal looks like."""

from __future__ import annotations

from typing import Any

import httpx


def problem_of(answer: httpx.Response, status: int) -> dict[str, Any]:
    """The problem that an answer tells, which must be of that status and fit for a client."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = answer.json()
    assert problem["status"] == status
    assert problem["title"]
    assert problem["detail"]
    assert problem["type"].startswith("urn:halflight:") or problem["type"] == "about:blank"
    assert set(problem) <= {"type", "title", "status", "detail", "errors"}
    for leaked in ("Traceback", "site-packages", ".py", "pydantic", "numpy", "solver.", "service."):
        assert leaked not in answer.text
    return problem


def fields_at_fault(answer: httpx.Response, status: int = 422) -> list[list[str | int]]:
    """The paths of the fields that a problem names."""
    problem = problem_of(answer, status)
    assert all(error["msg"] for error in problem["errors"])
    return [error["loc"] for error in problem["errors"]]
