"""Requests that are sent again because their answers were lost."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from fastapi import Header

Key: TypeAlias = Annotated[
    str | None,
    Header(
        min_length=1,
        max_length=255,
        description="The client's own name of the request: where it comes again, it gets the same answer and "
        "changes nothing more. Of changes, 422 where another request had it, and the thousand newest of a "
        "session are known.",
    ),
]
