"""Tunings of every kind of process over REST: reduced where rules need it, refused with reasons."""

from typing import Any

import pytest
import sqlalchemy
from fastapi.testclient import TestClient

from loop.controller import PID
from loop.half_rule import half_rule
from loop.margins import margins
from loop.process import FOPDT, TransferFunction

COLUMN = {
    "kind": "TransferFunction",
    "numerator": [-0.3, 1.0],
    "denominator": [0.8, 3.2, 3.4, 1.0],
    "theta": 0.5,
}
KINDS: dict[str, dict[str, Any]] = {
    "SOPDT": {"kind": "SOPDT", "K": -2.0, "tau1": 20.0, "tau2": 5.0, "theta": 3.0},
    "IPDT": {"kind": "IPDT", "K": 0.01, "theta": 30.0},
    "DoubleIntegrator": {"kind": "DoubleIntegrator", "K": -0.01, "theta": 3.0},
    "PureDelay": {"kind": "PureDelay", "K": -1.5, "theta": 3.0},
    "IntegratorWithLag": {"kind": "IntegratorWithLag", "K": -0.2, "tau": 4.0, "theta": 1.0},
    "TransferFunction": COLUMN,
}


@pytest.fixture
def database_url(sqlite_url: sqlalchemy.URL) -> sqlalchemy.URL:
    """One database is enough: what is tuned here is hardly stored."""
    return sqlite_url


def test_every_kind_of_process_is_tuned_with_the_action_its_gain_needs(client: TestClient) -> None:
    for process in KINDS.values():
        _is_tuned(client, process)


def _is_tuned(client: TestClient, process: dict[str, Any]) -> None:
    answer = client.post("/v1/tunings", json={"process": process, "running": {"Kc": 0.1, "Ti": 50}})

    assert answer.status_code == 200, answer.text
    body = answer.json()
    negative = process.get("K", 1.0) < 0
    assert body["tunings"]
    assert {t["action"] for t in body["tunings"]} == {"direct" if negative else "reverse"}
    assert body["running"]["action"] == ("direct" if negative else "reverse")
    assert body["recommended_reason"]
    reduced = process is COLUMN
    assert bool(body["reductions"]) == reduced
    assert all((t["full_process"] is not None) == reduced for t in body["tunings"])
    assert ("full_process" in body["running"]) == reduced


def test_the_reduction_and_the_margins_on_the_full_process_are_shown(client: TestClient) -> None:
    """Second route: the half rule and the scalar margins of the process itself."""
    body = client.post("/v1/tunings", json={"process": COLUMN}).json()
    process = TransferFunction((-0.3, 1.0), (0.8, 3.2, 3.4, 1.0), 0.5)

    assert body["process"] == COLUMN
    first, second = body["reductions"]
    model = half_rule(process).model
    assert isinstance(model, FOPDT)
    assert first["model"] == {"kind": "FOPDT", "K": model.K, "tau": 2.5, "theta": model.theta}
    assert first["neglected"][0] == "the zero (-0.3 s + 1) to the dead time, 0.3 s"
    assert second["model"]["kind"] == "SOPDT"
    best = body["recommended"]
    assert best["passes"]
    assert best["full_process"]["passes"]
    simc = next(t for t in body["tunings"] if (t["rule"], t["structure"]) == ("simc", "PI"))
    assert simc["full_process"]["model"] == "FOPDT"
    alone = margins(process, PID(Kc=simc["Kc"], Ti=simc["Ti"]))
    assert simc["full_process"]["margins"]["Ms"] == pytest.approx(alone.Ms)
    assert not simc["passes"]
    assert "±50 %" in body["recommended_reason"]


def test_a_transfer_function_that_is_a_low_order_model_is_answered_as_that(
    client: TestClient,
) -> None:
    written = {**COLUMN, "numerator": [2.0], "denominator": [120.0, 1.0], "theta": 30.0}
    heater = {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 30.0}
    one = client.post("/v1/tunings", json={"process": written}).json()
    assert one == client.post("/v1/tunings", json={"process": heater}).json()


