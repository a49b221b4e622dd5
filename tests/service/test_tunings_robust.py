"""Proofs and optimal settings of a tuning request, only where they are asked for."""

from typing import Any

from fastapi.testclient import TestClient

from loop.controller import PID
from loop.process import FOPDT
from tuning.box_proof import prove_box

HEATER = {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 30.0}


def test_a_request_may_ask_for_proofs(client: TestClient) -> None:
    wanted = {"process": HEATER, "proof": True, "running": {"Kc": 1.0, "Ti": 60.0}}
    answer = client.post("/v1/tunings", json=wanted)

    assert answer.status_code == 200, answer.text
    body = answer.json()
    best, running = body["proof"]["settings"]
    assert best["Kc"] == body["recommended"]["Kc"]
    direct = prove_box(FOPDT(K=2.0, tau=120.0, theta=30.0), PID(Kc=1.0, Ti=60.0))
    assert running["stable"] is direct.stable is False
    assert "optimal" not in body


def test_a_stored_case_keeps_its_proof(client: TestClient, tic101: dict[str, Any]) -> None:
    address = f"/v1/loops/{tic101['id']}/tunings"
    answer = client.post(address, json={"process": HEATER, "proof": True})

    assert answer.status_code == 201, answer.text
    kept = client.get(answer.headers["Location"]).json()
    assert kept["proof"]["settings"][0]["stable"] is True
    assert "optimal" not in kept


def test_a_batch_does_not_take_them(client: TestClient) -> None:
    wanted = {"processes": [HEATER], "proof": True}
    assert client.post("/v1/tunings/batch", json=wanted).status_code == 422


def test_an_open_end_is_told_in_words(client: TestClient) -> None:
    fast = {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 0.0}
    answer = client.post("/v1/tunings", json={"process": fast, "optimal": True, "tau_c": 50.0})

    assert answer.status_code == 200, answer.text
    assert [choice["structure"] for choice in answer.json()["optimal"]] == ["PI", "PID"]
    choice = answer.json()["optimal"][0]
    assert choice["over_box"] is None
    assert "bound the gain" in choice["refusals"][0]
    assert choice["front"] is None
