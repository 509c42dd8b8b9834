"""The gates: lint, format, types, layers, and the set-up that every way of running shares.

Each tool runs as a user would run it, so that its own message is what a failure shows.
"""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import pytest

ROOT = Path(__file__).resolve().parent.parent
TOOLS = Path(sys.executable).parent
SET_UP = "scripts/setup.sh"

LOCAL_PATH = re.compile(r"(?<![\w.~-])/(?:home|root|Users|work|tmp)/[\w.]|\.\./shared")
REGISTRY_HOST = re.compile(r"\b(?:pypi|pythonhosted|debian|npmjs|conda|anaconda)\.org\b")


class Instruction(NamedTuple):
    """One instruction of a Dockerfile."""

    name: str
    arguments: str


def run(*command: str | Path, cwd: Path = ROOT) -> str:
    """Output of a command; its failure is the test's, with all that it printed."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    output = done.stdout + done.stderr
    if done.returncode != 0:
        pytest.fail(f"$ {shlex.join(map(str, command))}\n{output}", pytrace=False)
    return output


def project_files() -> list[str]:
    """What the project consists of: tracked, or new and not ignored; relative to the root."""
    listed = run("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    return [name for name in listed.split("\0") if name and (ROOT / name).is_file()]


def instructions() -> Iterator[Instruction]:
    """The Dockerfile's instructions, continued lines joined, comments left out."""
    text = (ROOT / "docker/Dockerfile").read_text().replace("\\\n", " ")
    for line in text.splitlines():
        if line.strip() and not line.startswith("#"):
            name, arguments = line.split(maxsplit=1)
            yield Instruction(name, arguments)


def pyproject() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())


# --- tools ---


@pytest.mark.parametrize(
    "command",
    [["ruff", "check"], ["ruff", "format", "--check"], ["mypy"], ["lint-imports", "--no-cache"]],
    ids=["lint", "format", "types", "layers"],
)
def test_code_is_clean(command: list[str]) -> None:
    tool, *arguments = command
    run(TOOLS / tool, *arguments)


# --- nothing of the machine it was written on ---


@pytest.mark.parametrize(
    ("pattern", "what"),
    [(LOCAL_PATH, "a path of one machine"), (REGISTRY_HOST, "a package registry's host")],
    ids=["paths", "registries"],
)
def test_files_name_no(pattern: re.Pattern[str], what: str) -> None:
    found = []
    for name in project_files():
        try:
            text = (ROOT / name).read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # a picture
        lines = enumerate(text.splitlines(), start=1)
        found += [f"{name}:{number}: {line.strip()[:100]}" for number, line in lines if pattern.search(line)]
    assert not found, f"{what} is named:\n" + "\n".join(found)


@pytest.mark.parametrize("lock", ["requirements/run.lock", "requirements/dev.lock"])
def test_locks_hold_every_dependency_with_hashes(lock: str) -> None:
    text = (ROOT / lock).read_text()
    pins = re.split(r"\n(?=\S)", re.sub(r"(?m)^\s*#.*\n?", "", text).strip())
    unlocked = [pin for pin in pins if not re.match(r"\S+==\S+ .*--hash=sha256:", pin, re.DOTALL)]
    assert not unlocked

    project = pyproject()["project"]
    wanted = project["dependencies"] + (project["optional-dependencies"]["dev"] if "dev" in lock else [])
    locked = {pin.split("==")[0] for pin in pins}
    names = {re.split(r"[\[<>=~! ;]", entry)[0].lower().replace("_", "-") for entry in wanted}
    assert names <= locked, "run `make lock`"


def test_dev_lock_holds_the_run_lock() -> None:
    pins = [
        set(re.findall(r"(?m)^\S+==\S+", (ROOT / f"requirements/{n}.lock").read_text()))
        for n in ("run", "dev")
    ]
    assert pins[0] <= pins[1], "run `make lock`"


# --- the set-up script and the Dockerfile that calls it ---


