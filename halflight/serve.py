"""`halflight serve`: the HTTP service on one address."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Annotated, Any, Final

import typer
from pydantic import ValidationError
from pydantic_core import PydanticUndefined

from halflight.console import ExitCode, fail
from service.config import ServiceSettings

_ENVIRONMENT_ONLY: Final = {"token", "tokens"}
"""What the list of processes should not show."""

_ENVIRONMENT: Final = {"host": "HOST", "port": "PORT"}
"""Names of variables without the prefix HALFLIGHT_."""


def run(settings: ServiceSettings) -> None:
    """Serve until interrupted."""
    from service.hosting.remote import WorkerNotStartedError
    from service.journal.store import JournalError
    from service.server import serve as serve_until_interrupted

    try:
        serve_until_interrupted(settings)
    except OSError as refused:
        # What follows in parentheses is the address once more.
        reason = (refused.strerror or str(refused)).lower().partition(" (")[0]
        fail(f"cannot listen on {settings.host} port {settings.port}: {reason}", ExitCode.UNABLE)
    except (WorkerNotStartedError, JournalError) as refused:
        fail(str(refused), ExitCode.UNABLE)


def settings_of(given: dict[str, object]) -> ServiceSettings:
    """The settings: what is `given`, else the environment's, else the defaults. Fails on a bad one."""
    try:
        return ServiceSettings(**given)  # type: ignore[arg-type]  # they are the fields' own options
    except ValidationError as refused:
        first = refused.errors(include_url=False)[0]
        name = str(first["loc"][0])
        variable = f"HALFLIGHT_{name.upper()}" if name in ServiceSettings.model_fields else name
        option = f"--{name.replace('_', '-')}" if name in given else variable
        fail(f"{option}: {first['msg']}, not {first['input']!r}", ExitCode.BAD_INPUT)


def _option(name: str) -> Any:
    """The command line option of a setting: its type, and its help from the setting's description."""
    field = ServiceSettings.model_fields[name]
    variables = f"HALFLIGHT_{name.upper()}" + (f" or {_ENVIRONMENT[name]}" if name in _ENVIRONMENT else "")
    default = "" if field.default is PydanticUndefined else f"default {field.default}; "
    text = f"{field.description} [{default}environment: {variables}]"
    return Annotated[field.annotation, typer.Option(help=text, show_default=False)]


def _with_settings(command: Callable[..., None]) -> Callable[..., None]:
    """`command` with one option for each setting, in their order."""
    parameters = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_option(name))
        for name in ServiceSettings.model_fields
        if name not in _ENVIRONMENT_ONLY
    ]
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return command


@_with_settings
def serve(**given: object) -> None:
    """Serve scenes over HTTP, until interrupted.

    The address is printed when the service is ready. Only this machine reaches the default address; where
    another is chosen, set HALFLIGHT_TOKEN in the environment, which clients then send as a bearer token, or
    HALFLIGHT_TOKENS for several, by comma, each of which opens the sessions alone that it has made.
    """
    run(settings_of({name: value for name, value in given.items() if value is not None}))
