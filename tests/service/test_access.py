import json
import logging
import re
import subprocess
import sys
from collections.abc import Callable

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select
from sqlalchemy.orm import Session, sessionmaker

from service.access import ASKING
from service.actors import Actor, Role
from service.app import create_app
from service.database import Database
from service.keys.actions import create_key
from service.logs import redact
from service.settings import Settings
from service.tables import AuditRow, KeyRow, LoopRow

LOOP = {
    "tag": "TIC-101",
    "pv_low": 0.0,
    "pv_high": 100.0,
    "pv_unit": "degC",
    "action": "reverse",
    "form": "isa",
    "time_unit": "s",
    "gain_basis": "eu",
}

# What is decided before the database is asked needs no second one.
on_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


@on_sqlite
def test_nothing_under_v1_answers_without_a_key(anonymous: TestClient) -> None:
    paths = anonymous.get("/openapi.json").json()["paths"]
    asked = 0

    for path, operations in paths.items():
        for method in operations:
            if path.startswith("/v1"):
                answer = anonymous.request(method, re.sub(r"\{\w+\}", "1", path))
                assert answer.status_code == 401, (method, path)
                assert answer.headers["www-authenticate"] == "Bearer"
                assert answer.json()["type"] == "/problems/not-authenticated"
                asked += 1

    assert asked > 8
    assert anonymous.get("/v1/nowhere").status_code == 401
    assert anonymous.get("/health").status_code == 200


@pytest.mark.parametrize(
    "header",
    [
        "",
        "Bearer",
        "Bearer ",
        "Bearer lw_",
        "Bearer lw_000000000000_" + "A" * 43,
        "Bearer nonsense",
        "Basic YW5uYTphbm5h",
        "Bearer \xff\xff",
    ],
)
@on_sqlite
def test_a_header_that_is_no_key_is_refused(anonymous: TestClient, header: str) -> None:
    answer = anonymous.get("/v1/loops", headers={"Authorization": header.encode("latin-1")})

    assert answer.status_code == 401


@on_sqlite
def test_a_key_with_one_character_changed_is_refused(
    anonymous: TestClient, client: TestClient
) -> None:
    token = client.headers["Authorization"].removeprefix("Bearer ")
    assert client.get("/v1/loops").status_code == 200

    changed = [token[:-1], token + "A", token.upper(), f"{token} {token}"]
    for at in range(len(token)):
        other = "B" if token[at] == "A" else "A"
        changed.append(token[:at] + other + token[at + 1 :])
    for n, guess in enumerate(changed):
        # Each from an address of its own, so that the limit on guesses does not answer instead.
        client = TestClient(anonymous.app, client=(f"192.0.2.{n}", 1))
        client.portal = anonymous.portal
        answer = client.get("/v1/loops", headers={"Authorization": f"Bearer {guess}"})
        assert answer.status_code == 401, n


@on_sqlite
def test_a_key_in_the_address_or_another_header_opens_nothing(
    anonymous: TestClient, client: TestClient
) -> None:
    token = client.headers["Authorization"].removeprefix("Bearer ")

    assert anonymous.get("/v1/loops", params={"api_key": token}).status_code == 401
    assert anonymous.get("/v1/loops", headers={"X-API-Key": token}).status_code == 401
    assert anonymous.get("/v1/loops", headers={"X-Actor": "admin person"}).status_code == 401


def test_the_secret_is_shown_once_and_stored_nowhere(
    client: TestClient, anonymous: TestClient, sessions: sessionmaker[Session]
) -> None:
    created = client.post("/v1/keys", json={"owner": "Anna", "role": "engineer"})
    token = created.json()["token"]
    secret = token.split("_", 2)[2]

    with sessions() as session:
        row = session.get(KeyRow, created.json()["id"])
        assert row is not None
        stored = json.dumps({name: str(value) for name, value in vars(row).items()})
    assert created.status_code == 201
    assert secret not in stored
    for path in ("/v1/keys", "/v1/audit", "/v1/audit/export"):
        assert secret not in client.get(path).text
    answer = anonymous.post("/v1/loops", json=LOOP, headers={"Authorization": f"Bearer {token}"})
    assert answer.json()["created_by"] == "Anna"