def test_dockerfile_installs_by_the_set_up_script_alone() -> None:
    commands = [c.strip() for i in instructions() if i.name == "RUN" for c in i.arguments.split("&&")]
    allowed = {SET_UP, "useradd", "mkdir", "chown", "rm"}
    assert {shlex.split(command)[0] for command in commands} <= allowed
    parts = [c.removeprefix(SET_UP).strip() for c in commands if c.startswith(SET_UP)]
    assert parts == ["--system-only", "--python-only"], "together, in this order, they are the whole set-up"


def test_dockerfile_copies_what_the_set_up_needs(tmp_path: Path) -> None:
    """Replay the Dockerfile in an empty directory: at each call, the script finds the files it names."""
    leave_out = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name, arguments in instructions():
        words = [word for word in shlex.split(arguments) if not word.startswith("--")]
        if name == "COPY":
            *sources, target = words
            for source in sources:
                if (ROOT / source).is_dir():
                    shutil.copytree(ROOT / source, tmp_path / target, ignore=leave_out)
                else:
                    shutil.copy(ROOT / source, tmp_path / target)
        elif name == "RUN" and SET_UP in words:
            (call,) = (c for c in arguments.split("&&") if SET_UP in c)
            run(*shlex.split(call), "--dry-run", cwd=tmp_path)


def test_dockerfile_starts_what_the_set_up_makes() -> None:
    script = (ROOT / SET_UP).read_text()
    venv = re.search(r"(?m)^readonly VENV=(\S+)$", script)
    assert venv is not None
    (start,) = (json.loads(i.arguments) for i in instructions() if i.name == "CMD")
    assert start[0] in {f"{venv[1]}/bin/{script_name}" for script_name in pyproject()["project"]["scripts"]}
    (check,) = (i.arguments for i in instructions() if i.name == "HEALTHCHECK")
    assert json.loads(check.split("CMD", maxsplit=1)[1])[0] == f"{venv[1]}/bin/python"
    assert f"{venv[1]}/{start[0].split('/', 1)[1]}" in (ROOT / "Makefile").read_text()


def test_ports_agree() -> None:
    (port,) = (i.arguments for i in instructions() if i.name == "EXPOSE")
    environment = " ".join(i.arguments for i in instructions() if i.name == "ENV")
    assert f"PORT={port}" in environment.split()
    compose = (ROOT / "docker/compose.yaml").read_text()
    assert f'"127.0.0.1:{port}:{port}"' in compose
    assert "dockerfile: docker/Dockerfile" in compose


def test_dockerignore_hides_no_file_of_the_project() -> None:
    lines = (ROOT / ".dockerignore").read_text().splitlines()
    patterns = [line for line in lines if line and not line.startswith("#")]
    hidden = []
    for name in project_files():
        for path in (PurePosixPath(name), *PurePosixPath(name).parents):
            hidden += [
                f"{pattern}: {name}"
                for pattern in patterns
                if fnmatch(path.name if pattern.startswith("**/") else str(path), pattern.removeprefix("**/"))
            ]
    assert not hidden


def test_set_up_refuses_what_it_does_not_know() -> None:
    done = subprocess.run([ROOT / SET_UP, "--wrong"], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "unknown option: --wrong" in done.stderr


def test_set_up_says_what_to_install_when_it_may_not(tmp_path: Path) -> None:
    """Without a Python and without the right to install one, the message names the packages."""
    tools = tmp_path / "bin"
    tools.mkdir()
    for tool in ("bash", "dirname", "cat", "env"):
        (tools / tool).symlink_to(shutil.which(tool) or tool)
    for name, answer in (("id", "echo 1000"), ("sudo", "exit 1"), ("apt-get", "exit 9")):
        (tools / name).write_text(f"#!/bin/bash\n{answer}\n")
        (tools / name).chmod(0o755)
    done = subprocess.run(
        ["/bin/bash", SET_UP, "--system-only"],
        cwd=ROOT,
        env={"PATH": str(tools)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert "apt-get install python3 python3-venv libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri" in done.stderr
