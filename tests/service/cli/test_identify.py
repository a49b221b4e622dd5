"""`loopwright identify`: the model that `loopwright tune` rests on, and nothing more."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from service.cli import run

Said = Callable[[], tuple[str, str]]
HEATER = Path(__file__).parents[3] / "docs" / "tutorial" / "heater-step.csv"


def test_it_prints_the_model_that_tune_prints(said: Said) -> None:
    assert run(["identify", str(HEATER), "--json"]) == 0
    alone = json.loads(said()[0])
    assert run(["tune", str(HEATER), "--json"]) == 0
    assert alone == json.loads(said()[0])["model"]

    assert alone["verdict"] == "trusted"
    for name, true in (("K", 2.0), ("tau", 120.0), ("theta", 30.0)):
        # Each interval of 95 % holds the truth the file was simulated with.
        low, high = alone["intervals_95"][name]
        assert low < true < high
        assert alone[name] == pytest.approx(true, rel=0.01)


def test_a_person_reads_the_model_with_its_doubt_and_reasons(said: Said) -> None:
    assert run(["identify", str(HEATER)]) == 0
    out, err = said()
    assert err == ""
    assert "2250 rows: 2250 kept" in out
    assert "trusted" in out
    assert "K e^(-theta s)/(tau s + 1)" in out
    assert "Recommended" not in out


def test_a_record_that_carries_no_model_is_refused_with_reasons(tmp_path: Path, said: Said) -> None:
    flat = tmp_path / "flat.csv"
    flat.write_text("t [s],PV,OP\n" + "".join(f"{i},20.{i % 2},40\n" for i in range(300)))
    for arguments in ([], ["--json"]):
        call = ["identify", str(flat), "--time", "1", "--pv", "2", "--op", "3", *arguments]
        assert run(call) == 3
        out, err = said()
        assert "refused" in out
        assert err == ""
    document = json.loads(out)
    assert document["K"] is None
    assert document["reasons"]


@pytest.mark.parametrize(
    ("arguments", "because"),
    [
        (["nowhere.csv"], "there is no file nowhere.csv"),
        ([], "Missing argument"),
        ([str(HEATER), "--op", "valve"], "valve"),
        ([str(HEATER), "--layout", "round"], "round"),
    ],
)
def test_a_wrong_call_is_said(
    arguments: list[str], because: str, sentence: Callable[[], str]
) -> None:
    assert run(["identify", *arguments]) == 2
    assert because in sentence()
