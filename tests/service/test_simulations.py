"""Simulations over REST: the document of the command line, on a stated process, nothing stored."""

import json
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any
from uuid import uuid4

import numpy as np
import pytest
from fastapi.testclient import TestClient

from advice.fan import box_draws
from advice.scenario import Conditions, LoadChange, SetPointChange, Transfer
from advice.what_if import what_if
from advice.what_if_body import what_if_body
from loop.controller import PID
from loop.digital_pid import AntiWindup, OutputLimits
from loop.disturbances import coloured_noise
from loop.process import FOPDT
from loop.simulation import simulate
from loop.valve import Choudhury

HEATER = {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 30.0}
PROCESS = FOPDT(K=2.0, tau=120.0, theta=30.0)
NEW = {"name": "new", "Kc": 0.9, "Ti": 135.0, "Td": 13.3}
NOW = {"name": "now", "Kc": 0.4, "Ti": 200.0}
STEP = {"kind": "set point", "size": 5.0}
# What is computed before the database is asked needs no second one.
pytestmark = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


def ask(client: TestClient, **changes: Any) -> Any:
    return client.post(
        "/v1/simulations",
        json={"process": HEATER, "controllers": [NEW, NOW], "events": [STEP], **changes},
    )


def test_a_viewer_sees_what_a_notebook_sees(client_as: Callable[..., TestClient]) -> None:
    answer = ask(
        client_as("viewer"),
        events=[STEP, {"kind": "load", "size": -2.0}, {"kind": "transfer", "size": 1.0}],
        conditions={
            "scan_time": 4.0,
            "t_end": 1200.0,
            "low": 0.0,
            "high": 60.0,
            "rate": 2.0,
            "anti_windup": "velocity form",
            "pv_filter": 6.0,
            "noise": 0.1,
            "resolution": 0.02,
            "valve": {"model": "Choudhury", "S": 0.4, "J": 0.2},
            "pv0": 150.0,
            "op0": 40.0,
            "seed": 7,
        },
        fan={"spread": 0.3, "count": 20},
    )

    assert answer.status_code == 200, answer.text
    found = what_if(
        PROCESS,
        {"new": PID(Kc=0.9, Ti=135, Td=13.3), "now": PID(Kc=0.4, Ti=200)},
        [SetPointChange(size=5.0), LoadChange(size=-2.0), Transfer(size=1.0)],
        conditions=Conditions(
            scan_time=4.0,
            t_end=1200.0,
            limits=OutputLimits(low=0, high=60, rate=2),
            anti_windup=AntiWindup.VELOCITY,
            pv_filter=6.0,
            noise=0.1,
            resolution=0.02,
            valve=Choudhury(S=0.4, J=0.2),
            pv0=150.0,
            op0=40.0,
            seed=7,
        ),
        draws=box_draws(PROCESS, 0.3, n=20),
    )
    assert answer.json() == json.loads(json.dumps(what_if_body(found)))


@pytest.mark.parametrize(
    "valve", [{"model": "He", "fs": 2.0, "fd": 1.0}, {"model": "DeadBand", "width": 3.0}]
)
def test_other_valves_and_stated_draws(client: TestClient, valve: dict[str, Any]) -> None:
    draws = [[2.0, 120.0, 30.0], [3.0, 100.0, 40.0]]
    answer = ask(client, conditions={"valve": valve}, fan={"draws": draws})

    assert answer.status_code == 200, answer.text
    body = answer.json()
    assert body["conditions"]["valve"] == valve
    assert body["draws"] == 2
    run = body["events"][0]["runs"][0]
    assert run["response"]["position"] != run["response"]["op"]
    assert run["fan"]["diverged"] == 0


