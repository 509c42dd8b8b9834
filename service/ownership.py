"""Whose sessions are whose: told by the bearer token, where the service has any."""

from __future__ import annotations

import hashlib
import secrets

from service.config import ServiceSettings
from service.problems import UNAUTHORIZED, ProblemError


def owner_of(token: bytes, settings: ServiceSettings, how: str = "") -> str | None:
    """Whose sessions the holder of `token` may see: None for all, else the owner's name.

    Raises ProblemError where the service has tokens, and this is none of them; `how` tells more of how to
    show one.
    """
    if settings.token is None and settings.tokens is None:
        return None
    if settings.token is not None and _is(token, settings.token.get_secret_value()):
        return None
    of_owners = "" if settings.tokens is None else settings.tokens.get_secret_value()
    # Each is compared, so that the time taken tells nothing.
    found = [_is(token, one.strip()) for one in of_owners.split(",") if one.strip()]
    if any(found):
        return hashlib.blake2s(token, digest_size=16, person=b"owner").hexdigest()
    raise ProblemError(
        UNAUTHORIZED,
        f"send the service's token as Authorization: Bearer <token>{how}",
        headers={"WWW-Authenticate": "Bearer"},
    )


def _is(token: bytes, one: str) -> bool:
    return secrets.compare_digest(token, one.encode())
