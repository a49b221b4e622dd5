"""Models over REST: identified from stored samples, or stated; refusals kept with their reasons."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import UUID, uuid4

import numpy as np
import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from sqlalchemy.orm import Session, sessionmaker

from historian.samples import Samples
from identification.identify import identify
from loop.open_loop import process_output
from loop.process import FOPDT
from loop.record import Record
from service.samples import open_samples
from service.tables import RecordRow

START = datetime(2026, 3, 1, 8, tzinfo=UTC)


def step_test(*, moves: bool = True) -> Record:
    t = np.arange(0.0, 2400.0, 4.0)
    op = np.where((t >= 200) & (t < 1400), 50.0, 40.0) if moves else np.full(t.size, 40.0)
    pv = 60 + process_output(FOPDT(K=2.0, tau=120.0, theta=30.0), t, op, op_before=40.0)
    noise = np.random.default_rng(2).normal(0, 0.05, t.size)
    return Record(t=t, pv=pv + noise, op=op, start=START)


@pytest.fixture
def stored(
    app: FastAPI, sessions: sessionmaker[Session], tic101: dict[str, Any]
) -> Callable[[Record], str]:
    """Store a record of TIC-101 as an upload does, and give its id."""

    def store(record: Record) -> str:
        samples = Samples.of(record)
        open_samples(app.state.settings).write(tic101["id"], samples)
        row = RecordRow(
            loop_id=UUID(tic101["id"]),
            file_name="step.csv",
            sha256="0" * 64,
            bytes=1,
            decisions={},
            decisions_sha256=uuid4().hex,
            accounting={},
            samples=len(samples),
            first_time=START,
            last_time=START + timedelta(seconds=record.span),
            state="stored",
            author="somebody",
        )
        with sessions.begin() as session:
            session.add(row)
        return str(row.id)

    return store


def test_a_model_from_a_record_is_the_one_the_library_finds(
    client: TestClient, tic101: dict[str, Any], stored: Callable[[Record], str]
) -> None:
    record = step_test()
    address = f"/v1/loops/{tic101['id']}/models"
    answer = client.post(address, json={"record_id": stored(record)})

    assert answer.status_code == 201, answer.text
    body = answer.json()
    expected = identify(record)
    assert isinstance(expected.process, FOPDT)
    assert body["K"] == pytest.approx(expected.process.K, rel=1e-6)
    assert body["theta"] == pytest.approx(expected.process.theta, rel=1e-6)
    assert (body["verdict"], body["reasons"]) == (expected.verdict, list(expected.reasons))
    assert body["data"]["tag"] == "TIC-101"
    assert client.get(answer.headers["Location"]).json() == body
    assert client.get(address).json()["items"] == [body]

    tuned = client.post(f"/v1/loops/{tic101['id']}/tunings", json={"model_id": body["id"]})
    assert tuned.status_code == 201
    assert tuned.json()["process"]["K"] == body["K"]
    assert tuned.json()["model"]["standard_errors"] == body["standard_errors"]


def test_a_refusal_is_kept_and_cannot_be_tuned(
    client: TestClient, tic101: dict[str, Any], stored: Callable[[Record], str]
) -> None:
    answer = client.post(
        f"/v1/loops/{tic101['id']}/models", json={"record_id": stored(step_test(moves=False))}
    )

    assert answer.status_code == 201
    body = answer.json()
    assert (body["verdict"], body["K"]) == ("refused", None)
    assert body["reasons"]
    tuned = client.post(f"/v1/loops/{tic101['id']}/tunings", json={"model_id": body["id"]})
    assert tuned.status_code == 422
    assert tuned.json()["type"].endswith("/fit-not-trusted")
    assert body["reasons"][0] in tuned.json()["detail"]


def test_part_of_a_record_and_the_output_before_it_can_be_stated(
    client: TestClient, tic101: dict[str, Any], stored: Callable[[Record], str]
) -> None:
    record_id = stored(step_test())
    from_the_step = {
        "record_id": record_id,
        "start": (START + timedelta(seconds=200)).isoformat(),
        "end": (START + timedelta(seconds=1400)).isoformat(),
    }
    address = f"/v1/loops/{tic101['id']}/models"
    blind = client.post(address, json=from_the_step).json()
    told = client.post(address, json={**from_the_step, "op_before": 40.0}).json()

    assert blind["verdict"] == "refused"
    assert told["K"] == pytest.approx(2.0, rel=0.03)
    assert told["data"]["rows"] == 300


def test_a_stated_process_is_a_model(client: TestClient, tic101: dict[str, Any]) -> None:
    process = {"kind": "IPDT", "K": 0.01, "theta": 5.0}
    answer = client.post(f"/v1/loops/{tic101['id']}/models", json={"process": process})

    assert answer.status_code == 201, answer.text
    assert answer.json()["verdict"] == "stated"
    assert answer.json()["parameters"] == {"K": 0.01, "theta": 5.0}
    lines = client.get("/v1/audit", params={"action": "model.added"}).json()["items"]
    assert [line["after"]["kind"] for line in lines] == ["IPDT"]


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"process": {"kind": "FOPDT", "K": 1.0, "tau": 2.0, "theta": 1.0}, "op_before": 3.0},
        {"record_id": "not an id"},
        {"record_id": str(uuid4()), "start": "2026-03-01T08:00:00"},
        {"record_id": str(uuid4()), "op_before": "40"},
    ],
)
def test_what_cannot_be_is_refused(
    client: TestClient, tic101: dict[str, Any], body: dict[str, Any]
) -> None:
    answer = client.post(f"/v1/loops/{tic101['id']}/models", json=body)
    assert answer.status_code == 422, answer.text
    assert answer.json()["errors"]


def test_a_record_must_be_the_loops_own_and_reach_into_the_span(
    client: TestClient, tic101: dict[str, Any], stored: Callable[[Record], str]
) -> None:
    record_id = stored(step_test())
    other = client.post("/v1/loops", json={**_plain(tic101), "tag": "TIC-102"}).json()
    stolen = client.post(f"/v1/loops/{other['id']}/models", json={"record_id": record_id})
    assert stolen.status_code == 404
    late = {"record_id": record_id, "start": "2027-01-01T00:00:00Z"}
    assert client.post(f"/v1/loops/{tic101['id']}/models", json=late).status_code == 404


def _plain(loop: dict[str, Any]) -> dict[str, Any]:
    answers_only = {"id", "version", "archived", "created_at", "created_by", "changed_at"}
    return {name: value for name, value in loop.items() if name not in answers_only}


def test_intervals_by_bootstrap_come_on_request(
    client: TestClient, tic101: dict[str, Any], stored: Callable[[Record], str]
) -> None:
    address = f"/v1/loops/{tic101['id']}/models"
    asked = {"record_id": stored(step_test()), "bootstrap": True}
    body = client.post(address, json=asked).json()
    low, high = body["bootstrap"]["intervals_95"]["K"]
    assert low < body["K"] < high
    stated = {"process": {"kind": "IPDT", "K": 1.0, "theta": 2.0}, "bootstrap": True}
    assert client.post(address, json=stated).status_code == 422
