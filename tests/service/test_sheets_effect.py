"""Did a sheet version help? The routine data before and after it came into force."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL

from historian.samples import Samples
from service.samples import open_samples
from service.settings import Settings

CHANGED = datetime(2026, 1, 31, 12, tzinfo=UTC)


@pytest.fixture
def database_url(sqlite_url: URL) -> URL:
    """One kind will do: nothing is written but sheets."""
    return sqlite_url


@pytest.fixture
def approved(
    client_as: Callable[..., TestClient], tic101: dict[str, Any], settings: Settings
) -> str:
    """Approve a sheet of a loop whose error is halved at noon."""
    rows = 2880
    minutes = np.arange(rows).astype("timedelta64[m]")
    size = np.where(np.arange(rows) < rows // 2, 2.0, 1.0)
    noise = size * np.random.default_rng(1).normal(size=rows)
    open_samples(settings).write(
        tic101["id"],
        Samples(
            time=np.datetime64("2026-01-30T12:00", "us") + minutes,
            pv=50.0 + noise,
            sp=np.full(rows, 50.0),
            op=np.full(rows, 40.0),
            mode=np.ones(rows, np.int8),
        ),
    )
    sheets = f"/v1/loops/{tic101['id']}/sheets"
    settings_ = {"form": "isa", "Kc": 1.0, "Ti": 60.0, "anti_windup": "clamping"}
    drafted = client_as("engineer", owner="Anna").post(
        sheets, json={"settings": settings_, "reason": "slower"}
    )
    answer = client_as("approver", owner="Berta").post(
        f"{sheets}/1/approve",
        json={"reason": "fine"},
        headers={"If-Match": drafted.headers["ETag"]},
    )
    assert answer.status_code == 200, answer.text
    return f"{sheets}/1/effect"


def test_the_error_after_over_the_error_before_with_its_interval(
    client: TestClient, approved: str
) -> None:
    answer = client.get(approved, params={"changed_at": CHANGED.isoformat(), "days": 1})
    assert answer.status_code == 200, answer.text
    body = answer.json()

    comparison = body["effect"]["comparison"]
    assert comparison["change"] == "better"
    assert comparison["low"] < 0.5 < comparison["high"] < 0.6
    assert body["before"] == [
        (CHANGED - timedelta(days=1)).isoformat().replace("+00:00", "Z"),
        CHANGED.isoformat().replace("+00:00", "Z"),
    ]


def test_without_data_around_the_approval_it_says_so(client: TestClient, approved: str) -> None:
    answer = client.get(approved)  # it was approved today, and the data are of January
    assert (answer.status_code, answer.json()["type"]) == (404, "/problems/no-samples")


def test_a_draft_changed_nothing(client: TestClient, approved: str) -> None:
    sheets = approved.removesuffix("/1/effect")
    settings = {"form": "isa", "Kc": 2.0, "Ti": 60.0, "anti_windup": "clamping"}
    assert client.post(sheets, json={"settings": settings, "reason": "faster"}).status_code == 201

    answer = client.get(f"{sheets}/2/effect")
    assert (answer.status_code, answer.json()["type"]) == (409, "/problems/never-in-force")
    assert client.get(f"{sheets}/3/effect").status_code == 404


@pytest.mark.parametrize(
    "query",
    [
        {"days": 0},
        {"days": 32},
        {"changed_at": "noon"},
        {"changed_at": "0001-01-02T00:00:00Z"},
        {"changed_at": "9999-12-31T00:00:00Z"},
        {"changed_at": "9999-12-31T12:00:00-12:00", "days": 0.1},
    ],
)
def test_a_period_that_cannot_be_is_refused(
    client: TestClient, approved: str, query: dict[str, Any]
) -> None:
    assert client.get(approved, params=query).status_code == 422
