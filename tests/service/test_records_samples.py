"""Samples read back, thinned for a plot."""

from collections.abc import Callable
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL


@pytest.fixture
def database_url(sqlite_url: URL) -> URL:
    """Say which database: it knows nothing of what these tests are about."""
    return sqlite_url


@pytest.fixture
def records(tic101: dict[str, Any]) -> str:
    return f"/v1/loops/{tic101['id']}/records"


@pytest.fixture
def samples(tic101: dict[str, Any]) -> str:
    return f"/v1/loops/{tic101['id']}/samples"


@pytest.fixture
def read(client: TestClient, records: str, samples: str) -> Callable[..., dict[str, Any]]:
    """Store two days of samples a minute apart, with a bad hour and a day without any."""
    rows = []
    for n in [*range(1440), *range(2 * 1440, 3 * 1440)]:
        day, hour, minute = 1 + n // 1440, n // 60 % 24, n % 60
        pv = "Bad" if day == 1 and hour == 5 else str(50 + n % 100 + 1000 * (n == 777))
        mode = "MAN" if day == 1 and 8 <= hour < 10 else "AUTO"
        rows.append(f"2026-02-{day:02d}T{hour:02d}:{minute:02d}:00Z,{pv},{n % 7},50,{mode}\n")
    content = "time,PV,OP,SP,MODE\n" + "".join(rows)
    answer = client.post(records, files={"file": ("two days.csv", content)})
    assert answer.status_code == 201, answer.text

    def read(**query: Any) -> dict[str, Any]:
        answer = client.get(samples, params=query)
        assert answer.status_code == 200, answer.text
        body: dict[str, Any] = answer.json()
        return body

    return read


def test_a_picture_has_few_points_with_extremes_gaps_and_changes_of_mode(
    read: Callable[..., dict[str, Any]], client: TestClient, samples: str
) -> None:
    body = read(max_points=60)
    pv = body["pv"]
    known = [value for value in pv["values"] if value is not None]
    assert body["samples"] == 2880
    assert (body["first_time"], body["last_time"]) == (
        "2026-02-01T00:00:00Z", "2026-02-03T23:59:00Z"
    )  # fmt: skip
    assert len(pv["values"]) == len(pv["time"]) <= 60
    assert (min(known), max(known)) == (50, 1127)
    assert pv["values"].count(None) == 2  # the bad hour and the day without samples
    assert pv["time"] == sorted(pv["time"])
    assert body["op"]["values"].count(None) == 1
    assert set(body["sp"]["values"]) == {50, None}
    assert body["mode"] == {
        "time": [f"2026-02-01T{hour}:00:00.000000Z" for hour in ("00", "08", "10")],
        "values": ["AUTO", "MAN", "AUTO"],
    }
    assert len(read(max_points=2)["mode"]["values"]) == 2

    whole = read(max_points=20_000)
    assert len(whole["pv"]["values"]) == 2880 - 60 + 2
    bridged = read(max_points=20_000, max_gap=200_000)
    assert len(bridged["pv"]["values"]) == 2880 - 60

    part = read(start="2026-02-01T08:00:00Z", end="2026-02-01T09:00:00+00:00")
    assert part["samples"] == 60
    assert part["pv"]["time"][0] == "2026-02-01T08:00:00.000000Z"
    assert part["mode"]["values"] == ["MAN"]
    nothing = read(start="2027-01-01T00:00:00Z")
    assert (nothing["samples"], nothing["first_time"]) == (0, None)
    assert nothing["pv"] == nothing["mode"] == {"time": [], "values": []}

    for query in (
        {"start": "2026-02-01T08:00:00"},
        {"start": "1769846400"},
        {"start": "2026-02-02T00:00:00Z", "end": "2026-02-01T00:00:00Z"},
        {"max_points": 0},
        {"max_points": 20_001},
        {"max_gap": -1},
    ):
        assert client.get(samples, params=query).status_code == 422, query
