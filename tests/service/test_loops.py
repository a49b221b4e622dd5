from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import event, select
from sqlalchemy.orm import Session, sessionmaker

from service.tables import AuditRow, LoopRow

Body = dict[str, Any]

# What is decided before the database is asked needs no second one.
on_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


def test_a_loop_is_stored_as_described(client: TestClient, tic101: Body) -> None:
    answer = client.get(f"/v1/loops/{tic101['id']}")

    assert answer.json() == tic101
    assert answer.headers["etag"] == '"1"'
    assert (tic101["op_low"], tic101["op_high"], tic101["op_unit"]) == (0, 100, "%")
    assert tic101["created_by"] == "admin person"
    assert tic101["created_at"].endswith("Z")


def test_creating_and_changing_leave_one_audit_line_each(client: TestClient, tic101: Body) -> None:
    client.patch(
        f"/v1/loops/{tic101['id']}",
        json={"area": "A2", "unit": tic101["unit"]},
        headers={"If-Match": '"1"'},
    )

    changed, created = client.get("/v1/audit", params={"loop_id": tic101["id"]}).json()["items"]
    assert (created["action"], created["before"]) == ("loop.created", None)
    assert created["after"]["pv_high"] == 200
    assert (changed["action"], changed["actor"]) == ("loop.changed", "admin person")
    assert (changed["before"], changed["after"]) == ({"area": "A1"}, {"area": "A2"})


def test_a_change_needs_the_version_it_was_made_from(client: TestClient, tic101: Body) -> None:
    address = f"/v1/loops/{tic101['id']}"

    assert client.patch(address, json={"area": "A2"}).status_code == 428
    first = client.patch(address, json={"area": "A2"}, headers={"If-Match": '"1"'})
    second = client.patch(address, json={"area": "A3"}, headers={"If-Match": '"1"'})
    weak = client.patch(address, json={"area": "A3"}, headers={"If-Match": 'W/"2"'})
    listed = client.patch(address, json={"area": "A4"}, headers={"If-Match": '"1", "2"'})
    any_version = client.patch(address, json={"area": "A5"}, headers={"If-Match": "*"})

    assert (first.status_code, first.headers["etag"]) == (200, '"2"')
    assert second.status_code == 412
    assert second.json()["type"] == "/problems/stale-version"
    assert second.json()["current"] == '"2"'
    assert weak.status_code == 412
    assert listed.status_code == any_version.status_code == 200
    assert client.get(address).json()["area"] == "A5"


def test_of_many_changes_at_once_from_one_version_one_wins(
    client: TestClient, tic101: Body
) -> None:
    def change(n: int) -> int:
        return client.patch(
            f"/v1/loops/{tic101['id']}", json={"area": f"B{n}"}, headers={"If-Match": '"1"'}
        ).status_code

    with ThreadPoolExecutor(6) as pool:
        statuses = list(pool.map(change, range(6)))

    assert sorted(statuses) == [200, 412, 412, 412, 412, 412]
    assert client.get(f"/v1/loops/{tic101['id']}").json()["version"] == 2


def test_a_change_that_changes_nothing_leaves_no_trace(client: TestClient, tic101: Body) -> None:
    answer = client.patch(
        f"/v1/loops/{tic101['id']}", json={"area": "A1"}, headers={"If-Match": '"1"'}
    )

    assert answer.json() == tic101
    assert len(client.get("/v1/audit?action=loop.changed").json()["items"]) == 0


@pytest.mark.usefixtures("tic101")
def test_a_tag_is_unique(client: TestClient) -> None:
    other = client.post("/v1/loops", json=_body(tag="TIC-102")).json()

    again = client.post("/v1/loops", json=_body(tag="TIC-101"))
    renamed = client.patch(
        f"/v1/loops/{other['id']}", json={"tag": "TIC-101"}, headers={"If-Match": '"1"'}
    )

    for answer in (again, renamed):
        assert answer.status_code == 409
        assert answer.json()["type"] == "/problems/tag-taken"
        assert answer.json()["tag"] == "TIC-101"
    assert len(client.get("/v1/audit?action=loop.created").json()["items"]) == 2


@pytest.mark.parametrize(
    ("change", "pointer", "detail"),
    [
        ({"pv_high": 0.0}, "body", "pv_high must be above pv_low, got 0.0 to 0.0"),
        ({"op_low": 100.0}, "body", "op_high must be above op_low, got 100.0 to 100.0"),
        ({"pv_high": "200"}, "body/pv_high", "Input should be a valid number"),
        ({"tag": "TIC\n101"}, "body/tag", "must be one line of printable characters"),
        ({"tag": "TIC\x00101"}, "body/tag", "must be one line of printable characters"),
        ({"tag": "   "}, "body/tag", "String should have at least 1 character"),
        ({"sample_time": 0.0}, "body/sample_time", "Input should be greater than or equal to"),
        ({"form": "ideal"}, "body/form", "Input should be 'isa', 'parallel' or 'series'"),
        ({"gain": 1.0}, "body/gain", "Extra inputs are not permitted"),
    ],
)
@on_sqlite
def test_a_wrong_field_is_named(
    client: TestClient, change: Body, pointer: str, detail: str
) -> None:
    answer = client.post("/v1/loops", json=_body(**change))

    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    (fault,) = answer.json()["errors"]
    assert fault["pointer"] == pointer
    assert fault["detail"].startswith(detail)


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e400"])
@on_sqlite
def test_a_number_that_is_not_finite_is_refused(client: TestClient, number: str) -> None:
    text = '{"tag": "A", "pv_low": 0, "pv_high": %s, "pv_unit": "", "action": "reverse",'
    text += ' "form": "isa", "time_unit": "s", "gain_basis": "eu"}'

    answer = client.post(
        "/v1/loops", content=text % number, headers={"Content-Type": "application/json"}
    )

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["pointer"] == "body/pv_high"


