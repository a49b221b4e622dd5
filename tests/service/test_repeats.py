"""Repeated tests over REST: pooled with their dates, drift and linearity; bootstrap on request."""

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL

from advice.repeats import repeats_body, repeats_case
from historian.samples import Samples
from loop.record import Record
from service.samples import open_samples
from service.settings import Settings

T = np.arange(0.0, 500.0, 2.0)
OP = np.where(T < 100, 40.0, 50.0)
FIRST = datetime(2026, 1, 1, tzinfo=UTC)


@pytest.fixture
def database_url(sqlite_url: URL) -> URL:
    """One kind will do: nothing is written."""
    return sqlite_url


def bump(k: int) -> Record:
    """A test of the k-th month; the gain falls by 4 % a month."""
    rise = np.where(T > 111, 1 - np.exp(-(T - 111) / 50), 0)
    pv = 20 + 20 * (1 - 0.04 * k) * rise + np.random.default_rng(k).normal(0, 0.1, T.size)
    return Record(t=T, pv=pv, op=OP, start=FIRST + timedelta(days=30 * k))


def test_tests_over_months_are_pooled_and_their_drift_is_told(
    client: TestClient, tic101: dict[str, Any], settings: Settings
) -> None:
    records = [bump(k) for k in range(5)]
    for record in records:
        open_samples(settings).write(tic101["id"], Samples.of(record))
    periods = [
        {"start": r.start.isoformat(), "end": (r.start + timedelta(seconds=600)).isoformat()}
        for r in records
        if r.start is not None
    ]
    answer = client.post(f"/v1/loops/{tic101['id']}/repeats", json={"tests": periods})
    assert answer.status_code == 200, answer.text
    body = answer.json()
    assert body == repeats_body(repeats_case(records))
    assert body["trends"]["K"] == pytest.approx(-0.08 / (30 * 86_400), rel=0.1)
    assert any("K drifts: -1" in note for note in body["notes"])  # by some 17 % over 120 days
    empty = {"start": "2027-01-01T00:00:00Z", "end": "2027-01-02T00:00:00Z"}
    missing = client.post(f"/v1/loops/{tic101['id']}/repeats", json={"tests": [periods[0], empty]})
    assert missing.status_code == 404
    one = client.post(f"/v1/loops/{tic101['id']}/repeats", json={"tests": periods[:1]})
    assert one.status_code == 422


def test_tests_at_several_levels_tell_whether_the_gain_depends_on_them() -> None:
    def at(level: float, gain: float) -> Record:
        rise = np.where(T > 111, 1 - np.exp(-(T - 111) / 50), 0)
        noise = np.random.default_rng(int(level)).normal(0, 0.05, T.size)
        return Record(
            t=T, pv=20 + 10 * gain * rise + noise, op=np.where(T < 100, level, level + 10)
        )

    case = repeats_case([at(20, 2.0), at(40, 1.9), at(60, 1.8), at(80, 1.7)])
    assert case.level is not None
    assert case.level.certain
    assert "not linear" in str(repeats_body(case)["notes"])
