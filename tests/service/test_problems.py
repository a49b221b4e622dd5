import errno
import importlib
import json
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi import APIRouter, FastAPI
from fastapi.responses import StreamingResponse
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st
from pydantic import RootModel
from sqlalchemy.exc import OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from loop.errors import LoopError, RuleNotApplicable, UnstableLoop
from loop.process import FOPDT
from service.errors import ServiceError
from service.plain_json import plain
from service.problems import FROM_FRAMEWORK, PAGES, PROBLEMS, kind_of, slug_of

ON_THE_COMMAND_LINE = ("service.cli", "service.demo")
PACKAGES = [
    "loop", "identification", "tuning", "monitoring", "historian", "advice", "service"
]  # fmt: skip

# What is decided before the database is asked needs no second one.
on_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


def every_error() -> list[type[Exception]]:
    for package in map(importlib.import_module, PACKAGES):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    found: list[type[Exception]] = []
    waiting: list[type[Exception]] = [LoopError, ServiceError]
    while waiting:
        kind = waiting.pop()
        waiting += kind.__subclasses__()
        # What only the command line says has an exit code, no page.
        place = kind.__module__
        ours = place.split(".")[0] in PACKAGES and not place.startswith(ON_THE_COMMAND_LINE)
        if ours and kind not in (LoopError, ServiceError):
            found.append(kind)
    return found


def test_every_error_has_an_entry_and_a_page() -> None:
    # Not an answer: it is a mistake of ours, and answers as an internal error.
    errors = [kind for kind in every_error() if kind.__name__ != "UnauditedChange"]

    kinds = {error.__name__: kind_of(error.__new__(error)) for error in errors}
    slugs = {kind.slug for kind in (*kinds.values(), *PROBLEMS.values()) if kind is not None}
    slugs |= {*FROM_FRAMEWORK.values(), "bad-request", "internal-error", "storage-full"}

    assert [name for name, kind in kinds.items() if kind is None] == []
    assert slugs == {page.stem for page in PAGES.glob("*.md")}


@pytest.mark.parametrize("page", sorted(PAGES.glob("*.md")), ids=lambda page: page.stem)
def test_every_page_says_what_why_and_what_to_do(page: Path) -> None:
    text = page.read_text("utf-8")

    assert re.match(r"# .+\n\n\*\*Status \d{3}\*\* · `/problems/[a-z-]+`\n\n", text)
    assert f"`/problems/{page.stem}`" in text
    for heading in ("## What happened", "## Why", "## What to do"):
        assert re.search(rf"^{heading}\n\n\S", text, re.MULTILINE), heading


def test_a_page_states_the_status_that_is_answered() -> None:
    for error in every_error():
        kind = kind_of(error.__new__(error))
        if kind is not None:
            page = (PAGES / f"{kind.slug}.md").read_text("utf-8")
            assert f"**Status {kind.status}**" in page, kind


def test_names_become_addresses() -> None:
    assert slug_of("RuleNotApplicable") == "rule-not-applicable"
    assert slug_of("Forbidden") == "forbidden"


class Unforeseen(Exception):
    pass


def _raise_in(app: FastAPI, error: Exception) -> None:
    router = APIRouter()

    @router.get("/fail")
    def fail() -> None:
        raise error

    app.include_router(router)


@pytest.mark.parametrize(
    ("error", "status", "slug"),
    [
        (RuleNotApplicable("SIMC", "the process has no dead time"), 422, "rule-not-applicable"),
        (UnstableLoop(2), 422, "unstable-loop"),
        (OperationalError("SELECT secret", {}, Exception("secret")), 503, "database-unavailable"),
        (PoolTimeout("secret pool"), 503, "database-unavailable"),
        (OSError(errno.ENOSPC, "No space left on secret"), 507, "storage-full"),
    ],
)
@on_sqlite
def test_foreseen_errors_answer_with_their_type(
    app: FastAPI, error: Exception, status: int, slug: str
) -> None:
    _raise_in(app, error)

    answer = TestClient(app).get("/fail")

    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    body = answer.json()
    assert body["type"] == f"/problems/{slug}"
    assert body["status"] == status
    assert body["title"]
    assert body["detail"]
    assert "secret" not in answer.text


@on_sqlite
def test_facts_of_a_refusal_come_as_members(app: FastAPI) -> None:
    _raise_in(app, RuleNotApplicable("SIMC", "the process has no dead time"))

    body = TestClient(app).get("/fail").json()

    assert body["detail"] == "SIMC does not apply: the process has no dead time."
    assert body["title"] == "The tuning rule does not cover this process."
    assert (body["rule"], body["reason"]) == ("SIMC", "the process has no dead time")