@on_sqlite
def test_a_change_is_held_against_what_stays(client: TestClient, tic101: Body) -> None:
    address, headers = f"/v1/loops/{tic101['id']}", {"If-Match": '"1"'}

    narrow = client.patch(address, json={"pv_high": -5.0}, headers=headers)
    null = client.patch(address, json={"area": None}, headers=headers)
    unknown = client.patch(address, json={"sample_time": None}, headers=headers)

    assert narrow.status_code == 422
    assert narrow.json()["errors"] == [
        {"pointer": "body", "detail": "pv_high must be above pv_low, got 0.0 to -5.0"}
    ]
    assert null.status_code == 422
    assert "area cannot be null" in null.json()["errors"][0]["detail"]
    assert unknown.json()["sample_time"] is None


def test_loops_come_in_pages_by_tag(client: TestClient) -> None:
    tags = ["PIC-1", "TIC-1", "TIC-10", "TIC-2", "TIC_3", "tic-4", "Öl-5"]
    for n, tag in enumerate(tags):
        client.post("/v1/loops", json=_body(tag=tag, area="AB"[n % 2], unit=f"U{n % 3}"))

    seen, cursor = [], None
    while True:
        params = {"limit": 3} | ({"cursor": cursor} if cursor else {})
        page = client.get("/v1/loops", params=params).json()
        seen += [loop["tag"] for loop in page["items"]]
        cursor = page["next"]
        if cursor is None:
            break

    assert seen == sorted(tags)
    assert _tags(client, tag="TIC-") == ["TIC-1", "TIC-10", "TIC-2"]
    assert _tags(client, tag="TIC_") == ["TIC_3"]
    assert _tags(client, area="A", unit="U0") == ["PIC-1", "Öl-5"]
    assert _tags(client, area="nowhere") == []


@on_sqlite
def test_a_cursor_of_somebody_elses_is_refused(client: TestClient) -> None:
    for cursor in ("%%%", "AAAA", "_w", "Ä"):
        answer = client.get("/v1/loops", params={"cursor": cursor})
        assert answer.status_code == 422, cursor
        assert answer.json()["errors"][0]["pointer"] == "query/cursor"


def test_an_archived_loop_leaves_the_list(client: TestClient, tic101: Body) -> None:
    address = f"/v1/loops/{tic101['id']}"
    client.patch(address, json={"archived": True}, headers={"If-Match": '"1"'})

    assert _tags(client) == []
    assert _tags(client, archived=True) == ["TIC-101"]
    assert client.get(address).status_code == 200
    assert client.delete(address).status_code == 405


def test_an_unknown_loop_is_not_found(client: TestClient) -> None:
    address = "/v1/loops/00000000-0000-0000-0000-000000000000"

    answers = [
        client.get(address),
        client.patch(address, json={"area": "A"}, headers={"If-Match": '"1"'}),
    ]

    for answer in answers:
        assert answer.status_code == 404
        assert answer.json()["detail"] == f"There is no loop {address[10:]}."


def test_a_failed_commit_is_an_error_answer_and_stores_nothing(
    client: TestClient, sessions: sessionmaker[Session]
) -> None:
    def refuse(_: Session) -> None:
        raise RuntimeError("the disk broke")

    event.listen(sessions, "before_commit", refuse)
    answer = client.post("/v1/loops", json=_body())
    event.remove(sessions, "before_commit", refuse)

    assert answer.status_code == 500
    assert answer.headers["content-type"] == "application/problem+json"
    assert "disk" not in answer.text
    with sessions() as session:
        assert session.scalars(select(LoopRow)).all() == []
        assert [row.action for row in session.scalars(select(AuditRow))] == ["key.created"]


@pytest.mark.parametrize(("role", "status"), [("viewer", 403), ("engineer", 201), ("admin", 201)])
@on_sqlite
def test_a_viewer_reads_and_an_engineer_writes(
    client_as: Callable[..., TestClient], role: str, status: int
) -> None:
    client = client_as(role)

    assert client.get("/v1/loops").status_code == 200
    assert client.post("/v1/loops", json=_body()).status_code == status


def _body(**changes: object) -> Body:
    smallest = {
        "tag": "TIC-101",
        "pv_low": 0.0,
        "pv_high": 100.0,
        "pv_unit": "degC",
        "action": "reverse",
        "form": "isa",
        "time_unit": "s",
        "gain_basis": "eu",
    }
    return smallest | changes


def _tags(client: TestClient, **wanted: object) -> list[str]:
    answer = client.get("/v1/loops", params={k: str(v) for k, v in wanted.items()})
    return [loop["tag"] for loop in answer.json()["items"]]
