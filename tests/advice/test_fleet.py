"""Many loops beside each other: the same answers, in order, whatever happens to the workers."""

import os
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advice import fleet
from advice.fleet import (
    FleetLoop,
    LoopResult,
    WorkersKeepDying,
    assess_fleet,
    assess_loop,
    cluster_crew,
    local_crew,
)
from loop.record import Record


def loops(count: int) -> Iterator[FleetLoop]:
    for n in range(count):
        noise = np.random.default_rng(n).normal(size=300)
        record = Record(
            t=np.arange(300) * 10.0, pv=50.0 + noise, op=40.0 - 0.1 * noise,
            sp=np.full(300, 50.0), mode=np.ones(300, np.int8), tag=f"TIC-{n}",
        )  # fmt: skip
        yield FleetLoop(name=str(n), record=record, kind="temperature", pv_range=(0.0, 100.0))


def plain(results: Any) -> list[tuple[str, float | None, dict[str, Any]]]:
    return [(one.name, one.points, one.body) for one in results]


def test_loops_come_back_in_their_order_and_as_each_comes_alone() -> None:
    alone = plain(assess_loop(loop) for loop in loops(20))
    assert plain(assess_fleet(loops(20))) == alone
    assert plain(assess_fleet(loops(20), crew=local_crew(2))) == alone


def test_workers_start_with_one_thread_and_keep_their_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in fleet.OF_WORKERS:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    with local_crew(1)() as team:
        found = {name: team.submit(os.getenv, name).result() for name in fleet.OF_WORKERS}
    assert found == {**fleet.OF_WORKERS, "OMP_NUM_THREADS": "3"}


def test_a_loop_that_cannot_be_assessed_is_answered_with_the_reason() -> None:
    (loop,) = loops(1)
    backwards = FleetLoop(name="x", record=loop.record, pv_range=(100.0, 0.0))
    found = assess_loop(backwards)
    assert (found.cause, found.points) == ("not assessable", None)
    assert found.because


class _Mortal(Executor):
    """An executor whose worker dies at certain chunks, counted over all of its lives."""

    begun = 0

    def __init__(self, deaths: set[int]) -> None:
        self._deaths = deaths

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        _Mortal.begun += 1
        if _Mortal.begun in self._deaths:
            future.set_exception(BrokenProcessPool("killed"))
        else:
            future.set_result(fn(*args, **kwargs))
        return future


def test_what_a_dead_worker_was_doing_is_done_again_and_nothing_twice() -> None:
    _Mortal.begun = 0
    found = list(assess_fleet(loops(40), crew=lambda: _Mortal({2, 6})))
    assert [one.name for one in found] == [str(n) for n in range(40)]


class _Poisoned(Executor):
    """An executor whose workers die over one loop."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if any(loop.name == "17" for loop in args[0]):
            future.set_exception(BrokenProcessPool("killed"))
        else:
            future.set_result(fn(*args, **kwargs))
        return future


def test_a_loop_that_kills_its_workers_is_answered_so_and_costs_no_other() -> None:
    found = list(assess_fleet(loops(40), crew=_Poisoned))
    assert [one.name for one in found] == [str(n) for n in range(40)]
    assert [one.name for one in found if one.cause == "not assessable"] == ["17"]
    assert "died, 3 times" in found[17].because


def test_workers_that_die_whatever_they_do_end_the_run() -> None:
    _Mortal.begun = 0
    with pytest.raises(WorkersKeepDying, match="whatever they worked on"):
        list(assess_fleet(loops(40), crew=lambda: _Mortal(set(range(1, 1000)))))


def test_a_surprise_over_one_loop_is_that_loops_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    def stumble(*_: Any, **__: Any) -> Any:
        raise IndexError("nobody thought of this")

    monkeypatch.setattr(fleet, "assess", stumble)
    (found,) = assess_fleet(loops(1))
    assert (found.cause, found.points) == ("not assessable", None)
    assert found.because == "the assessment failed unexpectedly (IndexError)"


def _die_once(chunk: tuple[FleetLoop, ...], profile: str) -> list[LoopResult]:
    marker = Path(os.environ["LOOPWRIGHT_TEST_MARKER"])
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return [assess_loop(loop, profile) for loop in chunk]


def test_a_process_that_is_killed_costs_nothing_but_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LOOPWRIGHT_TEST_MARKER", str(tmp_path / "died"))
    monkeypatch.setattr(fleet, "_assess_all", _die_once)
    found = list(assess_fleet(loops(20), crew=lambda: ProcessPoolExecutor(2)))

    assert (tmp_path / "died").exists()
    assert [one.name for one in found] == [str(n) for n in range(20)]


def test_a_cluster_gives_the_same_answers_and_outlives_a_worker() -> None:
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True
    ) as cluster:
        results = assess_fleet(loops(16), crew=cluster_crew(cluster.scheduler_address))
        found = [next(results)]
        os.kill(cluster.workers[0].pid, signal.SIGKILL)
        found += results
    assert plain(found) == plain(assess_loop(loop) for loop in loops(16))


def test_an_address_where_nobody_schedules_is_said_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet, "PATIENCE", 0.2)
    with pytest.raises(ValueError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        cluster_crew("tcp://127.0.0.1:9")()


def test_long_records_go_to_the_workers_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet, "SAMPLES_A_CHUNK", 300)
    _Mortal.begun = 0
    found = list(assess_fleet(loops(10), crew=lambda: _Mortal(set())))
    assert [one.name for one in found] == [str(n) for n in range(10)]
    assert _Mortal.begun == 10
