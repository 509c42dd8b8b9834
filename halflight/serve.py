"""`halflight serve`: the HTTP service on one address."""

from __future__ import annotations

import inspect
import socket
from collections.abc import Callable
from typing import Annotated, Any, Final

import typer
import uvicorn
from pydantic import ValidationError
from pydantic_core import PydanticUndefined

from halflight.console import ExitCode, fail
from service.config import ServiceSettings

_FAREWELL: Final = 3
"""Seconds that open requests, event streams among them, have to end when the service is stopped."""

_ENVIRONMENT_ONLY: Final = {"token"}
"""What the list of processes should not show."""

_ENVIRONMENT: Final = {"host": "HOST", "port": "PORT"}
"""Names of variables without the prefix HALFLIGHT_."""


class Server(uvicorn.Server):
    """A server that prints its address when it is ready."""

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, then say so."""
        await super().startup(sockets)
        if self.started and sockets:
            typer.echo(f"halflight serves on {address_of(sockets[0])}")


def address_of(bound: socket.socket) -> str:
    """The URL of a bound socket."""
    host, port = bound.getsockname()[:2]
    return f"http://[{host}]:{port}" if bound.family == socket.AF_INET6 else f"http://{host}:{port}"


def bind(host: str, port: int) -> socket.socket:
    """A socket that is bound to the address. Raises OSError."""
    family, kind, protocol, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    bound = socket.socket(family, kind, protocol)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(address)
        # Listening tells now, and not after the workers have started, whether the address is free.
        bound.listen(uvicorn.Config(app="").backlog)
    except OSError:
        bound.close()
        raise
    bound.set_inheritable(False)
    return bound


def run(settings: ServiceSettings, access_log: bool) -> None:
    """Serve until interrupted."""
    from service.app import create_app

    try:
        bound = bind(settings.host, settings.port)
    except OSError as refused:
        reason = (refused.strerror or str(refused)).lower()
        fail(f"cannot listen on {settings.host} port {settings.port}: {reason}", ExitCode.UNABLE)
    server = Server(
        uvicorn.Config(
            create_app(settings),
            log_level="info" if access_log else "warning",
            access_log=access_log,
            timeout_graceful_shutdown=_FAREWELL,
        )
    )
    with bound:
        server.run(sockets=[bound])
    if not server.started:
        raise typer.Exit(ExitCode.UNABLE)


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
    """`command` with one option for each setting, in their order, before its own."""
    parameters = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_option(name))
        for name in ServiceSettings.model_fields
        if name not in _ENVIRONMENT_ONLY
    ]
    own = [
        parameter
        for parameter in inspect.signature(command, eval_str=True).parameters.values()
        if parameter.kind is not inspect.Parameter.VAR_KEYWORD
    ]
    command.__signature__ = inspect.Signature([*parameters, *own])  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in (*parameters, *own)}
    return command


@_with_settings
def serve(
    *,
    access_log: Annotated[bool, typer.Option("--access-log", help="Log every request.")] = False,
    **given: object,
) -> None:
    """Serve scenes over HTTP, until interrupted.

    The address is printed when the service is ready. Only this machine reaches the default address; where
    another is chosen, set HALFLIGHT_TOKEN in the environment, which clients then send as a bearer token.
    """
    run(settings_of({name: value for name, value in given.items() if value is not None}), access_log)
