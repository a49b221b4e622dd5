"""`loopwright demo` as a person starts it: once, killed, again, and again."""

import contextlib
import json
import os
import re
import signal
import sqlite3
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.error import HTTPError

import pytest

from historian.csv_file import read_export
from loop.plants import PLANT, step_test
from service.audit.actions import verify
from service.cli import run
from service.database import Database
from service.demo_loading import (
    PIECES,
    TESTS_START,
    Installation,
    export_text,
    is_loaded,
    load,
)
from service.demo_plant import APPROVER, DEMO, ENGINEER
from service.samples import open_samples
from service.settings import Settings

LOOPWRIGHT = Path(sys.executable).with_name("loopwright")
PATIENCE = 120.0  # s, of a machine that does much else

VERSIONS = sum(len(demo.sheets) for demo in DEMO)
DECISIONS = sum(sheet.decision is not None for demo in DEMO for sheet in demo.sheets)
STATED = sum(demo.stated is not None for demo in DEMO)
ROWS = {
    "loop": len(DEMO),
    "record": 2 * len(DEMO),
    "model": len(DEMO) + STATED,
    "tuning": len(DEMO),
    "sheet": VERSIONS,
    "sheet_decision": DECISIONS,
    "api_key": 1,
    "job": 1,
}


@contextmanager
def started(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Start the demo in a folder; whatever happens, it does not outlive the test."""
    settings = {k: v for k, v in os.environ.items() if not k.startswith("LOOPWRIGHT_")}
    settings["LOOPWRIGHT_DAILY_AT"] = "off"  # it would do its work in the middle of the test
    with log_of(folder).open("a") as stderr:
        process = subprocess.Popen(
            [str(LOOPWRIGHT), "demo", "--port", "0", "--data", str(folder)],
            stdout=subprocess.PIPE,
            stderr=stderr,
            text=True,
            env=settings,
        )
    try:
        yield process
    finally:
        process.kill()
        process.communicate(timeout=PATIENCE)


def log_of(folder: Path) -> Path:
    return folder.with_name("demo.log")


def greeting(process: subprocess.Popen[str]) -> dict[str, str]:
    """Read what the demo prints until it serves."""
    assert process.stdout is not None
    said: dict[str, str] = {}
    for line in process.stdout:
        name, _, value = line.partition(":")
        said[name] = value.strip()
        if name.startswith("Stop with"):
            return said
    raise AssertionError(f"it ended early with {process.wait(PATIENCE)}: {said}")


def fetch(address: str, key: str | None = None) -> Any:
    request = urllib.request.Request(  # noqa: S310 - the test's own server
        address, headers={} if key is None else {"Authorization": f"Bearer {key}"}
    )
    with urllib.request.urlopen(request, timeout=PATIENCE) as answer:  # noqa: S310
        text = answer.read().decode()
        return json.loads(text) if "json" in answer.headers["content-type"] else text


def rows(folder: Path) -> dict[str, int]:
    connection = sqlite3.connect(folder / "loopwright.sqlite")
    try:
        return {
            table: connection.execute(f"SELECT count(*) FROM {table}").fetchone()[0]  # noqa: S608
            for table in ROWS
        }
    finally:
        connection.close()


def kill_in_the_middle(folder: Path) -> None:
    """Start the demo and end it with SIGKILL once it has stored a few records."""
    with started(folder) as process:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and process.poll() is None:
            try:
                if rows(folder)["record"] >= 3:
                    break
            except sqlite3.OperationalError:  # not there, or not migrated yet
                pass
            time.sleep(0.05)
        assert process.poll() is None, "it ended before it could be killed"
        process.kill()
    assert 3 <= rows(folder)["record"] < ROWS["record"]
    assert rows(folder)["api_key"] == 0


def test_the_demo_loads_once_survives_a_kill_and_starts_again(tmp_path: Path) -> None:
    folder = tmp_path / "demo"
    kill_in_the_middle(folder)

    with started(folder) as process:
        said = greeting(process)
        key = said["API key"].split()[0]
        assert re.fullmatch(r"lw_[0-9a-f]{12}_[\w-]{43}", key)
        assert said["Data folder"] == str(folder)
        assert rows(folder) == ROWS
        head = look_around(said["Address"], said["API docs"], key)
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0

    with started(folder) as process:
        said = greeting(process)
        assert said["API key"].startswith("printed at the first start")
        assert "loopwright key create" in said["API key"]
        assert rows(folder) == ROWS
        assert fetch(f"{said['Address']}/v1/audit/verify", key)["head"] == head
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
    assert "Traceback" not in log_of(folder).read_text("utf-8")


def look_around(address: str, docs: str, key: str) -> str:
    """Look at what a visitor looks at, and give the head of the audit trail."""
    assert fetch(f"{address}/health") == {"status": "ready"}
    assert "/v1/loops" in fetch(docs)
    with pytest.raises(HTTPError, match="401"):
        fetch(f"{address}/v1/loops")
    loops = {loop["tag"]: loop for loop in fetch(f"{address}/v1/loops", key)["items"]}
    assert sorted(loops) == sorted(plant.tag for plant in PLANT)
    for demo in DEMO:
        look_at_loop(f"{address}/v1/loops/{loops[demo.plant.tag]['id']}", key, demo.plant.tag)
    look_at_scorecard(address, key)
    trail = fetch(f"{address}/v1/audit/verify", key)
    assert trail["intact"] is True
    # Every change is one line: a draft, an approval, a record, the key, the end of the job.
    assert trail["rows"] == sum(ROWS.values()) + 1
    return str(trail["head"])


def look_at_scorecard(address: str, key: str) -> None:
    """Wait for the assessment of the routine data, and look at what it says of the plant."""
    end = time.monotonic() + PATIENCE
    while (job := fetch(f"{address}/v1/jobs", key)["items"][0])["state"] in ("queued", "running"):
        assert time.monotonic() < end, job
        time.sleep(0.2)
    assert job["state"] == "done", job
    assert job["result"] == {"loops": len(DEMO), "assessed": len(DEMO), "without_samples": 0}
    card = fetch(f"{address}/v1/scorecard", key)
    assert card["plant"]["loops"] == card["plant"]["assessable"] == len(DEMO)


def look_at_loop(loop: str, key: str, tag: str) -> None:
    """Hold a loop's models, settings and sheets against the plant they come from."""
    demo = next(demo for demo in DEMO if demo.plant.tag == tag)
    true = demo.plant.process
    models = fetch(f"{loop}/models", key)["items"]
    if tag in ("FIC-101", "PIC-102", "TIC-201", "TIC-203"):
        (model,) = models
        assert model["verdict"] == "trusted"
        for name, within in (("K", 0.01), ("tau", 0.02), ("theta", 0.05)):
            assert model[name] == pytest.approx(getattr(true, name), rel=within)
    if demo.stated is not None:
        assert [model["verdict"] for model in models] == ["stated", "trusted"]
        for name, value in models[0]["parameters"].items():
            assert models[1]["parameters"][name] == pytest.approx(value, rel=0.1)
    versions = fetch(f"{loop}/sheets", key)["items"]
    wanted = [sheet.decision for sheet in reversed(demo.sheets)]
    assert [v["decision"] and v["decision"]["decision"] for v in versions] == wanted
    assert {v["author"] for v in versions} == {ENGINEER.owner}
    assert {v["decision"]["author"] for v in versions if v["decision"]} == {APPROVER.owner}
    # The recommendation keeps the profile, and what was turned down does not.
    for version, sheet in zip(reversed(versions), demo.sheets, strict=True):
        if sheet.settings == "recommended":
            assert version["evidence"]["passes"] is True
        if sheet.decision == "rejected":
            assert version["evidence"]["passes"] is False


def test_a_load_that_stops_anywhere_goes_on_there(
    installation: Path, sqlite_held: Database, said: Callable[[], tuple[str, str]]
) -> None:
    settings = Settings(data=installation)
    into = Installation(held=sqlite_held, samples=open_samples(settings), settings=settings)

    class Stopped(Exception):
        pass

    def load_up_to(pieces: int) -> int:
        told: list[str] = []

        def tell(what: str) -> None:
            if len(told) == pieces:
                raise Stopped
            told.append(what)

        with contextlib.suppress(Stopped):
            load(into, tell)
        return len(told)

    lines = 0
    for pieces in (1, 3, 4, 15, PIECES + 1):
        assert load_up_to(pieces) == min(pieces, PIECES)
        # One line for each piece of each kind: nothing is there twice, nothing without its line.
        found = rows(installation)
        assert trail_length(sqlite_held) == sum(found.values()) > lines
        lines = sum(found.values())
        assert is_loaded(sqlite_held, settings) is False
    assert rows(installation) == ROWS | {"api_key": 0}
    assert said()[1] == ""


def trail_length(held: Database) -> int:
    with held.readings() as session:
        verdict = verify(session)
    assert verdict.intact
    return verdict.rows


def test_somebodys_installation_is_not_filled_with_a_demo(
    installation: Path, sentence: Any
) -> None:
    assert run(["key", "create", "--owner", "Anna", "--role", "admin"]) == 0
    assert run(["demo", "--port", "0"]) == 1
    assert "holds an installation that is no demo" in sentence()
    assert rows(installation) == dict.fromkeys(ROWS, 0) | {"api_key": 1}


@pytest.mark.parametrize("plant", PLANT, ids=lambda plant: plant.tag)
def test_an_export_of_the_demo_reads_back_as_the_record_it_was_written_from(
    plant: Any, tmp_path: Path
) -> None:
    record = step_test(plant, start=TESTS_START)
    file = tmp_path / "step.csv"
    file.write_text(export_text(record), "utf-8")

    read = read_export(file).record()

    assert read.tag == plant.tag
    assert read.start == TESTS_START
    assert read.t == pytest.approx(record.t, abs=1e-9)
    assert read.pv == pytest.approx(record.pv, abs=0.5e-4)
    assert read.op == pytest.approx(record.op, abs=0.5e-3)
    assert read.mode is not None
    assert read.mode.tolist() == [0] * len(record)
    assert export_text(record) == file.read_text("utf-8")


def test_an_export_needs_instants() -> None:
    with pytest.raises(ValueError, match="needs instants"):
        export_text(step_test(PLANT[0]))
