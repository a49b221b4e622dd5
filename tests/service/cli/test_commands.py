"""What holds for every command: help, one sentence for a wrong call, no traceback, no waiting."""

import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from inspect import cleandoc
from pathlib import Path
from typing import Any

import pytest
import typer

from service.cli import run
from service.cli.commands import COMMANDS, Entry, app_for

GROUPS = {
    entry.name: [
        info.name or getattr(info.callback, "__name__", "") for info in found.registered_commands
    ]
    for entry in COMMANDS
    if isinstance(
        found := getattr(import_module(entry.place.split(":")[0]), entry.place.split(":")[1]),
        typer.Typer,
    )
}


def everything() -> Iterator[list[str]]:
    for entry in COMMANDS:
        yield [entry.name]
        for name in GROUPS.get(entry.name, ()):
            yield [entry.name, name]


ALL = [" ".join(command) for command in everything()]


def test_all_commands_of_the_brief_are_there() -> None:
    assert {
        "serve", "demo", "import", "identify", "tune", "sheet show", "sheet history", "sheet diff",
        "sheet approve", "audit verify", "key create", "migrate",
    } <= set(ALL)  # fmt: skip


def test_the_page_of_the_command_line_names_every_command() -> None:
    page = (Path(__file__).parents[3] / "docs" / "command-line.md").read_text("utf-8")
    named = set(re.findall(r"^\| `loopwright ([a-z]+(?: [a-z]+)?)", page, re.MULTILINE))
    assert named == {command for command in ALL if command not in GROUPS}


@pytest.mark.parametrize("command", ALL)
def test_every_command_explains_itself_and_each_of_its_options(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command.split(), "--help"]) == 0

    assert capsys.readouterr().out.startswith(f"Usage: loopwright {command} ")
    found: Any = typer.main.get_command(app_for(command.split()))
    for name in command.split():
        found = found.commands[name]
    assert found.help
    assert [option.name for option in found.params if not option.help] == []


@pytest.mark.parametrize("command", ALL)
def test_a_wrong_option_is_one_sentence_and_exit_code_2(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*command.split(), "--no-such-option"]) == 2

    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("loopwright: ")
    assert "--no-such-option" in said.err or "Missing command" in said.err
    assert said.err.count("\n") == 1


def test_an_unknown_command_is_one_sentence_and_exit_code_2(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["tunne"]) == 2
    assert capsys.readouterr().err.startswith("loopwright: No such command 'tunne'")


def test_without_arguments_it_shows_all_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([]) == 0
    shown = capsys.readouterr().out
    for entry in COMMANDS:
        assert f"  {entry.name} " in shown


@pytest.mark.parametrize(
    "entry", [e for e in COMMANDS if e.name not in GROUPS], ids=lambda e: e.name
)
def test_the_overview_says_what_the_command_itself_says(entry: Entry) -> None:
    module, _, name = entry.place.partition(":")
    first = cleandoc(getattr(import_module(module), name).__doc__).partition("\n\n")[0]
    said = " ".join(first.split())
    assert said.startswith(entry.sentence.rstrip("."))


def test_the_overview_comes_without_loading_what_the_commands_need() -> None:
    program = (
        "import sys; from service.cli import run; assert run(['--help']) == 0;"
        "heavy = {'numpy', 'scipy', 'pandas', 'pyarrow', 'sqlalchemy', 'fastapi', 'uvicorn'};"
        "print('loaded:', sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.endswith("loaded: []\n")