def test_a_batch_takes_every_kind(client: TestClient) -> None:
    answer = client.post("/v1/tunings/batch", json={"processes": list(KINDS.values())})
    assert answer.status_code == 200, answer.text
    assert len(answer.json()["items"]) == len(KINDS)


def test_a_batch_takes_few_processes_that_swing_by_themselves(client: TestClient) -> None:
    swinging = {**COLUMN, "numerator": [2.0], "denominator": [100.0, 6.0, 1.0], "theta": 5.0}
    answer = client.post("/v1/tunings/batch", json={"processes": [swinging] * 21})
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["pointer"] == "body/processes"
    assert "21 of the processes swing by themselves" in error["detail"]
    one = client.post("/v1/tunings/batch", json={"processes": [swinging]})
    assert one.json()["items"][0]["recommended"]["rule"] == "least_area"


def test_a_stated_model_of_any_kind_is_kept_and_tuned(
    client: TestClient, tic101: dict[str, Any]
) -> None:
    address = f"/v1/loops/{tic101['id']}"
    for process in (COLUMN, KINDS["PureDelay"], KINDS["IntegratorWithLag"]):
        model = client.post(f"{address}/models", json={"process": process})
        assert model.status_code == 201, model.text
        body = {"model_id": model.json()["id"]}
        by_model = client.post(f"{address}/tunings", json=body)
        assert by_model.status_code == 201, by_model.text
        by_hand = client.post(f"{address}/tunings", json={"process": process}).json()
        assert by_model.json()["tunings"] == by_hand["tunings"]


def test_what_no_published_rule_covers_is_refused_with_the_reason(client: TestClient) -> None:
    for change, words in (
        ({"denominator": [-3.0, 1.0], "numerator": [1.0]}, "the process is unstable"),
        ({"denominator": [4.0, 4.4, 1.4, 1.0]}, "oscillates by itself"),
        ({"numerator": [1.0, 0.1, 1.0]}, "complex zeros"),
        ({"numerator": [1.0, 0.0]}, "passes no constants"),
    ):
        process = {**COLUMN, **change}
        answer = client.post("/v1/tunings", json={"process": process})
        assert answer.status_code == 422
        assert words in answer.json()["detail"]
        many = client.post("/v1/tunings/batch", json={"processes": [process]})
        assert many.status_code == 422
        assert words in many.json()["errors"][0]["detail"]


def test_a_bad_process_gets_a_sentence(client: TestClient) -> None:
    delay = {"kind": "PureDelay", "K": 1.0, "theta": 1.0}
    lag = {"kind": "IntegratorWithLag", "K": 1.0, "tau": 1.0, "theta": 1.0}
    for process, words in (
        ({**COLUMN, "numerator": [1.0, 1.0, 1.0, 1.0, 1.0]}, "must be proper"),
        ({**COLUMN, "numerator": [0.0, 0.0]}, "not all zero"),
        ({**COLUMN, "denominator": []}, "at least 1"),
        ({**COLUMN, "denominator": [1.0] * 17}, "at most 16"),
        ({**COLUMN, "denominator": [1e13, 1.0]}, "less than or equal"),
        ({**COLUMN, "theta": -1.0}, "greater than or equal to 0"),
        ({**COLUMN, "theta": "1"}, "valid number"),
        ({**COLUMN, "K": 1.0}, "not permitted"),
        ({**delay, "theta": 0.0}, "greater than or equal"),
        ({**delay, "K": 0.0}, "K must lie within"),
        ({**lag, "tau": 0.0}, "greater than or equal"),
        ({**lag, "theta": 1e12}, "less than or equal"),
    ):
        answer = client.post("/v1/tunings", json={"process": process})
        assert answer.status_code == 422, answer.text
        faults = answer.json()["errors"]
        assert any(words in fault["detail"] for fault in faults), (process, faults)
