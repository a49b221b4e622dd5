"""The benchmark of advice counts what it says, and a few of its plants get no unsafe advice."""

import math
import sys

import pytest

from benchmarks import unsafe_advice
from benchmarks.random_plants import batch
from benchmarks.unsafe_advice import ROUTES, Outcome, outcomes, section


def outcome(*, Ms: float, advised: bool = True, good: bool = True) -> Outcome:
    return Outcome(
        route=ROUTES[0], family="FOPDT", seed=1, good=good,
        verdict="trusted" if advised else "refused", advised=advised, Ms=Ms,
        area=1.2 if advised else 0.0,
    )  # fmt: skip


@pytest.mark.parametrize("route", ROUTES)
def test_a_few_random_plants_get_no_unsafe_advice(route: str) -> None:
    found = outcomes(range(4), route)
    assert [one.seed for one in found if one.unsafe] == []
    assert sum(one.advised for one in found) >= 1


def test_the_section_counts_harm_and_refusals() -> None:
    found = [outcome(Ms=1.5), outcome(Ms=math.inf), outcome(Ms=0.0, advised=False)]
    counted = section({ROUTES[0]: found, ROUTES[1]: []})
    assert counted.rows[0][:2] == (ROUTES[0], "3")
    assert counted.rows[0][4:] == ("1", "inf", "33.3% of 3", "1.20")
    assert [target.met for target in counted.targets] == [False, False, True, True, True, True]


def test_every_member_of_the_batch_settles_and_has_unit_gain() -> None:
    members = batch()
    # P6 integrates and is left out of the 133 members: 9 of them.
    assert len(members) == 124
    assert all(n[-1] == d[-1] == 1.0 and theta >= 0 for n, d, theta in members)


def test_the_command_prints_the_table(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(unsafe_advice, "outcomes", lambda *_: [outcome(Ms=1.5)])
    for arguments in (["unsafe_advice", "3"], ["unsafe_advice"]):
        monkeypatch.setattr(sys, "argv", arguments)
        unsafe_advice.main()
        assert "## Unsafe advice" in capsys.readouterr().out