def stored_record(client: TestClient, loop: str) -> str:
    """A day in automatic, simulated with the settings in use, uploaded as an export."""
    rng = np.random.default_rng(3)
    t = np.arange(500) * 5.0
    load = coloured_noise(t, memory=300, size=1.0, rng=rng)
    run = simulate(
        PROCESS, PID(Kc=0.4, Ti=200), t_end=t[-1], dt=5, load=load, sp=160.0, pv0=160, op0=45
    )
    rows = [
        f"{datetime.fromtimestamp(1.7e9 + s, UTC):%Y-%m-%dT%H:%M:%SZ},{pv!r},{op!r},160"
        for s, pv, op in zip(t.tolist(), run.pv.tolist(), run.op.tolist(), strict=True)
    ]
    text = "\n".join(["Time,PV,OP,SP", *rows]) + "\n"
    answer = client.post(
        f"/v1/loops/{loop}/records", files={"file": ("day.csv", text.encode(), "text/csv")}
    )
    assert answer.status_code == 201, answer.text
    return str(answer.json()["id"])


def test_a_stored_record_is_met_again(client: TestClient, tic101: dict[str, Any]) -> None:
    record = stored_record(client, tic101["id"])
    replay = {"kind": "replay", "loop_id": tic101["id"], "record_id": record}
    answer = ask(client, events=[replay])

    assert answer.status_code == 200, answer.text
    event = answer.json()["events"][0]
    new, now = event["runs"]
    np.testing.assert_allclose(now["response"]["pv"], event["recorded"]["pv"], atol=1e-6)
    assert new["measures"]["IAE"] < now["measures"]["IAE"]

    late = {**replay, "start": "2030-01-01T00:00:00Z"}
    assert ask(client, events=[late]).json()["type"] == "/problems/no-samples"
    other = {**replay, "record_id": str(uuid4())}
    assert ask(client, events=[other]).status_code == 404


@pytest.mark.parametrize(
    ("changes", "pointer", "words"),
    [
        ({"controllers": []}, "controllers", "at least 1 item"),
        ({"controllers": [NEW] * 2}, "body", "names of their own, got new, new"),
        ({"controllers": [{**NEW, "Kc": 0.0}]}, "Kc", "greater than 0"),
        ({"events": [{"kind": "step"}]}, "events", "does not match"),
        ({"events": [{"kind": "set point", "size": 0.0}]}, "body", "size must not be 0"),
        ({"events": [STEP] * 6}, "events", "at most 5 items"),
        ({"conditions": {"low": 5.0, "high": 1.0}}, "body", "low must be below high"),
        ({"conditions": {"op0": 5.0, "high": 1.0}}, "body", "op0 must lie within the limits"),
        ({"conditions": {"scan_time": 1e-6}}, "body", "Change t_end or scan_time"),
        ({"conditions": {"anti_windup": "magic"}}, "anti_windup", "velocity form"),
        ({"conditions": {"valve": {"model": "He", "fs": 1.0, "fd": 2.0}}}, "body", "fd must not"),
        ({"fan": {}}, "fan", "give either spread or draws"),
        ({"fan": {"spread": 0.5, "count": 501}}, "count", "less than or equal to 500"),
        ({"fan": {"draws": [[1.0, 2.0]]}}, "body", "draws of FOPDT have 3 columns"),
        ({"fan": {"draws": [[1.0, 2.0], [1.0, 2.0, 3.0]]}}, "body", "equally long"),
        ({"fan": {"draws": [[1.0, -2.0, 3.0]]}}, "body", "tau1 must be 0 or lie within"),
        ({"colour": "red"}, "colour", "not permitted"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(
    client: TestClient, changes: dict[str, Any], pointer: str, words: str
) -> None:
    answer = ask(client, **changes)

    assert answer.status_code == 422, answer.text
    faults = answer.json()["errors"]
    assert any(pointer in fault["pointer"] and words in fault["detail"] for fault in faults), faults


@pytest.mark.parametrize("fan", [None, {"spread": 0.5, "count": 500}])
def test_a_dead_time_of_millions_of_scans_is_refused_before_it_fills_the_memory(
    client: TestClient, fan: dict[str, Any] | None
) -> None:
    # With the fan a tenth as many scans are already too many.
    scan_time = 1e-5 if fan is None else 1e-3
    conditions = {"scan_time": scan_time, "t_end": 10 * scan_time}
    answer = ask(client, conditions=conditions, fan=fan)
    assert answer.status_code == 422, answer.text
    assert "a dead time of" in answer.text
