"""`loopwright plan`: the document of the API, or its sentences."""

import json
from collections.abc import Callable

import pytest

from advice.planning import plan_body, plan_test
from identification.planner import Wishes
from loop.process import FOPDT
from service.cli import run

Said = Callable[[], tuple[str, str]]
HEATER = ["plan", "FOPDT:2,120,30", "--noise", "0.1", "--deviation", "5"]


def test_the_json_is_the_document_of_the_api(said: Said) -> None:
    assert run([*HEATER, "--json"]) == 0
    wishes = Wishes(guess=FOPDT(K=2.0, tau=120.0, theta=30.0), noise=0.1, deviation=5.0)
    assert json.loads(said()[0]) == json.loads(json.dumps(plan_body(plan_test(wishes))))


def test_the_text_says_what_to_do_and_when_to_stop(said: Said) -> None:
    assert run([*HEATER, "--relay"]) == 0
    assert "Stop and put OP back if PV is 6.25 or more from rest" in said()[0]


def test_an_integrator_gets_pulses(said: Said) -> None:
    assert run(["plan", "IPDT:0.002,10", "--noise", "0.05", "--deviation", "2"]) == 0
    assert "Expect PV to move by +1.33 over the first pulse" in said()[0]


def test_a_relay_within_the_noise_is_refused(said: Said) -> None:
    assert run([*HEATER[:-1], "0.5", "--relay"]) == 3
    assert "make a step test" in said()[0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["plan", "DoubleIntegrator:2,30", *HEATER[2:]], "tests are planned for FOPDT"),
        ([*HEATER, "--factor", "9"], "factor must lie within 1 and 5"),
    ],
)
def test_what_cannot_be_is_a_wrong_call(said: Said, arguments: list[str], words: str) -> None:
    assert run(arguments) == 2
    assert words in said()[1]
