"""Plans over REST: the document of the command line."""

import json

from fastapi.testclient import TestClient

from advice.planning import plan_body, plan_test
from identification.planner import Wishes
from identification.pulse_planner import PulseWishes
from loop.process import FOPDT, IPDT

HEATER = {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 30.0}


def test_a_plan_is_that_of_the_command_line(client: TestClient) -> None:
    wishes = Wishes(guess=FOPDT(K=2.0, tau=120.0, theta=30.0), noise=0.1, deviation=5.0)
    for kind in ("steps", "relay"):
        body = {"kind": kind, "process": HEATER, "noise": 0.1, "deviation": 5.0}
        answer = client.post("/v1/plans", json=body)
        assert answer.status_code == 200, answer.text
        plan = plan_test(wishes, "relay" if kind == "relay" else "steps")
        assert answer.json() == json.loads(json.dumps(plan_body(plan)))


def test_an_integrator_gets_pulses_on_every_way(client: TestClient) -> None:
    body = {"process": {"kind": "IPDT", "K": 0.002, "theta": 10.0}, "noise": 0.05, "deviation": 2.0}
    answer = client.post("/v1/plans", json=body)
    assert answer.status_code == 200, answer.text
    assert answer.json()["kind"] == "pulses"
    assert len(answer.json()["expected_errors"]) == 2
    guess = IPDT(K=0.002, theta=10.0)
    plan = plan_test(PulseWishes(guess=guess, noise=0.05, deviation=2.0))
    assert answer.json() == json.loads(json.dumps(plan_body(plan)))
    relay = client.post("/v1/plans", json={**body, "kind": "relay"})
    assert relay.status_code == 422
    assert "an integrator gets pulses" in relay.text


def test_what_cannot_be_planned_is_refused_with_its_reason(client: TestClient) -> None:
    body = {"process": HEATER, "noise": 0.1, "deviation": 5.0}
    nowhere = client.post("/v1/plans", json={**body, "room_up": 0.0, "room_down": 0.0})
    assert nowhere.status_code == 422
    assert "nor both 0" in nowhere.text
    unseen = client.post("/v1/plans", json={**body, "kind": "relay", "sample_time": 1000.0})
    assert unseen.status_code == 422
    assert "half of the shortest cycle" in unseen.text
    quiet = client.post("/v1/plans", json={**body, "kind": "relay", "deviation": 0.5})
    assert quiet.status_code == 422
    assert "make a step test" in quiet.json()["detail"]
