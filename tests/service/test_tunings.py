"""Tunings over REST: the document of the command line, stored for a loop or not at all."""

import json
from collections.abc import Callable
from typing import Any
from uuid import uuid4

import pytest
from fastapi.testclient import TestClient

from advice.case_body import case_body
from advice.tune import tune_process
from loop.process import FOPDT

HEATER = {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 30.0}


def test_one_request_answers_every_rule_as_the_command_line_does(client: TestClient) -> None:
    answer = client.post("/v1/tunings", json={"process": HEATER, "profile": "process"})

    assert answer.status_code == 200, answer.text
    case = tune_process(FOPDT(K=2.0, tau=120.0, theta=30.0), profile="process")
    assert answer.json() == json.loads(json.dumps(case_body(case)))


def test_a_tuning_of_a_loop_is_kept_with_its_author_and_one_audit_line(
    client: TestClient, tic101: dict[str, Any]
) -> None:
    address = f"/v1/loops/{tic101['id']}/tunings"
    answer = client.post(address, json={"process": HEATER, "running": {"Kc": 1.0, "Ti": 60.0}})

    assert answer.status_code == 201, answer.text
    body = answer.json()
    assert client.get(answer.headers["Location"]).json() == body
    assert body["author"] == "admin person"
    assert body["profile"]["name"] == tic101["profile"]
    assert body["running"]["margins"]["Ms"] > 1
    lines = client.get("/v1/audit", params={"action": "tuning.proposed"}).json()["items"]
    assert [line["subject"] for line in lines] == [f"loops/{tic101['id']}/tunings/{body['id']}"]
    after = lines[0]["after"]["recommended"]
    assert after["Kc"] == body["recommended"]["Kc"]
    assert "sweep" not in after


def test_the_loops_scan_time_counts_unless_another_is_given(
    client: TestClient, tic101: dict[str, Any]
) -> None:
    address = f"/v1/loops/{tic101['id']}/tunings"
    own = client.post(address, json={"process": HEATER}).json()
    none = client.post(address, json={"process": HEATER, "scan_time": 0.0}).json()

    gap = none["tunings"][0]["margins"]["delay"] - own["tunings"][0]["margins"]["delay"]
    assert gap == pytest.approx(tic101["sample_time"] / 2)


def test_cases_are_listed_newest_first_in_pages(client: TestClient, tic101: dict[str, Any]) -> None:
    address = f"/v1/loops/{tic101['id']}/tunings"
    made = [client.post(address, json={"process": HEATER}).json()["id"] for _ in range(3)]

    first = client.get(address, params={"limit": 2}).json()
    rest = client.get(address, params={"limit": 2, "cursor": first["next"]}).json()
    assert [item["id"] for item in first["items"] + rest["items"]] == made[::-1]
    assert rest["next"] is None
    assert "tunings" not in first["items"][0]
    assert client.get(address, params={"cursor": "bm90LWFuLWlk"}).status_code == 422


def test_many_processes_in_one_request(client: TestClient) -> None:
    processes = [{**HEATER, "theta": theta} for theta in (5.0, 30.0, 120.0)]
    answer = client.post("/v1/tunings/batch", json={"processes": processes})

    assert answer.status_code == 200, answer.text
    items = answer.json()["items"]
    assert [item["process"]["theta"] for item in items] == [5.0, 30.0, 120.0]
    assert items[1] == client.post("/v1/tunings", json={"process": HEATER}).json()
    too_many = client.post("/v1/tunings/batch", json={"processes": [HEATER] * 201})
    assert too_many.status_code == 422


@pytest.mark.parametrize(
    ("body", "pointer", "words"),
    [
        ({"process": {**HEATER, "tau": -3.0}}, "tau", "greater than or equal"),
        ({"process": {**HEATER, "K": 0.0}}, "FOPDT", "K must lie within"),
        ({"process": {**HEATER, "K": "2"}}, "K", "valid number"),
        ({"process": {"kind": "FOPDT", "K": 1.0, "tau": 1.0}}, "theta", "required"),
        ({"process": {"kind": "magic"}}, "process", "kind"),
        ({"process": HEATER, "profile": "bold"}, "profile", "process"),
        ({"process": HEATER, "tau_c": 0.0}, "tau_c", "greater than or equal"),
        ({"process": HEATER, "colour": "red"}, "colour", "not permitted"),
        ({"process": {**HEATER, "tau": 1e9}}, "body", "50 %"),
        ({}, "process", "required"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(
    client: TestClient, body: dict[str, Any], pointer: str, words: str
) -> None:
    answer = client.post("/v1/tunings", json=body)

    assert answer.status_code == 422, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    faults = answer.json()["errors"]
    assert any(pointer in fault["pointer"] and words in fault["detail"] for fault in faults), faults


def test_a_tuning_needs_one_source_and_its_own_loop(
    client: TestClient, tic101: dict[str, Any]
) -> None:
    address = f"/v1/loops/{tic101['id']}/tunings"
    assert client.post(address, json={}).status_code == 422
    both = {"process": HEATER, "model_id": str(uuid4())}
    assert client.post(address, json=both).status_code == 422
    assert client.post(address, json={"model_id": str(uuid4())}).status_code == 404
    assert client.post(f"/v1/loops/{uuid4()}/tunings", json={"process": HEATER}).status_code == 404
    assert client.get(f"{address}/{uuid4()}").status_code == 404
    assert client.get(address).json() == {"items": [], "next": None}


def test_a_viewer_reads_and_does_not_tune(
    client_as: Callable[..., TestClient], tic101: dict[str, Any]
) -> None:
    viewer = client_as("viewer")
    address = f"/v1/loops/{tic101['id']}/tunings"
    assert viewer.get(address).status_code == 200
    assert viewer.post(address, json={"process": HEATER}).status_code == 403
