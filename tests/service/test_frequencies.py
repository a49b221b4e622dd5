"""Frequency tests over REST: the answer of a notebook, and sentences for what cannot be."""

from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL

from advice.frequency import frequency_body, frequency_case
from historian.samples import Samples
from loop.controller import PID
from loop.open_loop import process_output
from loop.process import FOPDT
from service.samples import open_samples
from service.settings import Settings

HOUR = {"start": "2026-01-31T00:00:00Z", "end": "2026-01-31T01:00:00Z"}
PATH = "/v1/loops/{id}/frequency-responses"


@pytest.fixture
def database_url(sqlite_url: URL) -> URL:
    """One kind will do: nothing is written."""
    return sqlite_url


@pytest.fixture
def tested(tic101: dict[str, Any], settings: Settings) -> str:
    """A loop with sine steps in manual."""
    t = np.arange(3000) * 1.0
    op = 5 * np.concatenate([np.sin(w * t[:600]) for w in (0.03, 0.07, 0.15, 0.3, 0.5)])
    noise = np.random.default_rng(0).normal(0, 0.05, t.size)
    open_samples(settings).write(
        tic101["id"],
        Samples(
            time=np.datetime64("2026-01-31", "us") + t.astype("timedelta64[s]"),
            pv=80 + process_output(FOPDT(K=2.0, tau=20.0, theta=5.0), t, op) + noise,
            sp=np.full(t.size, np.nan),
            op=40 + op,
            mode=np.zeros(t.size, np.int8),
        ),
    )
    return str(tic101["id"])


def test_the_answer_is_that_of_a_notebook(
    client: TestClient, tested: str, settings: Settings
) -> None:
    body = {**HOUR, "controller": {"Kc": 0.5, "Ti": 20.0}}
    answer = client.post(PATH.format(id=tested), json=body)
    assert answer.status_code == 200, answer.text

    record = open_samples(settings).read(tested).record()
    alone = frequency_case(record, PID(Kc=0.5, Ti=20.0, Td=0.0))
    assert answer.json() == frequency_body(alone)
    assert answer.json()["model"]["theta"] == pytest.approx(5.0, abs=0.3)


def test_a_test_without_moves_is_refused_with_the_reason(
    client: TestClient, tested: str, settings: Settings
) -> None:
    flat = np.full(300, 40.0)
    stamps = np.datetime64("2026-02-01", "us") + np.arange(300).astype("timedelta64[s]")
    still = Samples(time=stamps, pv=flat, sp=flat, op=flat, mode=np.zeros(300, np.int8))
    open_samples(settings).write(tested, still)
    period = {"start": "2026-02-01T00:00:00Z", "end": "2026-02-02T00:00:00Z"}
    answer = client.post(PATH.format(id=tested), json=period)
    assert (answer.status_code, answer.json()["type"]) == (422, "/problems/poor-excitation")


def test_what_is_not_there_is_said_so(client: TestClient, tested: str) -> None:
    nobody = "00000000-0000-0000-0000-000000000000"
    assert client.post(PATH.format(id=nobody), json=HOUR).status_code == 404
    other = {"start": "2025-01-31T00:00:00Z", "end": "2025-01-31T01:00:00Z"}
    assert client.post(PATH.format(id=tested), json=other).status_code == 404
    wrong = {**HOUR, "controller": {"Kc": -1.0, "Ti": 20.0}}
    assert client.post(PATH.format(id=tested), json=wrong).status_code == 422
