"""Apps in this process. Their workers come from one nursery, so that each need not load all anew."""

from __future__ import annotations

from typing import Any

from fastapi.testclient import TestClient

from service.app import create_app
from service.config import ServiceSettings
from service.hosting.nursery import Nursery

NURSERY = Nursery()


def app_client(**settings: Any) -> TestClient:
    """The client of a new app; as a context, it begins and ends the app's life."""
    return TestClient(create_app(ServiceSettings.model_validate({"token": None} | settings), NURSERY))
