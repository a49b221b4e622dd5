"""House rules of the service that no reviewer should have to remember."""

import ast
import re
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from fastapi.routing import APIRoute
from fastapi.testclient import TestClient
from sqlalchemy import text
from sqlalchemy.dialects import sqlite
from sqlalchemy.exc import DBAPIError, StatementError

from service import openapi
from service.app import create_app
from service.database import Database
from service.features import ROUTERS, UPLOADS
from service.limits import HEAVY, HEAVY_TO_THE_END
from service.loops.schemas import LoopBody, LoopChanges, NewLoop, ProfileName
from service.migration import assert_ready, migrate
from service.openapi import OPENAPI, openapi_text
from service.settings import Settings
from service.tables import Instant, ModelRow, Table
from tuning.profiles import PROFILES

SERVICE = Path(__file__).parents[2] / "service"
FEATURES = sorted(folder.parent for folder in SERVICE.glob("*/routes.py"))


@pytest.fixture(scope="module")
def description(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Describe the API without any database."""
    settings = Settings(data=tmp_path_factory.mktemp("nothing"))
    return create_app(settings, Database.at(settings.url)).openapi()


def operations(description: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    for path, methods in description["paths"].items():
        for method, operation in methods.items():
            yield method, path, operation


def test_openapi_json_is_the_api(settings: Settings) -> None:
    """Run `python -m service.openapi` after a change of the API."""
    app = create_app(settings, Database.at(settings.url))

    assert OPENAPI.read_text("utf-8") == openapi_text(app)


def test_openapi_json_is_written_anew_by_one_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(openapi, "OPENAPI", tmp_path / "openapi.json")
    openapi.main()

    assert (tmp_path / "openapi.json").read_text("utf-8") == OPENAPI.read_text("utf-8")


def test_a_misspelt_query_parameter_is_refused_not_ignored(client: TestClient) -> None:
    answer = client.get("/v1/loops", params={"aera": "A1"})

    assert answer.status_code == 422
    assert answer.json()["errors"] == [
        {
            "pointer": "query/aera",
            "detail": "This operation has no such parameter; "
            "it takes archived, area, cursor, limit, tag, unit.",
        }
    ]
    assert client.get("/health", params={"x": "1"}).status_code == 422
    assert client.get("/docs", params={"x": "1"}).status_code == 200


def test_a_time_without_its_zone_is_not_stored() -> None:
    with pytest.raises(ValueError, match="must say its time zone"):
        Instant().process_bind_param(datetime(2026, 11, 22), sqlite.dialect())  # noqa: DTZ001


def test_every_change_through_the_api_declares_its_audit_action(
    description: dict[str, Any],
) -> None:
    declared = {
        f"{method.upper()} {path}": operation.get("x-audit", "nothing declared")
        for method, path, operation in operations(description)
        if method != "get"
    }

    assert len(declared) >= 8
    for operation, action in declared.items():
        assert re.fullmatch(r"\w+\.\w+|none", action), operation
    source = "\n".join(file.read_text("utf-8") for file in SERVICE.glob("*/actions.py"))
    for action in set(declared.values()) - {"none"}:
        assert f'"{action}"' in source or f'"{action.partition(".")[2]}"' in source, action


def test_no_get_declares_an_audit_action(description: dict[str, Any]) -> None:
    for method, path, operation in operations(description):
        if method == "get":
            assert "x-audit" not in operation, path


def test_every_operation_has_a_sentence_and_declares_problems(
    description: dict[str, Any],
) -> None:
    for method, path, operation in operations(description):
        assert operation.get("description", "").strip().endswith((".", "?")), (method, path)
        for family in ("4XX", "5XX"):
            content = operation["responses"][family]["content"]
            assert list(content) == ["application/problem+json"]


def test_every_operation_under_v1_asks_for_a_key(description: dict[str, Any]) -> None:
    for method, path, operation in operations(description):
        if path.startswith("/v1"):
            assert operation["security"] == [{"API key": []}], (method, path)


def test_request_bodies_refuse_unknown_fields(description: dict[str, Any]) -> None:
    schemas = description["components"]["schemas"]
    for method, path, operation in operations(description):
        content = operation.get("requestBody", {}).get("content", {})
        reference = content.get("application/json", {}).get("schema", {}).get("$ref")
        if reference:
            name = reference.rpartition("/")[2]
            assert schemas[name]["additionalProperties"] is False, (method, path)


def test_only_the_database_module_commits() -> None:
    for file in SERVICE.rglob("*.py"):
        if file.name == "database.py" or "cli" in file.parts:
            continue
        tree = ast.parse(file.read_text("utf-8"))
        calls = [
            node
            for node in ast.walk(tree)
            if isinstance(node, ast.Attribute) and node.attr in ("commit", "begin", "rollback")
        ]
        allowed = 1 if file.name == "migration.py" else 0  # the migration's own transaction
        assert len(calls) <= allowed, file


@pytest.mark.parametrize("feature", FEATURES, ids=lambda folder: folder.name)
def test_a_feature_is_layered_routes_actions_store(feature: Path) -> None:
    order = ["store.py", "actions.py", "routes.py"]
    for level, name in enumerate(order):
        file = feature / name
        if not file.exists():
            continue
        above = {other.removesuffix(".py") for other in order[level + 1 :]}
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                package, _, module = node.module.rpartition(".")
                own = package == f"service.{feature.name}"
                names = {alias.name for alias in node.names} if not own else {module}
                if own or node.module == f"service.{feature.name}":
                    assert not names & above, (file, node.module)


def test_stores_and_actions_know_no_web() -> None:
    for pattern in ("*/actions.py", "*/store.py"):
        for file in SERVICE.glob(pattern):
            source = file.read_text("utf-8")
            assert not re.search(r"^(from|import) (fastapi|starlette)", source, re.MULTILINE), file


def test_routes_are_plain_functions_in_the_thread_pool() -> None:
    for file in SERVICE.glob("*/routes.py"):
        tree = ast.parse(file.read_text("utf-8"))
        found = [node.name for node in ast.walk(tree) if isinstance(node, ast.AsyncFunctionDef)]
        assert found == [], file


def test_columns_are_lower_case() -> None:
    for table in Table.metadata.tables.values():
        for column in table.columns:
            assert re.fullmatch(r"[a-z][a-z0-9_]*", column.name), column


def test_the_profiles_of_the_api_are_those_of_the_catalogue() -> None:
    assert set(ProfileName.__args__) == set(PROFILES)  # type: ignore[attr-defined]


def test_a_loop_can_be_changed_in_every_field_it_is_created_with() -> None:
    created, changed = set(NewLoop.model_fields), set(LoopChanges.model_fields)

    assert changed == created | {"archived"}
    assert created <= set(LoopBody.model_fields)


def test_the_docs_page_lists_every_operation_and_loads_nothing(
    anonymous: TestClient, description: dict[str, Any]
) -> None:
    page = anonymous.get("/docs")

    assert page.headers["content-type"].startswith("text/html")
    for method, path, _ in operations(description):
        assert f"<code>{method.upper()}</code></td><td><code>{path}</code>" in page.text
    assert "<script" not in page.text
    assert "http" not in page.text.replace("<!doctype html>", "")


def test_health_tells_whether_the_service_can_work(anonymous: TestClient, held: Database) -> None:
    ready = anonymous.get("/health")
    with held.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = 'older'")
    behind = anonymous.get("/health")
    with held.engine.begin() as connection:
        connection.exec_driver_sql("DROP TABLE alembic_version")
    empty = anonymous.get("/health")

    assert (ready.status_code, ready.json()) == (200, {"status": "ready"})
    assert (behind.status_code, empty.status_code) == (503, 503)
    assert behind.json()["type"] == "/problems/not-ready"
    assert "loopwright migrate" in behind.json()["detail"]
    assert behind.headers["retry-after"] == "5"


def test_health_waits_for_no_writer(anonymous: TestClient, held: Database) -> None:
    with held.engine.begin() as connection:
        connection.execute(text("UPDATE audit_head SET lines = lines + 1"))
        assert anonymous.get("/health").status_code == 200


def test_a_database_that_is_not_there_is_said_so(settings: Settings) -> None:
    nowhere = Database.at("postgresql://nobody@127.0.0.1:1/nothing")
    client = TestClient(create_app(settings, nowhere))  # not started: it would refuse

    health = client.get("/health")
    loops = client.get(
        "/v1/loops", headers={"Authorization": "Bearer lw_" + "0" * 12 + "_" + "A" * 43}
    )

    assert nowhere.engine.driver == "psycopg"
    for answer in (health, loops):
        assert answer.status_code == 503
        assert answer.json()["type"] == "/problems/database-unavailable"
        assert "127.0.0.1" not in answer.text


def test_metrics_count_requests_by_pattern_not_by_id(
    client: TestClient, tic101: dict[str, Any]
) -> None:
    client.get(f"/v1/loops/{tic101['id']}")
    client.get("/v1/loops/not-an-id")
    client.get("/nowhere/at/all")

    found = client.get("/metrics").text

    assert (
        'loopwright_requests_total{method="GET",route="/v1/loops/{loop_id}",status="200"} 1.0'
        in (found)
    )
    assert 'route="/v1/loops/{loop_id}",status="422"} 1.0' in found
    assert 'route="none",status="404"} 1.0' in found
    assert 'loopwright_request_seconds_count{method="POST",route="/v1/loops"} 1.0' in found
    assert "loopwright_uploads_total 0.0" in found
    assert tic101["id"] not in found


def test_answers_carry_an_id_and_are_not_kept_by_anybody(client: TestClient) -> None:
    given = client.get("/v1/loops", headers={"X-Request-ID": "abc-123"})
    other = client.get("/v1/loops", headers={"X-Request-ID": "x" * 65})

    assert given.headers["x-request-id"] == "abc-123"
    assert re.fullmatch(r"[0-9a-f]{32}", other.headers["x-request-id"])
    assert given.headers["cache-control"] == "no-store"
    assert given.headers["x-content-type-options"] == "nosniff"


def test_a_get_cannot_write(held: Database, tic101: dict[str, Any]) -> None:
    with (
        held.readings() as session,
        pytest.raises(DBAPIError, match=r"readonly|read-only"),
    ):
        session.execute(text("UPDATE loop SET area = 'A2'"))
    with held.readings() as session:
        assert session.scalar(text("SELECT area FROM loop")) == tic101["area"]


def test_a_number_that_is_not_finite_is_never_stored(held: Database) -> None:
    row = ModelRow(
        kind="FOPDT",
        parameters={"K": float("nan")},
        verdict="trusted",
        reasons=[],
        body={},
        author="Anna",
    )
    with (
        pytest.raises((StatementError, ValueError), match="not JSON compliant"),
        held.sessions.begin() as session,
    ):
        session.add(row)


def test_settings_come_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOOPWRIGHT_ALLOW_SELF_APPROVAL", "true")
    monkeypatch.setenv("LOOPWRIGHT_DATABASE_URL", "postgresql://anna:secret@server/plant")

    settings = Settings()

    assert settings.allow_self_approval
    assert settings.url.get_backend_name() == "postgresql"
    assert "secret" not in str(Database.at(settings.url).engine.url)
    monkeypatch.setenv("LOOPWRIGHT_DATABASE_URL", "")
    assert Settings().url.get_backend_name() == "sqlite"
    monkeypatch.setenv("LOOPWRIGHT_DATABASE_URL", "my database")
    with pytest.raises(ValueError, match="must look like sqlite:///FILE"):
        Settings()


@pytest.mark.parametrize(
    ("url", "sentence"),
    [
        ("sqlite://", "SQLite needs a file"),
        ("sqlite:///:memory:", "SQLite needs a file"),
        ("mysql://server/plant", "must be SQLite or PostgreSQL, not mysql"),
    ],
)
def test_a_database_that_cannot_serve_is_refused_in_words(url: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        Database.at(url)


def test_the_embedded_database_is_made_in_the_data_folder(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path / "new" / "folder")
    migrate(settings.url)
    held = Database.at(settings.url)
    assert_ready(held)
    held.engine.dispose()

    assert (tmp_path / "new" / "folder" / "loopwright.sqlite").exists()


def test_every_question_that_computes_is_limited() -> None:
    routes = [
        route for router in (*ROUTERS, *UPLOADS) for route in router.routes
        if isinstance(route, APIRoute)
    ]  # fmt: skip
    limited = {
        route.path
        for route in routes
        if any(found in (HEAVY, HEAVY_TO_THE_END) for found in route.dependencies)
    }
    asking = {
        route.path
        for route in routes
        if route.openapi_extra is not None and route.openapi_extra.get("x-audit") == "none"
    }
    assert asking
    assert asking <= limited
    assert limited >= {
        "/v1/assessments",
        "/v1/audit/export",
        "/v1/audit/verify",
        "/v1/loops/{loop_id}/assessments",
        "/v1/loops/{loop_id}/effect",
        "/v1/loops/{loop_id}/models",
        "/v1/loops/{loop_id}/records",
        "/v1/loops/{loop_id}/samples",
        "/v1/loops/{loop_id}/sheets/{version}/effect",
        "/v1/loops/{loop_id}/tunings",
    }
