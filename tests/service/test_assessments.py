"""Assessments: of one loop at once, of the plant by a job, overruled by people, rolled up."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import UUID

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import event, select, update

from advice.assess import assess
from advice.assessment_body import assessment_body
from historian.samples import Samples
from service.database import Database
from service.jobs.worker import Worker
from service.samples import open_samples
from service.settings import Settings
from service.tables import AssessmentRow, JobRow, now
from service.work import kinds
from tests.service.conftest import TIC101

MIDNIGHT = datetime(2026, 1, 31, tzinfo=UTC)
DAY = {"start": "2026-01-31T00:00:00Z", "end": "2026-02-01T00:00:00Z"}
HOUR = {"start": "2026-01-31T06:00:00Z", "end": "2026-01-31T08:00:00Z"}
Plant = Callable[..., list[str]]


def routine(seed: int, *, manual: bool = False) -> Samples:
    """A day at a minute of a loop in automatic that is shaken by a slow disturbance."""
    noise = np.random.default_rng(seed).normal(size=1440)
    pv = 50.0 + np.convolve(noise, 0.8 ** np.arange(30), "same")
    step = np.arange(pv.size).astype("timedelta64[m]")
    return Samples(
        time=np.datetime64("2026-01-31T00:00:00", "us") + step,
        pv=pv,
        sp=np.full(pv.size, 50.0),
        op=np.full(pv.size, 40.0) if manual else 40.0 - 0.5 * (pv - 50.0),
        mode=np.full(pv.size, 0 if manual else 1, np.int8),
    )


@pytest.fixture
def plant(client: TestClient, settings: Settings) -> Plant:
    """Make loops; the last of them has no samples, and the one before is in manual."""

    def make(count: int = 3) -> list[str]:
        store = open_samples(settings)
        made = []
        for n in range(count):
            loop = TIC101 | {"tag": f"TIC-{n}", "area": f"A{n % 2}", "kind": "temperature"}
            made.append(client.post("/v1/loops", json=loop).json()["id"])
            if n < count - 1:
                store.write(made[-1], routine(n, manual=n == count - 2))
        return made

    return make


@pytest.fixture
def work(held: Database, settings: Settings) -> Callable[[], bool]:
    """Do what a worker does, in this process."""
    own = {name: kind for name, kind in kinds(settings, crew=None).items() if name != "assess"} | {
        "assess": _alone(settings)
    }
    return Worker(held, own).work_once


def _alone(settings: Settings) -> Any:
    from functools import partial

    from service.assessments.work import assess_period

    return partial(assess_period, open_samples(settings), None)


def test_one_loop_is_assessed_at_once_and_as_a_notebook_would(
    client: TestClient, plant: Plant, settings: Settings
) -> None:
    loop, *_ = plant()
    answer = client.post(f"/v1/loops/{loop}/assessments", json=HOUR)
    assert answer.status_code == 201, answer.text
    body = answer.json()

    start, end = MIDNIGHT + timedelta(hours=6), MIDNIGHT + timedelta(hours=8)
    samples = open_samples(settings).read(loop, start, end)
    record = samples.record(tag="TIC-0", pv_unit="degC", op_unit="%")
    alone = assess(
        record, kind="temperature", pv_range=(0.0, 200.0), op_range=(0.0, 100.0), gain_sign=1
    )
    assert body["assessment"] == assessment_body(alone)
    assert body["grade"] == alone.grade.points
    assert client.get(answer.headers["Location"]).json() == body
    listed = client.get(f"/v1/loops/{loop}/assessments").json()["items"]
    assert [one["id"] for one in listed] == [body["id"]]


def test_the_plant_is_assessed_by_a_job_that_says_how_far_it_is(
    client: TestClient, plant: Plant, work: Callable[[], bool]
) -> None:
    loops = plant()
    answer = client.post("/v1/assessments", json=DAY)
    assert answer.status_code == 202, answer.text
    job = answer.headers["Location"]
    assert client.get(job).json()["state"] == "queued"

    assert work()
    done = client.get(job).json()
    assert done["state"] == "done"
    assert done["result"] == {"loops": 3, "assessed": 2, "without_samples": 1}
    found = client.get("/v1/assessments", params={"job_id": done["id"]}).json()["items"]
    assert [one["loop_id"] for one in found] == loops[:2]
    assert found[1]["cause"] == "not in use"


def test_the_same_data_give_the_same_answer_alone_and_in_the_fleet(
    client: TestClient, plant: Plant, work: Callable[[], bool]
) -> None:
    loop, *_ = plant()
    alone = client.post(f"/v1/loops/{loop}/assessments", json=DAY).json()
    for period in (DAY, {**DAY, "loop_ids": [loop]}):
        job = client.post("/v1/assessments", json=period).json()["id"]
        assert work()
        of_job = client.get("/v1/assessments", params={"job_id": job, "limit": 1}).json()["items"]
        fleet = client.get(f"/v1/assessments/{of_job[0]['id']}").json()
        assert fleet["assessment"] == alone["assessment"]


def test_a_job_that_was_killed_goes_on_and_stores_no_loop_twice(
    client: TestClient,
    plant: Plant,
    held: Database,
    settings: Settings,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plant(6)
    monkeypatch.setattr("service.assessments.work.LOOPS_A_STEP", 2)
    job = UUID(client.post("/v1/assessments", json=DAY).json()["id"])
    assess_all = _alone(settings)

    def killed_after_one_step(task: Any) -> Any:
        steps = task.step

        def step(**told: Any) -> Any:
            if told["done"] > 2:
                raise SystemExit  # nothing catches it on the way, as nothing catches kill -9
            return steps(**told)

        monkeypatch.setattr(type(task), "step", lambda _, **told: step(**told))
        return assess_all(task)

    with pytest.raises(SystemExit):
        Worker(held, {"assess": killed_after_one_step}).work_once()
    monkeypatch.undo()
    with held.transaction() as session:
        assert session.scalar(select(JobRow.done).where(JobRow.id == job)) == 2
        session.execute(update(JobRow).values(lease_until=now() - timedelta(seconds=1)))

    assert Worker(held, {"assess": assess_all}).work_once()
    with held.readings() as session:
        stored = list(session.scalars(select(AssessmentRow.loop_id)))
    assert len(stored) == len({*stored}) == 5


def test_a_person_may_overrule_a_diagnosis_and_both_stay_to_be_read(
    client: TestClient, plant: Plant
) -> None:
    loop, *_ = plant()
    made = client.post(f"/v1/loops/{loop}/assessments", json=DAY).json()
    said = {"cause": "valve", "reason": "Stem was seen to stick on the walk round."}

    answer = client.post(f"/v1/assessments/{made['id']}/overrule", json=said)
    assert answer.status_code == 201, answer.text
    body = answer.json()
    assert (body["cause"], body["computed_cause"]) == ("valve", made["cause"])
    assert body["overrules"][0]["reason"] == said["reason"]
    line = client.get("/v1/audit", params={"limit": 1000}).json()["items"]
    overruled = [one for one in line if one["action"] == "assessment.overruled"]
    assert len(overruled) == 1
    assert overruled[0]["before"] == {"cause": made["cause"]}


def test_the_scorecard_names_areas_and_the_loops_that_cost_most(
    client: TestClient, plant: Plant, work: Callable[[], bool]
) -> None:
    plant()
    nothing = client.get("/v1/scorecard")
    assert nothing.status_code == 404
    assert nothing.json()["detail"].startswith("There is no scorecard yet: assess the plant first")
    job = client.post("/v1/assessments", json=DAY).json()["id"]
    assert work()

    card = client.get("/v1/scorecard").json()
    assert card["job_id"] == job
    assert card["plant"]["loops"] == 2
    assert {area["name"] for area in card["areas"]} == {"A0", "A1"}
    assert all(loop["cause"] != "healthy" for loop in card["bad_actors"])


@pytest.mark.parametrize(
    ("period", "sentence"),
    [
        ({"start": DAY["end"], "end": DAY["start"]}, "end must be after start by at most 31 days"),
        ({"start": "2025-01-01T00:00:00Z", "end": DAY["end"]}, "at most 31 days"),
        ({"start": "2026-01-31T00:00:00", "end": DAY["end"]}, "timezone"),
        ({**DAY, "loop_ids": []}, "at least 1 item"),
        (
            {"start": "9999-12-31T00:00:00-12:00", "end": "9999-12-31T20:00:00-12:00"},
            "a period lies between 1970 and 2200",
        ),
        (
            {"start": "0001-01-01T00:00:00+14:00", "end": "0001-01-02T00:00:00+14:00"},
            "a period lies between 1970 and 2200",
        ),
    ],
)
def test_a_period_that_cannot_be_is_refused(
    client: TestClient, period: dict[str, Any], sentence: str
) -> None:
    answer = client.post("/v1/assessments", json=period)
    assert answer.status_code == 422
    assert sentence in answer.text


def test_what_is_not_there_is_said_so(client: TestClient, plant: Plant) -> None:
    *_, empty = plant()
    nobody = "00000000-0000-0000-0000-000000000000"

    assert client.post("/v1/assessments", json={**DAY, "loop_ids": [nobody]}).status_code == 404
    assert client.get("/v1/assessments", params={"job_id": nobody}).status_code == 404
    assert client.get(f"/v1/assessments/{nobody}").status_code == 404
    said = {"cause": "valve", "reason": "It sticks."}
    assert client.post(f"/v1/assessments/{nobody}/overrule", json=said).status_code == 404
    answer = client.post(f"/v1/loops/{empty}/assessments", json=DAY)
    assert (answer.status_code, answer.json()["type"]) == (404, "/problems/no-samples")
    assert str(empty) not in answer.json()["detail"]  # the loop's tag, not the store's name of it


def test_a_viewer_may_read_and_not_ask(client_as: Callable[..., TestClient], plant: Plant) -> None:
    loop, *_ = plant()
    viewer = client_as("viewer")
    assert viewer.get(f"/v1/loops/{loop}/assessments").status_code == 200
    assert viewer.post("/v1/assessments", json=DAY).status_code == 403
    assert viewer.post(f"/v1/loops/{loop}/assessments", json=DAY).status_code == 403


def test_a_look_at_one_loop_does_not_take_the_place_of_the_plants_scorecard(
    client: TestClient, plant: Plant, work: Callable[[], bool]
) -> None:
    loop, *_ = plant()
    whole = client.post("/v1/assessments", json=DAY).json()["id"]
    assert work()
    later = {"start": "2026-01-31T12:00:00Z", "end": "2026-02-01T12:00:00Z"}
    client.post("/v1/assessments", json={**later, "loop_ids": [loop]})
    assert work()

    card = client.get("/v1/scorecard").json()
    assert (card["job_id"], card["plant"]["loops"]) == (whole, 2)


def test_no_list_reads_the_whole_documents(
    client: TestClient, plant: Plant, work: Callable[[], bool], held: Database
) -> None:
    loop, *_ = plant()
    job = client.post("/v1/assessments", json=DAY).json()["id"]
    assert work()
    said: list[str] = []
    event.listen(held.engine, "before_cursor_execute", lambda *call: said.append(call[2]))
    for path in ("/v1/scorecard", f"/v1/assessments?job_id={job}", f"/v1/loops/{loop}/assessments"):
        assert client.get(path).status_code == 200
    assert any("FROM assessment" in statement for statement in said)
    assert not any("assessment.body" in statement for statement in said)


def test_settings_without_their_process_are_refused(
    client: TestClient, tic101: dict[str, Any]
) -> None:
    answer = client.post(
        f"/v1/loops/{tic101['id']}/assessments", json=DAY | {"running": {"Kc": 1.0}}
    )
    assert answer.status_code == 422
    assert "running needs the process" in answer.text


def test_money_orders_the_bad_actors_and_limits_count_the_time_outside(
    client: TestClient, plant: Plant, work: Callable[[], bool]
) -> None:
    first, manual, _ = plant()
    for loop, change in ((first, {"worth": 100.0, "limit_high": 50.0}), (manual, {"worth": 9e5})):
        etag = client.get(f"/v1/loops/{loop}").headers["ETag"]
        done = client.patch(f"/v1/loops/{loop}", json=change, headers={"If-Match": etag})
        assert done.status_code == 200, done.text
    job = client.post("/v1/assessments", json=DAY).json()["id"]
    assert work()

    asked = {"job_id": job, "by": "cost"}
    card = client.get("/v1/scorecard", params=asked).json()
    assert card["bad_actors"][0]["tag"] == "TIC-1"
    for bad in card["bad_actors"]:
        worth = {"TIC-0": 100.0, "TIC-1": 9e5}[bad["tag"]]
        assert bad["cost"] == pytest.approx(worth * (1 - bad["points"] / 100))
    assert card["plant"]["priced"] == 2
    assert card["plant"]["cost"] == pytest.approx(sum(area["cost"] for area in card["areas"]))

    (one,) = client.get(f"/v1/loops/{first}/assessments").json()["items"]
    body = client.get(f"/v1/assessments/{one['id']}").json()["assessment"]
    assert body["indices"]["error"]["outside"] == pytest.approx(np.mean(routine(0).pv > 50.0))


def test_limits_that_cross_are_refused(client: TestClient) -> None:
    answer = client.post("/v1/loops", json=TIC101 | {"limit_low": 5.0, "limit_high": 4.0})
    assert answer.status_code == 422
    assert "limit_high must be above limit_low" in answer.text


def test_two_periods_of_a_loop_are_compared(client: TestClient, plant: Plant) -> None:
    loop, *_ = plant()
    halves = {
        "before_start": "2026-01-31T00:00:00Z", "before_end": "2026-01-31T12:00:00Z",
        "after_start": "2026-01-31T12:00:00Z", "after_end": "2026-02-01T00:00:00Z",
    }  # fmt: skip
    answer = client.get(f"/v1/loops/{loop}/effect", params=halves)
    assert answer.status_code == 200, answer.text
    comparison = answer.json()["effect"]["comparison"]
    error = 50.0 - routine(0).pv
    expected = np.sqrt(np.mean(error[720:] ** 2) / np.mean(error[:720] ** 2))
    assert comparison["ratio"] == pytest.approx(expected)
    assert comparison["low"] < 1 < comparison["high"]

    wrong = client.get(
        f"/v1/loops/{loop}/effect", params=halves | {"after_end": "2026-01-30T00:00:00Z"}
    )
    assert wrong.status_code == 422
    assert "end must be after start" in wrong.text
