"""Plant-wide questions over REST: the answer of a notebook, and sentences for what cannot be."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL

from advice.plantwide import plant_oscillations
from advice.plantwide_body import plantwide_body
from historian.samples import Samples
from service.samples import open_samples
from service.settings import Settings
from tests.service.conftest import TIC101

ROWS = 900
DAY = {"start": "2026-01-31T00:00:00Z", "end": "2026-02-01T00:00:00Z"}


@pytest.fixture
def database_url(sqlite_url: URL) -> URL:
    """One kind will do: nothing is written."""
    return sqlite_url


@pytest.fixture
def swinging(client: TestClient, settings: Settings) -> list[str]:
    """Two loops with one swing, and a third with none."""
    rng = np.random.default_rng(1)
    swing = np.sin(2 * np.pi * np.arange(ROWS) / 30)
    ids = []
    for n, part in enumerate((1.0, -3.0, 0.0)):
        loop = client.post("/v1/loops", json=TIC101 | {"tag": f"TIC-{n}"}).json()
        pv = 50.0 + part * swing + 0.2 * rng.normal(size=ROWS)
        stamps = np.arange(ROWS).astype("timedelta64[m]")
        open_samples(settings).write(
            loop["id"],
            Samples(
                time=np.datetime64("2026-01-31T00:00:00", "us") + stamps,
                pv=pv,
                sp=np.full(ROWS, 50.0),
                op=40.0 - (pv - 50.0),
                mode=np.ones(ROWS, np.int8),
            ),
        )
        ids.append(loop["id"])
    return ids


def test_loops_that_swing_together_are_found_as_in_a_notebook(
    client: TestClient, swinging: list[str], settings: Settings
) -> None:
    answer = client.post("/v1/plantwide", json={**DAY, "loop_ids": swinging})
    assert answer.status_code == 200, answer.text
    body = answer.json()
    (group,) = body["groups"]
    assert {one["tag"] for one in group["suspects"]} == {"TIC-0", "TIC-1"}
    assert group["period"] == pytest.approx(1800.0, rel=0.02)

    store = open_samples(settings)
    records = [store.read(id_).record(tag=f"TIC-{n}") for n, id_ in enumerate(swinging)]
    assert body == plantwide_body(plant_oscillations(records))


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"loop_ids": []}, 422),
        ({"loop_ids": ["00000000-0000-0000-0000-000000000000"] * 2}, 404),
        ({"end": "2026-01-30T00:00:00Z"}, 422),
        ({"start": "2027-01-01T00:00:00Z", "end": "2027-01-02T00:00:00Z"}, 404),
    ],
)
def test_what_cannot_be_asked_is_said_so(
    client: TestClient, swinging: list[str], change: dict[str, Any], status: int
) -> None:
    answer = client.post("/v1/plantwide", json={**DAY, "loop_ids": swinging} | change)
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"


def test_nobody_asks_without_a_key(anonymous: TestClient, swinging: list[str]) -> None:
    answer = anonymous.post("/v1/plantwide", json={**DAY, "loop_ids": swinging})
    assert answer.status_code == 401


def test_a_viewer_may_ask_as_nothing_is_stored(
    client_as: Callable[..., TestClient], swinging: list[str]
) -> None:
    answer = client_as("viewer").post("/v1/plantwide", json={**DAY, "loop_ids": swinging})
    assert answer.status_code == 200


def test_more_samples_than_one_answer_may_look_at_are_refused(
    client: TestClient, swinging: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.plantwide.actions.MOST_SAMPLES", 2 * ROWS)
    asked = {**DAY, "loop_ids": swinging}
    assert client.post("/v1/plantwide", json={**asked, "loop_ids": swinging[:2]}).status_code == 200
    answer = client.post("/v1/plantwide", json=asked)
    assert answer.status_code == 422
    assert "more than 1,800 samples" in answer.text
