"""`loopwright scorecard`, `overrule` and `sheet effect` on an installation."""

import json
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL

from historian.samples import Samples
from service.cli import run
from service.samples import open_samples
from service.settings import Settings
from tests.service.conftest import TIC101

Body = dict[str, Any]
Said = Any


@pytest.fixture
def database_url(sqlite_url: URL) -> URL:
    """One kind will do: the commands do what the routes do."""
    return sqlite_url


@pytest.fixture
def assessed(client: TestClient, settings: Settings, acting_as: Any, said: Said) -> Body:
    """A day of two loops, one of them worth money and halved in its error at noon."""
    for tag, worth in (("TIC-1", 500.0), ("TIC-2", None)):
        loop: Body = client.post("/v1/loops", json=TIC101 | {"tag": tag, "worth": worth}).json()
        size = np.where(np.arange(2880) < 1440, 2.0, 1.0)
        pv = 50 + size * np.random.default_rng(1).normal(size=2880)
        open_samples(settings).write(
            loop["id"],
            Samples(
                time=np.datetime64("2026-01-31T00:00", "us")
                + 30 * np.arange(2880).astype("timedelta64[s]"),
                pv=pv, sp=np.full(2880, 50.0), op=np.full(2880, 99.99),
                mode=np.ones(2880, np.int8),
            ),
        )  # fmt: skip
    acting_as("Anna", "engineer")
    assert run(["scorecard"]) == 3
    assert "no scorecard yet: assess the plant first" in said()[1]
    assert run(["assess", "--day", "2026-01-31", "--processes", "1"]) == 0
    said()
    return loop


@pytest.mark.usefixtures("assessed")
def test_a_person_overrules_what_the_scorecard_lists(client: TestClient, said: Said) -> None:
    assert run(["scorecard", "--by", "cost"]) == 0
    out = said()[0]
    plant = out.splitlines()[1].split()
    assert plant[:4] == ["the", "plant", "2", "2"]
    worst = next(line for line in out.splitlines() if line.startswith("TIC-1"))
    assessment = worst.split()[-1]
    assert run(["scorecard", "--json"]) == 0
    assert json.loads(said()[0]) == client.get("/v1/scorecard").json()

    call = ["overrule", assessment, "--cause", "valve", "--reason", "Seen at the valve"]
    assert run(call) == 0
    assert "valve in place of constraint" in said()[0]
    assert client.get(f"/v1/assessments/{assessment}").json()["cause"] == "valve"
    line = client.get("/v1/audit").json()["items"][0]
    assert (line["action"], line["actor"]) == ("assessment.overruled", "Anna")

    assert run([*call[:2], "--cause", "magic", "--reason", "Seen"]) == 2
    assert "--cause" in said()[1]


def test_a_sheets_effect_is_told_in_words(
    client: TestClient, client_as: Any, assessed: Body, said: Said
) -> None:
    settings_ = {"form": "isa", "Kc": 1.0, "Ti": 60.0, "anti_windup": "clamping"}
    sheets = f"/v1/loops/{assessed['id']}/sheets"
    drafted = client.post(sheets, json={"settings": settings_, "reason": "slower"})
    assert (
        client_as("approver", owner="Berta")
        .post(
            f"{sheets}/1/approve",
            json={"reason": "ok!"},
            headers={"If-Match": drafted.headers["ETag"]},
        )
        .is_success
    )
    around = ["--days", "0.5", "--changed-at", "2026-01-31T12:00"]
    assert run(["sheet", "effect", "TIC-2", "1", *around]) == 0
    out = said()[0]
    assert out.startswith("TIC-2, version 1, changed at 2026-01-31 12:00:00Z")
    assert "The control error afterwards: better" in out
    assert run(["sheet", "effect", "TIC-2", "1"]) == 1