def test_a_revoked_key_opens_nothing(client: TestClient, anonymous: TestClient) -> None:
    key = client.post("/v1/keys", json={"owner": "Anna", "role": "admin"}).json()
    headers = {"Authorization": f"Bearer {key['token']}"}
    assert anonymous.get("/v1/loops", headers=headers).status_code == 200

    first = client.delete(f"/v1/keys/{key['id']}")
    again = client.delete(f"/v1/keys/{key['id']}")

    assert first.json()["revoked_by"] == "admin person"
    assert again.json() == first.json()
    answer = anonymous.get("/v1/loops", headers=headers)
    assert answer.status_code == 401
    assert "revoked" in answer.json()["detail"]
    lines = client.get("/v1/audit").json()["items"]
    assert [line["action"] for line in lines] == ["key.revoked", "key.created", "key.created"]
    assert lines[0]["subject"] == f"keys/{key['id']}"
    assert lines[0]["before"]["revoked_at"] is None
    assert lines[0]["after"]["revoked_at"] is not None


def test_the_last_admin_key_cannot_be_revoked(client: TestClient) -> None:
    keys = client.get("/v1/keys").json()["items"]

    answer = client.delete(f"/v1/keys/{keys[0]['id']}")

    assert answer.status_code == 409
    assert answer.json()["type"] == "/problems/last-admin-key"
    assert client.get("/v1/keys").json()["items"] == keys


def test_a_key_that_is_not_there_cannot_be_revoked(client: TestClient) -> None:
    assert client.delete("/v1/keys/000000000000").status_code == 404
    assert client.delete("/v1/keys/nonsense").status_code == 422


@pytest.mark.parametrize("role", ["viewer", "engineer", "approver"])
@on_sqlite
def test_only_an_admin_manages_keys(client_as: Callable[..., TestClient], role: str) -> None:
    client = client_as(role)

    answers = [
        client.get("/v1/keys"),
        client.post("/v1/keys", json={"owner": "me", "role": "admin"}),
        client.delete("/v1/keys/000000000000"),
    ]

    assert [answer.status_code for answer in answers] == [403, 403, 403]
    assert answers[0].json()["needed"] == "admin"
    assert {answer.json()["role"] for answer in answers} == {role}


@on_sqlite
def test_a_viewer_changes_nothing_anywhere(
    client_as: Callable[..., TestClient], sessions: sessionmaker[Session]
) -> None:
    client = client_as("viewer")
    paths = client.get("/openapi.json").json()["paths"]

    for path, operations in paths.items():
        for method in operations:
            if path.startswith("/v1") and method != "get":
                answer = client.request(
                    method, re.sub(r"\{\w+\}", "1", path), headers={"X-HTTP-Method-Override": "GET"}
                )
                # A question may be posted by anybody with a key; its operation keeps nothing.
                asks = path in ASKING and operations[method]["x-audit"] == "none"
                assert answer.status_code == (422 if asks else 403), (method, path)
    with sessions() as session:
        assert session.scalars(select(LoopRow)).all() == []
        assert len(session.scalars(select(AuditRow)).all()) == 1


@on_sqlite
def test_every_question_that_keeps_nothing_is_a_viewers_too(anonymous: TestClient) -> None:
    paths = anonymous.get("/openapi.json").json()["paths"]
    kept_nothing = {
        path
        for path, operations in paths.items()
        for operation in operations.values()
        if operation.get("x-audit") == "none" and path.startswith("/v1")
    }

    # New settings, and models of a loop, are an engineer's to ask for.
    engineers = {
        "/v1/cascades",
        "/v1/detunings",
        "/v1/feed-forwards",
        "/v1/loops/{loop_id}/frequency-responses",
        "/v1/loops/{loop_id}/repeats",
        "/v1/schedules",
        "/v1/smith-predictors",
        "/v1/smooth-tunings",
        "/v1/tunings",
        "/v1/tunings/batch",
    }
    assert kept_nothing == ASKING | engineers


@on_sqlite
def test_a_viewers_upload_is_refused_before_it_is_read(
    client_as: Callable[..., TestClient],
) -> None:
    def endless() -> bytes:
        raise AssertionError("the body was read")

    answer = client_as("viewer").post(
        "/v1/loops", content=(endless() for _ in range(1)), headers={"Content-Type": "text/csv"}
    )

    assert answer.status_code == 403


