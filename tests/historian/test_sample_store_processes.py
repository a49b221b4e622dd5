"""Several processes write at once, and processes are killed: nothing is lost, nothing is double.

Run as a program this file is the parent of the writers: it has everything imported and forks one
for every line `NAME FIRST COUNT LOOP...` on stdin, answering its process id. A writer sends uploads
number FIRST, FIRST + 1, ... and notes each one in `NAME.answered` once the store has answered.
"""

import os
import random
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from historian.sample_layout import tables_of
from historian.sample_log import SampleLog
from historian.sample_reading import rows_in
from historian.sample_rows import Rows, rows_of, sorted_once
from historian.sample_store import SampleStore
from historian.samples import Samples
from loop.errors import NoSamples

ROOT = Path(__file__).parents[2]
ROWS = 40
LOOPS = ("FIC-1", "FIC-2", "FIC-3")


def upload(number: int) -> Samples:
    """Make upload n: 40 rows over seven hours, overlapping its neighbours, with PV = n."""
    seconds = (number % 17 * 13 + np.arange(ROWS)) * 600
    return Samples(
        time=np.datetime64("2026-03-01", "us") + seconds.astype("timedelta64[s]"),
        pv=np.full(ROWS, float(number)),
        sp=np.full(ROWS, np.nan),
        op=seconds.astype(np.float64),
        mode=np.ones(ROWS, np.int8),
    )


def write_uploads(folder: Path, name: str, first: int, count: int, loops: list[str]) -> None:
    store = SampleStore(folder)
    with (folder.parent / f"{name}.answered").open("ab", buffering=0) as notes:
        for number in range(first, first + count):
            store.write(loops[number % len(loops)], upload(number))
            notes.write(f"{number}\n".encode())


def fork_writers(folder: Path) -> None:
    rows_in(next(tables_of("warm-up", rows_of(upload(0)))))  # imports what Arrow needs only once
    for line in sys.stdin:
        name, first, count, *loops = line.split()
        child = os.fork()
        if child == 0:
            try:
                write_uploads(folder, name, int(first), int(count), loops)
            except BaseException:  # noqa: BLE001 - a fork must never return into the parent's code
                traceback.print_exc()
                os._exit(1)
            os._exit(0)
        sys.stdout.write(f"{child}\n")
        sys.stdout.flush()


class Writers:
    """Forks writers of one store and waits for them or kills them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._parent = subprocess.Popen(
            [sys.executable, __file__, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )

    def start(self, name: str, first: int, count: int, *loops: str) -> int:
        assert self._parent.stdin is not None
        assert self._parent.stdout is not None
        self._parent.stdin.write(f"{name} {first} {count} {' '.join(loops)}\n")
        self._parent.stdin.flush()
        return int(self._parent.stdout.readline())

    def answered(self, name: str) -> list[int]:
        notes = self.folder.parent / f"{name}.answered"
        return [int(line) for line in notes.read_text().split()] if notes.exists() else []

    def close(self) -> None:
        self._parent.communicate()


@pytest.fixture
def writers(tmp_path: Path) -> Iterator[Writers]:
    writers = Writers(tmp_path / "samples")
    yield writers
    writers.close()


def alive(process: int) -> bool:
    """Tell whether a forked writer still runs; its own parent only reaps it later."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def wait_for(condition: object, *, seconds: float = 60.0) -> None:
    assert callable(condition)
    give_up = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < give_up, "waited in vain"
        time.sleep(0.002)


def expected(numbers: list[int], loop: str) -> Rows:
    """Lay uploads over each other in plain numpy: the second route to what must be stored."""
    mine = [rows_of(upload(n)) for n in numbers if LOOPS[n % len(LOOPS)] == loop]
    return sorted_once(np.concatenate(mine)) if mine else rows_of(upload(0))[:0]


def stored(store: SampleStore, loop: str) -> Rows:
    try:
        return rows_of(store.read(loop))
    except NoSamples:
        return rows_of(upload(0))[:0]


def same(one: Rows, other: Rows) -> bool:
    return one.shape == other.shape and all(
        np.array_equal(one[name], other[name], equal_nan=True) for name in ("time", "sp", "pv")
    )


def test_killed_at_random_instants_it_keeps_all_it_answered_and_nothing_twice(
    writers: Writers,
) -> None:
    chance = random.Random(20260301)  # noqa: S311
    done = 0
    for attempt in range(20):
        name = f"attempt-{attempt}"
        child = writers.start(name, done, 1000, *LOOPS)
        if attempt % 2:  # otherwise it may die before it has even opened the store
            wait_for(lambda name=name: writers.answered(name))
        time.sleep(chance.uniform(0, 0.1))
        os.kill(child, signal.SIGKILL)
        wait_for(lambda child=child: not alive(child))
        answered = writers.answered(name)
        assert answered == list(range(done, done + len(answered)))
        done += len(answered)
        store = SampleStore(writers.folder, dead_after=0.0)
        half_way = [
            loop for loop in LOOPS if not same(stored(store, loop), expected([*range(done)], loop))
        ]
        if half_way:  # the upload that was under way: in as a whole, though not answered
            assert half_way == [LOOPS[done % len(LOOPS)]]
            assert same(stored(store, half_way[0]), expected([*range(done + 1)], half_way[0]))
    assert done >= 10
    assert not list(writers.folder.rglob("*#*"))

    store.write(LOOPS[done % len(LOOPS)], upload(done))  # simply sent again
    for loop in LOOPS:
        assert same(stored(store, loop), expected([*range(done + 1)], loop))
    store.tidy(keep_hours=0)
    on_disk = {str(path.relative_to(writers.folder)) for path in writers.folder.rglob("*.parquet")}
    in_log = {file.path for file in SampleLog(writers.folder).files()}
    assert {path for path in on_disk if not path.startswith("_delta_log")} == in_log
    for loop in LOOPS:
        assert same(stored(store, loop), expected([*range(done + 1)], loop))


def test_four_processes_at_once_lose_nothing(writers: Writers) -> None:
    each, start = 8, {"w0": 0, "w1": 1000, "w2": 2000, "w3": 3000}
    children = [writers.start(name, n, each, "FIC-7", f"own-{name}") for name, n in start.items()]
    wait_for(lambda: not any(alive(child) for child in children))

    store = SampleStore(writers.folder)
    instants: dict[str, set[int]] = {}
    for name, first in start.items():
        assert writers.answered(name) == list(range(first, first + each))
        for number in range(first, first + each):
            loop = ("FIC-7", f"own-{name}")[number % 2]
            instants.setdefault(loop, set()).update(rows_of(upload(number))["time"].tolist())
    for loop, times in instants.items():
        rows = rows_of(store.read(loop))
        assert rows["time"].tolist() == sorted(times)
        assert store.span(loop).rows == len(times)
        for row in rows:  # every cell is one that somebody sent for that very instant
            number = int(row["pv"])
            assert row["time"] in rows_of(upload(number))["time"]


if __name__ == "__main__":
    fork_writers(Path(sys.argv[1]))
