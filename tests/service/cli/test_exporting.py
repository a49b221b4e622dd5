"""`loopwright export`: the script alone on standard output, or in a file."""

from collections.abc import Callable
from pathlib import Path

from advice.model_export import export_model
from loop.process import FOPDT
from service.cli import run


def test_the_script_goes_out_or_into_a_file(
    tmp_path: Path, said: Callable[[], tuple[str, str]]
) -> None:
    text = export_model(FOPDT(K=2, tau=120, theta=30), "matlab").text
    assert run(["export", "FOPDT:2,120,30", "matlab"]) == 0
    assert said()[0] == text

    assert run(["export", "FOPDT:2,120,30", "matlab", "--to", str(tmp_path / "m.m")]) == 0
    assert (tmp_path / "m.m").read_text("utf-8") == text


def test_an_unknown_tool_is_one_sentence(sentence: Callable[[], str]) -> None:
    assert run(["export", "FOPDT:2,120,30", "abacus"]) == 2
    assert "target must be one of python, python-control" in sentence()
