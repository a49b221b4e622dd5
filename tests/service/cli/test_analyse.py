"""`loopwright analyse`: the document of the API, or its sentences."""

import json
from collections.abc import Callable

import pytest
from fastapi.testclient import TestClient

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


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_every_question_of_the_api_has_its_option(said: Said, client: TestClient) -> None:
    call = (
        "--profile process --scan-time 2 --load 10 --allowed 3 --frequency 0.01 --ramp 0.1 "
        "--crossover 0.02 --unmodelled 5 --op-room 40 --set-point-change 20 --relative-gain 1.4 "
        "--series Lead:40,0.3 --series lag:900,2 --series LeadLag:30,20 "
        "--series Notch:0.5,0.1,0.7 --points 20 --pade-order 4 --no-figures --json"
    )
    body = {
        "process": {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 30.0},
        "controller": {
            "Kc": 0.45, "Ti": 135.0, "Td": 13.3, "N": 12.0, "tauF": 3.0, "b": 0.5, "c": 1.0,
        },
        "profile": "process",
        "scan_time": 2.0,
        "task": {
            "load": 10.0, "allowed": 3.0, "frequency": 0.01, "ramp": 0.1, "wc": 0.02,
            "unmodelled": 5.0, "op_room": 40.0, "set_point_change": 20.0, "relative_gain": 1.4,
        },
        "compensators": [
            {"kind": "Lead", "T": 40.0, "alpha": 0.3},
            {"kind": "Lag", "T": 900.0, "beta": 2.0},
            {"kind": "LeadLag", "T_lead": 30.0, "T_lag": 20.0},
            {"kind": "Notch", "w0": 0.5, "zeta_zero": 0.1, "zeta_pole": 0.7},
        ],
        "points": 20,
        "pade_order": 4,
        "figures": False,
    }  # fmt: skip
    answer = client.post("/v1/analysis", json=body)
    assert answer.status_code == 200, answer.text
    said()  # what the service logged
    assert run(["analyse", "FOPDT:2,120,30", "0.45,135,13.3,12,3,b=0.5,c=1", *call.split()]) == 0
    assert json.loads(said()[0]) == answer.json()
    # A PID leaves ramp Ti/(Kc, here twice that at rest) of it.
    ramp = next(item for item in answer.json()["disturbances"] if item["integrators"] == 2)
    assert ramp["left"] == pytest.approx(0.1 * 135 / (2 * 0.45))
    assert answer.json()["routh"]["pade_order"] == 4
    assert answer.json()["routh"]["right"] == 0
    assert run([*HEATER, "--pade-order", "5"]) == 0
    assert "by Routh's array: 0, on it: 0, the dead time by a Padé" in said()[0]
    assert run(["analyse", "TF:1/10,-1,0", "0.5", "--pade-order", "5"]) == 0
    assert "by Routh's array: 1, on it: 0." in said()[0]
    for wrong in ("Hat:1,2", "Lead:1", "Notch:1,2,x"):
        assert run([*HEATER, "--series", wrong]) == 2
        assert "compensator" in said()[1]


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
