"""The workers of services that these tests start in this process end with it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.service.apps import NURSERY


@pytest.fixture(scope="session", autouse=True)
def nursery() -> Iterator[None]:
    yield
    NURSERY.close()
