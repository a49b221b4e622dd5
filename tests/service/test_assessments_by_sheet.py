"""Assessments by the loop's sheet: its model, and its settings where they ran."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL

from historian.samples import Samples
from loop.controller import PID
from loop.process import FOPDT
from loop.simulation import simulate
from service.assessments.work import assess_period
from service.database import Database
from service.jobs.worker import Worker
from service.samples import open_samples
from service.settings import Settings
from service.tables import now

MIDNIGHT = datetime(2026, 1, 31, tzinfo=UTC)


@pytest.fixture
def database_url(sqlite_url: URL) -> URL:
    """One kind will do: sheets are only read."""
    return sqlite_url


def moving(start: datetime) -> Samples:
    """A day of a loop that follows its set point under Kc 0.9 and Ti 600 s."""
    sp = 50.0 + 5.0 * ((np.arange(1440) // 90) % 2)
    run = simulate(
        FOPDT(K=1.0, tau=600.0, theta=240.0), PID(Kc=0.9, Ti=600.0), t_end=1439 * 60.0, dt=60.0,
        sp=sp, pv0=50.0, op0=40.0, noise=0.1, rng=np.random.default_rng(4),
    )  # fmt: skip
    begin = np.datetime64(start.replace(tzinfo=None), "us")
    return Samples(
        time=begin + np.arange(1440).astype("timedelta64[m]"),
        pv=run.pv, sp=run.sp, op=run.op, mode=np.ones(1440, np.int8),
    )  # fmt: skip


def approve(client_as: Callable[..., TestClient], loop: str, Kc: float, K: float | None) -> None:
    """Draft a sheet, with a model of gain K, and approve it."""
    anna, berta = client_as("engineer", owner="Anna"), client_as("approver", owner="Berta")
    model = None
    if K is not None:
        process = {"kind": "FOPDT", "K": K, "tau": 600.0, "theta": 240.0}
        model = anna.post(f"/v1/loops/{loop}/models", json={"process": process}).json()["id"]
    settings = {"form": "isa", "Kc": Kc, "Ti": 600.0, "anti_windup": "clamping", "scan_time": 60.0}
    drafted = anna.post(
        f"/v1/loops/{loop}/sheets",
        json={"settings": settings, "model_id": model, "reason": "as found"},
    )
    answer = berta.post(
        f"{drafted.headers['Location']}/approve",
        json={"reason": "fine"},
        headers={"If-Match": drafted.headers["ETag"]},
    )
    assert answer.status_code == 200, answer.text


def test_the_sheet_in_force_says_what_to_expect_of_a_loop(
    client: TestClient,
    client_as: Callable[..., TestClient],
    tic101: dict[str, Any],
    settings: Settings,
    held: Database,
) -> None:
    loop, today = tic101["id"], now().replace(hour=0, minute=0, second=0, microsecond=0)
    tomorrow, this_day = today + timedelta(days=1), today
    for start in (this_day, tomorrow, MIDNIGHT):
        open_samples(settings).write(loop, moving(start))

    def found(start: datetime, **asked: Any) -> dict[str, Any]:
        period = {"start": start.isoformat(), "end": (start + timedelta(days=1)).isoformat()}
        answer = client.post(f"/v1/loops/{loop}/assessments", json=period | asked)
        assert answer.status_code == 201, answer.text
        control: dict[str, Any] = answer.json()["assessment"]["indices"]["control"]
        return control

    assert found(tomorrow)["model"] is None
    approve(client_as, loop, 0.9, None)
    assert found(tomorrow)["model"] is None  # a sheet without a model

    approve(client_as, loop, 0.9, 1.0)
    right = found(tomorrow)["model"]
    assert right["mismatch"]["verdict"] == "agrees"
    assert right["expected_response"]["as_expected"] is True
    assert right["best_PI"]["stated_over_actual"] == pytest.approx(1.0, abs=0.1)
    assert right["best_PI"]["index"] <= 1.1

    approve(client_as, loop, 0.6, 2.0)
    wrong = found(tomorrow)["model"]
    assert wrong["mismatch"]["verdict"] == "does not agree"
    assert wrong["mismatch"]["suspect"] == "gain"
    # Its settings came in the course of today: the model is asked about, the settings are not.
    for day in (this_day, MIDNIGHT):
        before = found(day)["model"]
        assert before["mismatch"]["verdict"] == ("agrees" if day < this_day else "does not agree")
        assert before["expected_response"]["basis"]["reasons"] == ["no settings are known"]

    # What is stated with the question counts before the sheet.
    process = {"kind": "FOPDT", "K": 1.0, "tau": 600.0, "theta": 240.0}
    stated = found(tomorrow, process=process, running={"Kc": 0.3, "Ti": 600.0}, tau_c=240.0)
    assert stated["model"]["mismatch"]["verdict"] == "agrees"
    assert "faster than expected" in stated["model"]["expected_response"]["departures"]
    assert stated["desired_settling"]["tau_c"] == 240.0

    period = {"start": tomorrow.isoformat(), "end": (tomorrow + timedelta(days=1)).isoformat()}
    job = client.post("/v1/assessments", json=period).headers["Location"]
    assess_all = partial(assess_period, open_samples(settings), None)
    assert Worker(held, {"assess": assess_all}).work_once()
    (listed,) = client.get("/v1/assessments", params={"job_id": job.split("/")[-1]}).json()["items"]
    body = client.get(f"/v1/assessments/{listed['id']}").json()["assessment"]
    assert body["indices"]["control"]["model"] == wrong
