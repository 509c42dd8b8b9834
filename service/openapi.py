"""The machine-readable form of the wire contract, generated from the code.

`python -m service.openapi` writes it to openapi/openapi.json; with `--check` it only says whether that
file is what the code gives.
"""

from __future__ import annotations

import argparse
import json
import sys
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed_version
from pathlib import Path
from typing import Any, Final

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic.json_schema import models_json_schema

from service.problems import MEDIA_TYPE, Problem, responses

OPENAPI_FILE: Final = Path(__file__).resolve().parent.parent / "openapi" / "openapi.json"

_VERSION_OF_INTERFACE: Final = "1"

_DESCRIPTION: Final = """\
Post a scene, change it, get converged radiosity frames back.

Metres; right-handed; numbers are finite. RGB triples are linear, with the primaries of Rec. 709. Every
error is a `application/problem+json` (RFC 9457); a refused request changes nothing.
"""


def version() -> str:
    """The version of the installed package."""
    try:
        return installed_version("halflight")
    except PackageNotFoundError:
        return "0"


def describe(app: FastAPI) -> None:
    """Have `app` describe itself as the contract has it: every error a problem."""

    def openapi() -> dict[str, Any]:
        if not app.openapi_schema:
            app.openapi_schema = _schema(app)
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _schema(app: FastAPI) -> dict[str, Any]:
    schema = get_openapi(
        title=app.title, version=_VERSION_OF_INTERFACE, description=_DESCRIPTION, routes=app.routes
    )
    components: dict[str, Any] = schema.setdefault("components", {}).setdefault("schemas", {})
    for unused in ("HTTPValidationError", "ValidationError"):
        components.pop(unused, None)
    _, problem = models_json_schema([(Problem, "serialization")], ref_template="#/components/schemas/{model}")
    components.update(problem["$defs"])
    schema["components"]["schemas"] = dict(sorted(components.items()))
    for path, operations in schema["paths"].items():
        for operation in operations.values():
            _tell_problems(operation, guarded=path.startswith("/v1") or path == "/metrics")
    return schema


def _tell_problems(operation: dict[str, Any], guarded: bool) -> None:
    told: dict[str, Any] = operation["responses"]
    found = told.get("422", {}).get("content", {})
    if "422" in told and MEDIA_TYPE not in found:
        told["422"] = responses(422)[422]
    if guarded:
        told["401"] = responses(401)[401]
    if "requestBody" in operation:
        told["415"] = responses(415)[415]
        told["413"] = responses(413)[413]
    operation["responses"] = dict(sorted(told.items()))


def text_of(app: FastAPI) -> str:
    """The description of `app` as it stands in the file."""
    return json.dumps(app.openapi(), indent=2, ensure_ascii=False, sort_keys=True) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Write the file, or check it. Returns the exit status."""
    from service.app import create_app  # the app itself needs this module

    parser = argparse.ArgumentParser(prog="python -m service.openapi", description=main.__doc__)
    parser.add_argument("--check", action="store_true", help="fail where the file is stale; write nothing")
    check = parser.parse_args(arguments).check
    text = text_of(create_app())
    if check:
        fresh = OPENAPI_FILE.exists() and OPENAPI_FILE.read_text(encoding="utf-8") == text
        if not fresh:
            sys.stderr.write("openapi/openapi.json is stale: run `make openapi`\n")
        return 0 if fresh else 1
    OPENAPI_FILE.parent.mkdir(exist_ok=True)
    OPENAPI_FILE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
