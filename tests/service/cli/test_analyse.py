"""`loopwright analyse`: the document of the API, or its sentences."""

import json
from collections.abc import Callable

import pytest

from advice.analyse import Task, analyse
from advice.analysis_body import analysis_body
from loop.controller import PID
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, PureDelay
from service.cli import run
from service.cli.stating import process_from_text

Said = Callable[[], tuple[str, str]]
HEATER = ["analyse", "FOPDT:2,120,30", "0.45,135,13.3"]


def test_the_json_is_the_document_of_the_api(said: Said) -> None:
    assert run([*HEATER, "--json", "--load", "10", "--allowed", "3"]) == 0

    task = Task(load=10.0, allowed=3.0)
    analysis = analyse(FOPDT(K=2, tau=120, theta=30), PID(Kc=0.45, Ti=135, Td=13.3), task=task)
    assert json.loads(said()[0]) == json.loads(json.dumps(analysis_body(analysis)))


def test_the_text_says_margins_poles_limits_and_the_answer_to_the_task(said: Said) -> None:
    code = run(
        [*HEATER, "--load", "10", "--allowed", "3", "--frequency", "0.01", "--crossover", "0.5"]
    )

    out = said()[0]
    assert code == 0
    assert "Stable: gain margin 17.2 dB, phase margin 84.2°, delay margin 219 s, Ms 1.16" in out
    assert "Nyquist: Z = N + P, 0 = 0 + 0." in out
    assert "On the axis at 0.079467 rad/s with 7.2836 times the gain." in out
    assert "Dead time of 30 s: wc at most 0.03491 rad/s with even an ideal controller." in out
    assert "No PID can have that crossover." in out
    assert "at least 4.424 with any controller" in out
    assert "A PID alone is not enough" in out
    assert "What would help: feed-forward of the load" in out


def test_an_unstable_loop_is_said_to_be_one(said: Said) -> None:
    assert run(["analyse", "TF:1/10,-1,2", "0.5"]) == 0
    out = said()[0]
    assert "Unstable: 1 pole right of the axis." in out
    assert run(["analyse", "TF:1/10,-1,2", "3"]) == 0
    assert "Lost as well when the gain falls below 0.333 of it." in said()[0]
    assert run(["analyse", "FOPDT:2,1,1", "1,inf,5,inf"]) == 0
    assert "Unstable: infinitely many poles" in said()[0]


def test_processes_are_read_as_they_are_typed() -> None:
    assert process_from_text("sopdt:2,30,10,5") == SOPDT(K=2, tau1=30, tau2=10, theta=5)
    assert process_from_text("IPDT:0.1,5") == IPDT(K=0.1, theta=5)
    assert process_from_text("PureDelay:2,5") == PureDelay(K=2, theta=5)
    assert process_from_text("DoubleIntegrator:0.1,0") == DoubleIntegrator(K=0.1, theta=0)


@pytest.mark.parametrize(
    ("arguments", "said_so"),
    [
        (["FOPDT:2,120", "1"], "3 numbers are needed, got 2 in '2,120'"),
        (["FOPDT:2,-120,3", "1"], "tau must lie within 1e-09 and 1e+09 s, got -120.0"),
        (["FOPDT:2,a,3", "1"], "numbers separated by commas are needed"),
        (["ARX:1,2", "1"], "there is no process ARX:1,2"),
        (["FOPDT:2,120,30", "1,2,3,4,5,6"], "1 to 5 numbers are needed, got 6"),
        (["FOPDT:2,120,30", "nan"], "Kc must lie within"),
        (["FOPDT:2,120,30", "1", "--profile", "best"], "--profile must be one of process"),
        (["FOPDT:2,120,30", "1", "--scan-time", "-1"], "scan_time must lie within 0"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    arguments: list[str], said_so: str, sentence: Callable[[], str]
) -> None:
    assert run(["analyse", *arguments]) == 2
    assert said_so in sentence()
