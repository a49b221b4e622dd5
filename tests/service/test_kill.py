"""Killed with -9 at any instant: what was answered is there, and nothing is half or double."""

import multiprocessing
import os
import random
import signal
import time
from multiprocessing.process import BaseProcess
from pathlib import Path
from uuid import UUID

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL, select

from service.actors import Actor, Role
from service.audit.actions import verify
from service.database import Database
from service.sheets import actions, store
from service.sheets.schemas import NewSheet
from service.tables import AuditRow, SheetDecisionRow, SheetRow

ANNA = Actor(owner="Anna", role=Role.ENGINEER)
BERTA = Actor(owner="Berta", role=Role.APPROVER)
KILLS = 25


def draft_and_approve(url: URL, loop_id: UUID, answered: Path) -> None:
    """Draft and approve without end, and note each approval once it is committed."""
    held = Database.at(url)
    new = NewSheet.model_validate(
        {
            "settings": {"form": "isa", "Kc": 1.0, "Ti": 60.0, "anti_windup": "clamping"},
            "reason": "again and again",
        }
    )
    with answered.open("ab", buffering=0) as file:
        while True:
            with held.sessions.begin() as session:
                sheet = actions.draft_sheet(session, actor=ANNA, loop_id=loop_id, new=new)
            with held.sessions.begin() as session:
                actions.approve_sheet(
                    session,
                    actor=BERTA,
                    loop_id=loop_id,
                    version=sheet.row.version,
                    if_match="*",
                    reason="fine",
                    allow_self_approval=False,
                )
            file.write(f"{sheet.row.version}\n".encode())


@pytest.fixture(scope="module")
def forking() -> multiprocessing.context.ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    return context


def test_killed_at_random_instants_of_approvals(
    forking: multiprocessing.context.ForkServerContext,
    database_url: URL,
    held: Database,
    client: TestClient,
    tmp_path: Path,
) -> None:
    loop = {
        "tag": "TIC-101",
        "pv_low": 0.0,
        "pv_high": 100.0,
        "pv_unit": "degC",
        "action": "reverse",
        "form": "isa",
        "time_unit": "s",
        "gain_basis": "eu",
    }
    loop_id = UUID(client.post("/v1/loops", json=loop).json()["id"])
    answered = tmp_path / "answered"
    chance = random.Random(7)  # noqa: S311 - an instant, not a secret

    for _ in range(KILLS):
        worker = forking.Process(target=draft_and_approve, args=(database_url, loop_id, answered))
        kill_at_work(worker, answered, chance.uniform(0.0, 0.05))
        check(held, loop_id, [int(line) for line in answered.read_text().split()])

    assert len(answered.read_text().split()) >= KILLS


def kill_at_work(worker: BaseProcess, answered: Path, delay: float) -> None:
    before = answered.stat().st_size if answered.exists() else 0
    worker.start()
    deadline = time.monotonic() + 60
    while not (answered.exists() and answered.stat().st_size > before):
        assert worker.is_alive()
        assert time.monotonic() < deadline
        time.sleep(0.002)
    time.sleep(delay)
    assert worker.pid is not None
    os.kill(worker.pid, signal.SIGKILL)
    worker.join()


def check(held: Database, loop_id: UUID, answered: list[int]) -> None:
    with held.readings() as session:
        versions = list(session.scalars(select(SheetRow.version).order_by(SheetRow.version)))
        decisions = session.scalars(select(SheetDecisionRow)).all()
        decided = {row.version: row.approval or 0 for row in decisions}
        lines = list(session.scalars(select(AuditRow.action).order_by(AuditRow.id)))
        current = store.current_sheet(session, loop_id)
        chain = verify(session)

    assert chain.intact
    assert versions == list(range(1, len(versions) + 1))
    assert set(answered) <= set(decided), "an answered approval was lost"
    assert len(decided) - len(answered) <= KILLS, "at most one a kill was not answered"
    assert sorted(decided.values()) == list(range(1, len(decided) + 1))
    assert lines.count("sheet.drafted") == len(versions)
    assert lines.count("sheet.approved") == len(decided)
    assert current is not None
    assert decided[current.row.version] == len(decided)