@on_sqlite
def test_an_engineering_refusal_nobody_listed_answers_under_its_own_name(app: FastAPI) -> None:
    class PlantOnFire(LoopError):
        """The plant is on fire."""

        def __init__(self) -> None:
            super().__init__("The plant is on fire.")
            self.status = "burning"
            self.temperature = np.float64("inf")
            self.process = FOPDT(K=1.0, tau=2.0, theta=3.0)
            self.tags = ("TIC-1", "\ud800")

    _raise_in(app, PlantOnFire())
    answer = TestClient(app).get("/fail")

    assert answer.status_code == 422
    assert answer.json() == {
        "type": "/problems/plant-on-fire",
        "title": "The plant is on fire.",
        "status": 422,
        "detail": "The plant is on fire.",
        "temperature": None,
        "process": {"K": 1.0, "tau": 2.0, "theta": 3.0},
        "tags": ["TIC-1", "\\ud800"],
    }


@pytest.mark.parametrize(
    "error", [Unforeseen("secret"), OSError(5, "secret"), ValueError("secret")]
)
@on_sqlite
def test_an_unforeseen_error_says_only_an_id_that_is_in_the_log(
    app: FastAPI, capsys: pytest.CaptureFixture[str], error: Exception
) -> None:
    _raise_in(app, error)

    answer = TestClient(app).get("/fail")

    assert answer.status_code == 500
    assert answer.headers["content-type"] == "application/problem+json"
    assert "secret" not in answer.text
    body = answer.json()
    assert body["id"] == answer.headers["x-request-id"]
    log = capsys.readouterr().out
    assert f"request={body['id']}" in log
    assert "secret" in log


@on_sqlite
def test_what_the_framework_refuses_is_a_problem_too(client: TestClient) -> None:
    unknown = client.get("/nowhere")
    method = client.put("/v1/loops", json={})
    nested = client.post("/v1/audit/verify")
    large = client.post("/v1/loops", content=b" " * 8_000_001)
    chunked = client.post("/v1/loops", content=iter([b" " * 8_000_000, b" "]))
    broken = client.post(
        "/v1/loops", content=b'{"tag": ', headers={"Content-Type": "application/json"}
    )

    for answer, status, slug in [
        (unknown, 404, "not-found"),
        (method, 405, "method-not-allowed"),
        (nested, 405, "method-not-allowed"),
        (large, 413, "content-too-large"),
        (chunked, 413, "content-too-large"),
        (broken, 422, "invalid-request"),
    ]:
        assert answer.status_code == status
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["type"] == f"/problems/{slug}"
        assert answer.headers["x-request-id"]
    assert method.headers["allow"] == "GET, POST"
    assert nested.headers["allow"] == "GET"


@on_sqlite
def test_half_an_answer_breaks_off_rather_than_looking_whole(app: FastAPI) -> None:
    def pieces() -> Iterator[bytes]:
        yield b"half"
        raise RuntimeError("secret")

    router = APIRouter()

    @router.get("/half")
    def half() -> StreamingResponse:
        return StreamingResponse(pieces())

    app.include_router(router)
    with pytest.raises(RuntimeError):
        TestClient(app).get("/half")


@on_sqlite
def test_a_hostile_field_name_is_answered_not_crashed_on(client: TestClient) -> None:
    answer = client.post(
        "/v1/loops", content=rb'{"\ud800": 1}', headers={"Content-Type": "application/json"}
    )

    assert answer.status_code == 422
    assert answer.json()["type"] == "/problems/invalid-request"


def test_a_text_that_no_database_can_hold_is_refused(client: TestClient) -> None:
    for text in (r'"\u0000"', r'"\ud800"'):
        answer = client.post(
            "/v1/keys",
            content=f'{{"owner": {text}, "role": "viewer"}}',
            headers={"Content-Type": "application/json"},
        )
        assert answer.status_code == 422
    assert client.get("/v1/loops", params={"area": "\x00"}).status_code == 422
    assert client.get("/v1/audit", params={"actor": "\x00"}).status_code == 422


@on_sqlite
def test_the_address_of_a_problem_type_explains_it(anonymous: TestClient) -> None:
    page = anonymous.get("/problems/rule-not-applicable")

    assert page.headers["content-type"].startswith("text/markdown")
    assert "## What to do" in page.text
    assert anonymous.get("/problems/nothing-of-the-kind").status_code == 404
    assert anonymous.get("/problems/..%2f..%2fREADME").status_code == 404


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner) | st.tuples(inner),
)


@given(values)
def test_plain_values_are_always_json(value: object) -> None:
    text = json.dumps(plain(value), allow_nan=False)

    assert json.loads(text) == plain(value)


def test_numpy_values_are_plain_too() -> None:
    value: Any = {"a": np.array([1.0, np.nan]), "b": np.int64(3), "c": np.bool_(True)}

    assert plain(value) == {"a": [1.0, None], "b": 3, "c": True}
    assert plain(RootModel[int]) == str(RootModel[int])
