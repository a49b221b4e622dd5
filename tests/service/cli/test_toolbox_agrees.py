"""The toolbox around the PID: command line, API and the walk itself give one answer."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from loop.controller import PID
from loop.process import FOPDT
from service.access import ASKING
from service.cli import run
from tuning.cascade import cascade
from tuning.conditioning import choose_pv_filter, longest_scan_time
from tuning.smith_predictor import smith_margins, smith_predictor

Said = Callable[[], tuple[str, str]]
# Nothing is stored, so one database is enough.
one_database = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


def fopdt(K: float, tau: float, theta: float) -> dict[str, Any]:
    return {"kind": "FOPDT", "K": K, "tau": tau, "theta": theta}


HEATER = fopdt(2.0, 120.0, 30.0)
TANK = {"kind": "IPDT", "K": 0.01, "theta": 3.0}
PAIRS: list[tuple[str, str, dict[str, Any]]] = [
    (
        "condition FOPDT:2,120,30 0.9,135,13.3,b=0.7 --scan-time 2 --computation 0.5 --noise 0.1 "
        "--travel 15000 --phase-cost 8 --overshoot 1 --attenuation 0.2 --order 1 --swing 4",
        "/v1/conditioning",
        {
            "process": HEATER,
            "controller": {"Kc": 0.9, "Ti": 135.0, "Td": 13.3, "b": 0.7},
            "scan_time": 2.0,
            "computation": 0.5,
            "noise": 0.1,
            "travel": 15000.0,
            "phase_cost": 8.0,
            "overshoot": 1.0,
            "attenuation": 0.2,
            "order": 1,
            "swing": 4.0,
        },
    ),
    (
        "predictor FOPDT:2,30,60 --tau-c 40 --profile servo",
        "/v1/smith-predictors",
        {"process": fopdt(2.0, 30.0, 60.0), "tau_c": 40.0, "profile": "servo"},
    ),
    (
        "cascade FOPDT:3,5,1 FOPDT:0.8,100,10 --inner-tau-c 1 --outer-tau-c 12 --profile process",
        "/v1/cascades",
        {
            "inner": fopdt(3.0, 5.0, 1.0),
            "outer": fopdt(0.8, 100.0, 10.0),
            "inner_tau_c": 1.0,
            "outer_tau_c": 12.0,
            "profile": "process",
        },
    ),
    (
        "feedforward FOPDT:2,120,30 FOPDT:-1,60,10 --largest-ratio 5",
        "/v1/feed-forwards",
        {"process": HEATER, "load": fopdt(-1.0, 60.0, 10.0), "largest_ratio": 5.0},
    ),
    (
        "schedule 80=FOPDT:3,8,2 20=FOPDT:1,10,2 --rule lambda_pi --tau-c 6 --profile hvac",
        "/v1/schedules",
        {
            "points": [
                {"at": 80.0, "process": fopdt(3.0, 8.0, 2.0)},
                {"at": 20.0, "process": fopdt(1.0, 10.0, 2.0)},
            ],
            "rule": "lambda_pi",
            "tau_c": 6.0,
            "profile": "hvac",
        },
    ),
    (
        "smooth IPDT:0.01,3 --load 10 --allowed 20 --profile servo",
        "/v1/smooth-tunings",
        {"process": TANK, "load": 10.0, "allowed": 20.0, "profile": "servo"},
    ),
    (
        "detune FOPDT:2,120,30 --knob calm --structure PI --gain 0.2 --profile hvac --scan-time 2",
        "/v1/detunings",
        {
            "process": HEATER,
            "knob": "calm",
            "structure": "PI",
            "gain": 0.2,
            "profile": "hvac",
            "scan_time": 2.0,
        },
    ),
    (
        "region --overshoot 10 --phase 60 --settling 5 --rise 2 --band 0.05 --pole -1,-1 --pole -3",
        "/v1/analysis/pole-regions",
        {
            "overshoot": 0.1,
            "phase": 60.0,
            "settling": 5.0,
            "rise": 2.0,
            "band": 0.05,
            "poles": [{"real": -1.0, "imag": -1.0}, {"real": -3.0}],
        },
    ),
    (
        "interaction 12.8,-18.9/6.6,-19.4",
        "/v1/analysis/interactions",
        {"gains": [[12.8, -18.9], [6.6, -19.4]]},
    ),
]


@one_database
def test_the_command_line_and_the_api_give_one_document(
    client_as: Callable[..., TestClient], said: Said
) -> None:
    engineer, viewer = client_as("engineer"), client_as("viewer")
    bodies = {}
    for call, address, body in PAIRS:
        # New settings are an engineer's to ask for.
        asks = viewer if address in ASKING else engineer
        answer = asks.post(address, json=body)
        assert answer.status_code == 200, answer.text
        said()  # what the service logged
        assert run([*call.split(), "--json"]) == 0
        found = json.loads(said()[0])
        assert found == answer.json(), call
        assert run(call.split()) == 0
        assert said()[0].splitlines() == found["sentences"]
        bodies[call.split()[0]] = found
    _hold_the_numbers_of_the_walks(bodies)


def _hold_the_numbers_of_the_walks(bodies: dict[str, Any]) -> None:
    pid, heater = PID(Kc=0.9, Ti=135, Td=13.3), FOPDT(K=2, tau=120, theta=30)
    details = bodies["condition"]
    longest = longest_scan_time(heater, pid, phase_cost=8.0, computation=0.5)
    assert details["longest_scan_time"] == longest
    chosen = choose_pv_filter(heater, pid, scan_time=2, noise=0.1, travel=15_000, phase_cost=8)
    assert details["pv_filter"]["time"] == chosen.time
    assert details["pv_filter"]["movement"]["travel"] == chosen.after.travel
    assert details["Tt"] == pytest.approx((135 * 13.3) ** 0.5)

    swept, found = bodies["predictor"]["sweep"], bodies["predictor"]["sweep"]["worst"]["Ms"]
    row = swept["parameters"].index(found["parameter"])
    column = swept["factors"].index(found["factor"])
    assert swept["Ms"][row][column] == found["value"]
    off = {"K": 2.0, "tau": 30.0, "theta": 60.0}
    off[found["parameter"]] *= found["factor"]
    worst = smith_margins(smith_predictor(FOPDT(K=2, tau=30, theta=60), 40.0), FOPDT(**off))
    assert worst.Ms == found["value"]

    pair = cascade(
        FOPDT(K=3, tau=5, theta=1), FOPDT(K=0.8, tau=100, theta=10), inner_tau_c=1, outer_tau_c=12
    )
    assert bodies["cascade"]["speed_ratio"] == pair.speed_ratio
    assert bodies["cascade"]["outer"]["margins"]["Ms"] == pair.outer_margins.Ms


@one_database
def test_the_noise_is_measured_in_a_record(
    client: TestClient, tic101: dict[str, Any], tmp_path: Path, said: Said
) -> None:
    rng = np.random.default_rng(1)
    t = np.arange(400)
    pv = 150 + np.sin(t / 60) + rng.normal(0, 0.2, t.size)
    lines = [
        f"2026-01-01T00:{s // 60:02}:{s % 60:02}Z,{y:.6f},40"
        for s, y in zip(t.tolist(), pv.tolist(), strict=True)
    ]
    text = "\n".join(["Time,PV,OP", *lines]) + "\n"
    stored = client.post(
        f"/v1/loops/{tic101['id']}/records", files={"file": ("day.csv", text.encode(), "text/csv")}
    ).json()
    wanted = {
        "process": HEATER,
        "controller": {"Kc": 0.9, "Ti": 135.0},
        "scan_time": 1.0,
        "record": {"loop_id": tic101["id"], "record_id": stored["id"]},
    }
    answer = client.post("/v1/conditioning", json=wanted)
    assert answer.status_code == 200, answer.text
    measured = answer.json()["measured_noise"]
    assert measured["sd"] == pytest.approx(0.2, rel=0.1)
    assert measured["samples"] == 400

    said()  # what the service logged
    file = tmp_path / "day.csv"
    file.write_text(text)
    call = ["condition", "FOPDT:2,120,30", "0.9,135,0", "--scan-time", "1", "--json"]
    assert run([*call, "--noise-from", str(file)]) == 0
    assert json.loads(said()[0]) == answer.json()
    both = client.post("/v1/conditioning", json={**wanted, "noise": 0.1})
    assert both.status_code == 422
    assert "give either noise or a record" in both.text
    file.write_text("Time,PV,OP\n" + "\n".join(f"{s},150,40" for s in range(30)))
    assert run([*call, "--noise-from", str(file)]) == 2
    assert "PV shows no noise" in said()[1]
    file.write_text("Time,PV,OP\n" + "\n".join(f"{s},{s % 2},40" for s in range(9)))
    assert run([*call, "--noise-from", str(file)]) == 2
    assert "20 samples of PV or more, got 9" in said()[1]


CONTROLLER = {"Kc": 0.9, "Ti": 135.0}
LOOP = {"process": HEATER, "controller": CONTROLLER}
FLAT = {"inner": fopdt(3.0, 5.0, 1.0), "outer": fopdt(0.8, 100.0, 10.0)}
ONE = {"at": 1.0, "process": HEATER}


IMPOSSIBLE: list[tuple[str, dict[str, Any], str, str]] = [
        # Numbers that cannot be.
        ("conditioning", {**LOOP, "scan_time": 0.0}, "invalid", "greater than or equal"),
        ("conditioning", {**LOOP, "noise": -1.0}, "invalid", "greater than 0"),
        ("conditioning", {**LOOP, "travel": 5.0}, "invalid", "travel needs noise"),
        ("conditioning", {**LOOP, "phase_cost": 90.0}, "invalid", "less than 90"),
        ("conditioning", {**LOOP, "swing": 1e13}, "invalid", "less than or equal to"),
        ("smith-predictors", {"process": {**HEATER, "K": 0.0}}, "invalid", "got 0.0"),
        ("smith-predictors", {"process": TANK}, "invalid", "Input should be 'FOPDT'"),
        ("cascades", {**FLAT, "inner_tau_c": 1e10}, "invalid", "less than or equal"),
        ("feed-forwards", {"process": HEATER, "load": HEATER, "largest_ratio": 0.5}, "invalid",
         "greater than or equal to 1"),
        ("schedules", {"points": [ONE]}, "invalid", "at least 2 items"),
        ("schedules", {"points": [ONE, ONE]}, "invalid", "two or more different"),
        ("schedules", {"points": [ONE, {"at": 2.0, "process": {**HEATER, "K": -2.0}}]}, "invalid",
         "changes its sign"),
        ("schedules", {"points": [ONE, {**ONE, "at": 2.0}], "rule": "best"}, "invalid",
         "rule must be one of simc"),
        ("schedules", {"points": [ONE, {**ONE, "at": 2.0}], "structure": "PD"}, "invalid",
         "structure of simc must be one of"),
        ("smooth-tunings", {"process": HEATER, "load": 0.0, "allowed": 1.0}, "invalid",
         "greater than 0"),
        ("smooth-tunings", {"process": HEATER, "load": 1e-12, "allowed": 1.0}, "invalid",
         "load must lie within 1e-09"),
        ("analysis/pole-regions", {}, "invalid", "state an overshoot"),
        ("analysis/pole-regions", {"overshoot": 1.0}, "invalid", "less than 1"),
        ("analysis/pole-regions", {"rise": 1.0, "poles": [{"real": 1.0}]}, "invalid",
         "a stable pole is needed, got (1+0j)"),
        ("analysis/interactions", {"gains": [[1.0, 2.0], [1.0, 2.0, 3.0]]}, "invalid",
         "got 2 rows of [2, 3]"),
        # Facts that stand in the way.
        ("conditioning", {**LOOP, "controller": {"Kc": 9.0, "Ti": 50.0}}, "unstable-loop",
         "2 poles in the right half-plane"),
        ("conditioning", {**LOOP, "controller": {"Kc": 0.1}}, "invalid", "nowhere 1"),
        ("smith-predictors", {"process": {**HEATER, "theta": 0.0}}, "rule-not-applicable",
         "no dead time to predict over"),
        ("cascades", {**FLAT, "inner_tau_c": 20.0, "outer_tau_c": 5.0}, "rule-not-applicable",
         "times as fast as the outer"),
        ("cascades", {**FLAT, "inner": fopdt(3.0, 5.0, 0.0)}, "rule-not-applicable", "dead time"),
        ("detunings", {"process": HEATER, "knob": 1.5}, "invalid", "less than or equal to 1"),
        ("detunings", {"process": HEATER, "gain": 5.0}, "rule-not-applicable", "only detunes"),
        ("detunings", {"process": {"kind": "DoubleIntegrator", "K": 1.0, "theta": 1.0},
         "gain": 0.1, "structure": "PID", "knob": "fast"}, "rule-not-applicable", "not Double"),
        ("detunings", {"process": {"kind": "DoubleIntegrator", "K": 1.0, "theta": 1.0}},
         "rule-not-applicable", "does not apply"),
        ("smooth-tunings", {"process": HEATER, "load": 50.0, "allowed": 1.0},
         "rule-not-applicable", "needs a deviation of 50 to be allowed"),
        ("smooth-tunings", {"process": {"kind": "PureDelay", "K": 1.0, "theta": 3.0},
         "load": 1.0, "allowed": 1.0}, "rule-not-applicable", "SIMC smooth tuning"),
        ("analysis/interactions", {"gains": [[1.0, 2.0], [2.0, 4.0]]}, "rule-not-applicable",
         "the gain matrix is singular"),
]  # fmt: skip


@one_database
def test_what_cannot_be_is_a_sentence_with_its_numbers(client: TestClient) -> None:
    for address, body, kind, words in IMPOSSIBLE:
        answer = client.post(f"/v1/{address}", json=body)
        assert answer.status_code == 422, (body, answer.text)
        problem = answer.json()
        assert problem["type"].startswith(f"/problems/{kind}")
        faults = " ".join(fault["detail"] for fault in problem.get("errors", []))
        assert words in f"{problem.get('detail')} {faults}"
    whole = json.dumps({"process": fopdt(17.25, 1.0, 1.0), "load": 1.0, "allowed": 1.0})
    for text in ("NaN", "Infinity", "1e999", '"2"', "null", "[]"):
        answer = client.post(
            "/v1/smooth-tunings",
            content=whole.replace("17.25", text),
            headers={"Content-Type": "application/json"},
        )
        assert answer.status_code in (400, 422), text


def test_absurd_numbers_are_answered_without_a_surprise(said: Said) -> None:
    assert run(["feedforward", "FOPDT:1,1e-8,0", "FOPDT:1,1e-8,6e8"]) == 0
    assert "It cancels the load completely" in said()[0]
    call = "detune FOPDT:5,10,19 --gain 7e-4 --scan-time 1e8 --knob 0"
    assert run(call.split()) == 0
    out = said()[0]
    assert "AMIGO PI detuned to that gain: Kc = 0.0007000" in out
    assert "; unstable. The rule" in out


@pytest.mark.parametrize(
    ("call", "code", "words"),
    [
        ("predictor FOPDT:2,120,0", 3, "no dead time to predict over"),
        ("predictor IPDT:2,3", 2, "a Smith predictor takes FOPDT:K,TAU,THETA, not IPDT"),
        ("predictor FOPDT:2,30,60 --tau-c -1", 2, "tau_c must be positive, got -1"),
        ("predictor FOPDT:2,30,60 --profile best", 2, "profile must be one of"),
        ("cascade FOPDT:3,5,1 FOPDT:0.8,100,10 --inner-tau-c 20 --outer-tau-c 5", 3, "as fast"),
        ("condition FOPDT:2,120,30 9,50", 3, "The closed loop is unstable"),
        ("condition FOPDT:2,120,30 0.9,135 --order 3", 2, "order be 1 or 2, got"),
        ("condition FOPDT:2,120,30 0.9,135 --scan-time nan", 2, "scan_time must be positive"),
        ("condition FOPDT:2,120,30 0.9,135,d=1", 2, "only b=B and c=C may follow"),
        ("condition FOPDT:2,120,30 0.9 --noise 1 --noise-from x.csv", 2, "give either --noise"),
        ("schedule 1=FOPDT:2,120,30", 2, "two or more different"),
        ("schedule x=FOPDT:2,120,30 2=FOPDT:2,1,1", 2, "an operating point is AT="),
        ("region --pole a,b --rise 1", 2, "--pole takes RE,IM"),
        ("detune FOPDT:2,120,30 --knob wild", 2, "one of calm, normal, fast, got wild"),
        ("detune FOPDT:2,120,30 --knob 2", 2, "must lie within 0 (calm) and 1 (fast), got 2"),
        ("interaction 1,2/x,4", 2, "gains are rows of numbers"),
        ("feedforward FOPDT:1,1e-9,0 FOPDT:1,1,0", 2, "tau must lie within 1e-09"),
        ("interaction 1,2/2,4", 3, "singular"),
        ("smooth FOPDT:2,120,30 --load 50 --allowed 1", 3, "to be allowed"),
    ],
)
def test_wrong_calls_and_refusals_say_why(call: str, code: int, words: str, said: Said) -> None:
    assert run(call.split()) == code
    out, err = said()
    assert out == ""
    assert words in " ".join(err.split())