def test_keys_are_listed_in_pages(client: TestClient) -> None:
    for n in range(4):
        client.post("/v1/keys", json={"owner": f"Person {n}", "role": "viewer"})

    first = client.get("/v1/keys", params={"limit": 3}).json()
    second = client.get("/v1/keys", params={"limit": 3, "cursor": first["next"]}).json()

    ids = [key["id"] for key in first["items"] + second["items"]]
    assert len(ids) == 5
    assert ids == sorted(ids)
    assert second["next"] is None


def test_each_role_may_do_what_those_before_it_may() -> None:
    for n, role in enumerate(Role):
        assert [role.covers(other) for other in Role] == [m <= n for m in range(4)]


def test_a_person_is_the_same_whatever_the_capitals() -> None:
    anna = Actor(owner="Anna Straße", role=Role.APPROVER)

    assert anna.is_same_person("anna STRASSE")
    assert not anna.is_same_person("Berta")


def test_an_owner_is_written_in_one_way(sessions: sessionmaker[Session]) -> None:
    with sessions.begin() as session:
        row, token = create_key(session, owner=" Ａnna\u0308 ", role=Role.VIEWER)

    assert row.owner == "Ann\u00e4"
    assert re.fullmatch(r"lw_[0-9a-f]{12}_[A-Za-z0-9_-]{43}", token)


def test_secrets_do_not_reach_the_log() -> None:
    token = "lw_0123456789ab_" + "s" * 43
    event = {
        "event": f"header Bearer {token}",
        "nested": {"list": [token, 1], "pair": (token,)},
        "number": 3,
    }

    cleaned = redact(logging.getLogger(), "info", dict(event))

    assert "sss" not in json.dumps(cleaned)
    assert cleaned["event"] == "header Bearer lw_0123456789ab_***"
    assert cleaned["number"] == 3


def test_the_log_names_the_actor_and_no_secret(settings: Settings, sqlite_held: Database) -> None:
    """In a process of its own, since logging is set up once a process."""
    with sqlite_held.sessions.begin() as session:
        _, token = create_key(session, owner="Anna", role=Role.ADMIN)
    program = f"""
import logging
from fastapi.testclient import TestClient
from service.app import create_app
from service.logs import configure_logging
from service.settings import Settings

configure_logging(as_json=True)
with TestClient(create_app(Settings())) as client:
    client.headers["Authorization"] = "Bearer {token}"
    client.get("/v1/loops", params={{"area": "{token}"}})
    client.get("/v1/loops/{token}", headers={{"X-Request-ID": "{token}"}})
    client.get("/v1/loops", headers={{"X-Request-ID": "evil id"}})
    logging.getLogger("uvicorn.error").warning("token %s", "{token}")
    try:
        raise RuntimeError("{token}")
    except RuntimeError:
        logging.getLogger("elsewhere").exception("failed")
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env={"LOOPWRIGHT_DATA": str(settings.data), "PATH": ""},
    )
    events = [json.loads(line) for line in done.stderr.splitlines()]

    assert token.split("_", 2)[2] not in done.stderr + done.stdout
    requests = [event for event in events if event["event"] == "request"]
    assert [(event["actor"], event["status"]) for event in requests] == [
        ("Anna", 200),
        ("Anna", 422),
        ("Anna", 200),
    ]
    assert requests[0]["path"] == "/v1/loops"
    assert requests[2]["request"] != "evil id"
    assert any("Traceback" in str(event.get("exception")) for event in events)


def test_a_database_that_is_gone_is_said_at_the_door(
    settings: Settings, sqlite_held: Database
) -> None:
    app = create_app(settings, sqlite_held)
    with TestClient(app) as client:
        with sqlite_held.engine.begin() as connection:
            connection.exec_driver_sql("DROP TABLE api_key")
        answer = client.get(
            "/v1/loops", headers={"Authorization": "Bearer lw_0123456789ab_" + "s" * 43}
        )

    assert answer.status_code == 503
    assert answer.json()["type"] == "/problems/database-unavailable"
    assert "api_key" not in answer.text
