"""The command as such: help, version, info."""

from __future__ import annotations

import pytest

from service.config import ServiceSettings
from tests.halflight.commands import WITHOUT_OPENGL, invoke, run

COMMANDS = ["serve", "warm", "render", "bake", "info"]


def test_help_names_every_command() -> None:
    result = invoke("--help")
    assert result.exit_code == 0
    for command in COMMANDS:
        assert f"\n  {command} " in result.stdout


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("flag", ["--help", "-h"])
def test_every_command_has_help(command: str, flag: str) -> None:
    result = invoke(command, flag)
    assert result.exit_code == 0
    assert result.stdout.startswith("Usage:")
    assert result.stderr == ""


def test_help_of_serve_has_every_setting_but_the_tokens() -> None:
    options = invoke("serve", "--help").stdout
    for name in ServiceSettings.model_fields:
        assert (f"--{name.replace('_', '-')} " in options) == (not name.startswith("token"))
        assert f"HALFLIGHT_{name.upper()}" in options.replace("\n", " ")


def test_help_of_render_has_every_option() -> None:
    options = invoke("render", "--help").stdout
    camera = {"camera", "eye", "target", "up", "fov", "width", "height"}
    for name in camera | {"output", "renderer", "layer", "tolerance", "samples", "exposure", "tone-map"}:
        assert f"--{name} " in options


def test_without_a_command_help_is_shown() -> None:
    result = invoke()
    assert result.exit_code == 2
    assert "Usage:" in result.output


@pytest.mark.parametrize("arguments", [["draw"], ["render"], ["info", "--colour"], ["warm", "now"]])
def test_what_is_not_there_is_refused(arguments: list[str]) -> None:
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert "Usage:" in result.stderr


def test_version() -> None:
    result = invoke("--version")
    assert result.exit_code == 0
    assert result.stdout.startswith("halflight ")


def test_info_tells_what_there_is() -> None:
    status, output, errors = run("info")
    assert (status, errors) == (0, "")
    told = dict(line.split(maxsplit=1) for line in output.splitlines() if not line.startswith("GL "))
    assert int(told["cores"]) >= 1
    for name in ("halflight", "OpenGL", "Embree", "Python", "numpy", "numba", "embreex", "moderngl"):
        assert told[name]


def test_info_works_without_opengl_and_says_so() -> None:
    status, output, errors = run("info", **WITHOUT_OPENGL)
    assert (status, errors) == (0, "")
    (line,) = (line for line in output.splitlines() if line.startswith("OpenGL"))
    assert "not available" in line and "apt-get install" in line
    assert "Embree" in output
