"""The container's recipe, as far as that goes without Docker: what it copies is there, what it runs is ours."""

from __future__ import annotations

import json
import shlex
import tomllib
from pathlib import Path

import typer

from interfaces.cli.main import app
from interfaces.cli.options import access_for

HOME = Path(__file__).resolve().parents[1]


def instructions() -> list[tuple[str, str]]:
    lines = [line for line in (HOME / "Dockerfile").read_text().splitlines() if line and not line.startswith("#")]
    return [(word, rest) for word, _, rest in (line.partition(" ") for line in lines)]


def test_what_is_copied_is_there_and_is_all_that_a_wheel_needs() -> None:
    copied = [shlex.split(rest)[:-1] for word, rest in instructions() if word == "COPY"]
    names = {name for names in copied for name in names}
    assert all((HOME / name).exists() for name in names)
    project = tomllib.loads((HOME / "pyproject.toml").read_text())
    needed = {"pyproject.toml", project["project"]["readme"], *project["project"]["license-files"]}
    packages = {
        pattern.removesuffix("*") for pattern in project["tool"]["setuptools"]["packages"]["find"]["include"]
    }
    assert needed | packages <= names
    ignored = {line.strip() for line in (HOME / ".dockerignore").read_text().splitlines()}
    assert not ignored & names


def test_the_python_is_ours() -> None:
    image = next(rest for word, rest in instructions() if word == "FROM")
    wanted = tomllib.loads((HOME / "pyproject.toml").read_text())["project"]["requires-python"]
    assert image.startswith("python:3.11-")
    assert wanted == ">=3.11"


def test_it_serves_to_the_host_by_token_and_not_as_root(tmp_path: Path) -> None:
    told = dict(instructions())
    assert told["USER"] == "vrs"
    program, command, *options = json.loads(told["CMD"])
    assert program == "vrs"
    serve = typer.main.get_command(app).commands[command]
    given = serve.make_context("serve", options).params
    assert str(given["port"]) == told["EXPOSE"]
    assert given["host"] == "0.0.0.0"
    assert given["token_file"].is_relative_to(told["VOLUME"])
    access = access_for(given["host"], tmp_path / "tokens", free=())
    assert access.needs_tokens


def test_the_editor_finds_the_same() -> None:
    told = json.loads((HOME / ".devcontainer" / "devcontainer.json").read_text())
    assert int(dict(instructions())["EXPOSE"]) in told["forwardPorts"]
    assert told["postCreateCommand"] == "make demo"
    assert ":3.11-" in told["image"]
