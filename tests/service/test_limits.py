"""Nobody takes the service away from the others: flooding, guessing, and what must still work."""

import re
from contextlib import ExitStack
from pathlib import Path

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from service.actors import Actor, Role
from service.app import create_app
from service.database import Database
from service.errors import NotAuthenticated, TooManyRequests
from service.keys.actions import create_key, revoke_key
from service.limits import HEAVY_IN_ALL, Allowance, Limits
from service.settings import Settings

WRONG = "lw_000000000000_" + "A" * 43
QUESTION = {"process": {"kind": "FOPDT", "K": 1.0, "tau": 10.0, "theta": 2.0}}


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def limits(clock: Clock, **settings: int) -> Limits:
    return Limits(Settings(**settings), clock)


def test_an_allowance_is_spent_at_once_and_comes_back_evenly(clock: Clock) -> None:
    allowance: Allowance[str] = Allowance(6, clock)

    assert [allowance.take("a") for _ in range(7)] == [0, 0, 0, 0, 0, 0, 10]
    assert allowance.take("b") == 0  # somebody else
    clock.now = 4.0
    assert allowance.take("a") == pytest.approx(6.0)
    clock.now = 10.0
    assert [allowance.take("a") for _ in range(2)] == [0, 10]
    clock.now = 1e6
    assert [allowance.take("a") for _ in range(7)] == [0, 0, 0, 0, 0, 0, 10]
    allowance.give_back("a")
    assert allowance.take("a") == 0


def test_any_number_of_callers_takes_bounded_memory(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.limits.MOST_REMEMBERED", 100)
    tried = limits(clock)

    for n in range(1_000):
        with tried.trying(f"token {n}", f"10.0.{n // 256}.{n % 256}"):
            pass

    assert len(tried._tries._left) == len(tried._known) == 100


def test_one_key_cannot_take_all_the_places(clock: Clock) -> None:
    held = limits(clock, heavy_at_once=3)
    with ExitStack() as under_way:
        for _ in range(3):
            under_way.enter_context(held.heavy("anna"))
        with pytest.raises(TooManyRequests, match="3 questions under way"), held.heavy("anna"):
            pass
        with held.heavy("bert"):
            pass
    with held.heavy("anna"):  # a question that ended makes room
        pass
    with pytest.raises(ZeroDivisionError), held.heavy("anna"):
        1 / 0  # noqa: B018
    assert held._running.total() == 0


def test_all_keys_together_leave_threads_for_the_rest(clock: Clock) -> None:
    held = limits(clock)
    with ExitStack() as under_way:
        for n in range(HEAVY_IN_ALL):
            under_way.enter_context(held.heavy(f"key {n % 8}"))
        with pytest.raises(TooManyRequests, match="as many questions"), held.heavy("another"):
            pass


def test_limits_of_nought_are_none(clock: Clock) -> None:
    held = limits(clock, heavy_at_once=0, heavy_per_minute=0, failed_keys_per_minute=0)
    with ExitStack() as under_way:
        for _ in range(HEAVY_IN_ALL):
            under_way.enter_context(held.heavy("anna"))
    for _ in range(100):
        with pytest.raises(NotAuthenticated), held.trying(WRONG, "192.0.2.1"):
            raise NotAuthenticated("no")


@pytest.mark.parametrize(
    ("first", "second", "same"),
    [
        ("192.0.2.1", "192.0.2.2", False),
        ("2001:db8::1", "2001:db8::ffff:1", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("::ffff:192.0.2.1", "::ffff:192.0.2.2", False),
        ("a socket", "a socket", True),
    ],
)
def test_who_is_behind_an_address(clock: Clock, first: str, second: str, same: bool) -> None:
    held = limits(clock, failed_keys_per_minute=1)
    with pytest.raises(NotAuthenticated), held.trying("a", first):
        raise NotAuthenticated("no")

    with pytest.raises(TooManyRequests if same else NotAuthenticated), held.trying("b", second):
        raise NotAuthenticated("no")


def test_guesses_sent_all_at_once_are_counted_before_they_are_looked_at(clock: Clock) -> None:
    held = limits(clock, failed_keys_per_minute=5)
    with ExitStack() as under_way:
        for n in range(5):
            under_way.enter_context(held.trying(f"guess {n}", "192.0.2.1"))
        with pytest.raises(TooManyRequests), held.trying("guess 5", "192.0.2.1"):
            pass


def test_a_database_that_is_gone_counts_against_nobody(clock: Clock) -> None:
    held = limits(clock, failed_keys_per_minute=1)
    for _ in range(3):
        with pytest.raises(OSError, match="gone"), held.trying("a key", "192.0.2.1"):
            raise OSError("gone")


@pytest.fixture
def strict(sqlite_held: Database, data_folder: Path) -> FastAPI:
    return create_app(
        Settings(data=data_folder, heavy_per_minute=2, failed_keys_per_minute=3), sqlite_held
    )


@pytest.fixture
def tokens(sqlite_held: Database) -> list[str]:
    with sqlite_held.sessions.begin() as session:
        return [create_key(session, owner=owner, role=Role.ADMIN)[1] for owner in ("Anna", "Bert")]


def as_holder(app: FastAPI, token: str) -> TestClient:
    return TestClient(app, headers={"Authorization": f"Bearer {token}"})


def test_a_flood_of_questions_is_answered_429_and_stops_nobody_else(
    strict: FastAPI, tokens: list[str]
) -> None:
    anna, bert = (as_holder(strict, token) for token in tokens)

    assert [anna.post("/v1/tunings", json=QUESTION).status_code for _ in range(2)] == [200, 200]
    answer = anna.post("/v1/tunings", json=QUESTION)

    assert answer.status_code == 429
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["type"] == "/problems/too-many-requests"
    assert 1 <= int(answer.headers["retry-after"]) == answer.json()["retry_after"] <= 30
    assert anna.get("/problems/too-many-requests").status_code == 200
    assert anna.get("/v1/loops").status_code == 200  # what is not heavy goes on
    assert bert.post("/v1/tunings", json=QUESTION).status_code == 200


def test_guessing_keys_ends_in_429_whether_or_not_the_next_guess_is_right(
    strict: FastAPI, tokens: list[str], sqlite_held: Database
) -> None:
    anna, bert = (as_holder(strict, token) for token in tokens)
    assert anna.get("/v1/loops").status_code == 200
    guesser = as_holder(strict, WRONG)

    statuses = [guesser.get("/v1/loops").status_code for _ in range(5)]

    assert statuses == [401, 401, 401, 429, 429]
    assert bert.get("/v1/loops").status_code == 429  # right, and not looked at
    assert anna.get("/v1/loops").status_code == 200  # let in before, from the same address
    assert TestClient(strict).get("/v1/loops").status_code == 401  # no key at all
    elsewhere = TestClient(strict, client=("192.0.2.7", 1), headers=dict(bert.headers))
    assert elsewhere.get("/v1/loops").status_code == 200
    found = re.fullmatch(r"lw_(\w{12})_.*", tokens[0])
    assert found is not None
    with sqlite_held.sessions.begin() as session:
        revoke_key(session, actor=Actor(owner="Bert", role=Role.ADMIN), key_id=found[1])
    assert [anna.get("/v1/loops").status_code for _ in range(2)] == [401, 429]
