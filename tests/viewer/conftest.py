"""The workers of the services that the viewer is tested with end with it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.service.apps import NURSERY


@pytest.fixture(scope="session", autouse=True)
def nursery() -> Iterator[None]:
    yield
    NURSERY.close()
