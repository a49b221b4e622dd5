"""Whatever ends a command, a person reads one sentence."""

from collections.abc import Callable
from errno import EACCES
from typing import NoReturn

import pytest

import service.cli
from loop.errors import DiskFull
from service.cli import main, run
from service.cli.failure import sentence_for
from service.errors import InvalidRequest, NotFound


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ValueError("tau must be\n  positive, got -3"), "tau must be positive, got -3"),
        (ValueError(""), "no reason given"),
        (DiskFull(), str(DiskFull())),
        (PermissionError(EACCES, "No permission", "x.csv"), "Cannot use x.csv: No permission."),
        (OSError("the pipe broke"), "Cannot use: the pipe broke."),
        (NotFound("loop", "TIC-1"), "There is no loop TIC-1."),
        (InvalidRequest("body/file", "This is no file."), "This is no file."),
        (KeyError("tag"), "This should not have happened (KeyError: 'tag')."),
    ],
)  # fmt: skip
def test_every_error_has_its_sentence(error: Exception, said: str) -> None:
    assert sentence_for(error) == said


@pytest.mark.parametrize(
    ("end", "code", "said"),
    [
        (KeyboardInterrupt(), 1, "loopwright: Stopped.\n"),
        (BrokenPipeError(), 1, ""),
        (KeyError("a"), 1, "loopwright: This should not have happened (KeyError: 'a').\n"),
    ],
)  # fmt: skip
def test_no_end_of_a_command_shows_a_traceback(
    end: BaseException,
    code: int,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def ended(_: list[str]) -> NoReturn:
        raise end

    monkeypatch.setattr(service.cli, "app_for", ended)
    assert run(["key"]) == code
    assert capsys.readouterr().err == said


def test_the_program_leaves_with_the_code_of_its_command(
    monkeypatch: pytest.MonkeyPatch, sentence: Callable[[], str]
) -> None:
    monkeypatch.setattr("sys.argv", ["loopwright", "identify", "nowhere.csv"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "there is no file nowhere.csv" in sentence()
