"""Commits: durable before they are answered, never lost to each other, never half done."""

import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from deltalake import DeltaTable
from deltalake.exceptions import CommitFailedError, DeltaError

from historian import sample_store, sample_tidy
from historian.sample_change import Change, change_day
from historian.sample_log import CHECKPOINT_EVERY, SampleLog
from historian.sample_store import SampleStore
from historian.samples import Samples
from loop.errors import DiskFull, StoreBusy, StoreDamaged

ONE_BUCKET = ("L04", "L10")


def samples(*pv: float, day: str = "2026-01-01") -> Samples:
    n = len(pv)
    return Samples(
        time=np.datetime64(day, "us") + np.arange(n).astype("timedelta64[m]"),
        pv=np.array(pv),
        sp=np.full(n, np.nan),
        op=np.zeros(n),
        mode=np.full(n, -1, np.int8),
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "samples"


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Note every file and folder that is put on the disk, in order."""
    paths: list[Path] = []
    really = os.fsync

    def noted(handle: int) -> None:
        paths.append(Path(f"/proc/self/fd/{handle}").readlink())
        really(handle)

    monkeypatch.setattr(os, "fsync", noted)
    return paths


def entries(folder: Path) -> list[str]:
    return sorted(path.name for path in (folder / "_delta_log").iterdir())


def data_files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.glob("date=*/*/*.parquet")}


def test_an_answered_upload_is_on_the_disk_with_every_folder_that_leads_to_it(
    folder: Path, synced: list[Path]
) -> None:
    store = SampleStore(folder)
    log = folder / "_delta_log"
    assert {log / f"{0:020d}.json", log, folder, folder.parent} <= set(synced)
    for version, day in enumerate(("2026-01-01", "2026-01-01", "2026-01-02"), start=1):
        synced.clear()
        before = data_files(folder)
        store.write("FIC-211", samples(float(version), day=day))
        (new,) = data_files(folder) - before
        entry = log / f"{version:020d}.json"
        assert {folder / new, (folder / new).parent, entry, log} <= set(synced)
        if day not in str(before):  # the folder of the day is new, so the folder above tells of it
            assert {folder, (folder / new).parents[1]} <= set(synced)
        assert synced.index(folder / new) < synced.index(entry) < synced.index(log)


def test_an_entry_that_another_process_left_unsecured_is_secured_before_the_answer(
    folder: Path, synced: list[Path]
) -> None:
    SampleStore(folder).write("FIC-211", samples(1.0))
    synced.clear()
    late = SampleStore(folder)
    assert late.write("FIC-211", samples(1.0)).unchanged == 1  # nothing to write, but to make sure
    assert folder / "_delta_log" / f"{1:020d}.json" in synced
    assert folder / "_delta_log" in synced


def test_entries_before_an_answered_one_are_on_the_disk_too(
    folder: Path, synced: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    store, other = SampleStore(folder), SampleStore(folder)
    with monkeypatch.context() as patch:
        patch.setattr(SampleLog, "secure", lambda _: None)  # killed just before it was safe
        other.write("FIC-211", samples(1.0))
    synced.clear()
    store.write("FIC-212", samples(1.0))
    log = folder / "_delta_log"
    assert {log / f"{1:020d}.json", log / f"{2:020d}.json", log} <= set(synced)


def test_data_is_on_the_disk_before_the_log_speaks_of_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = SampleStore(folder)

    def broken(_: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", broken)
    with pytest.raises(OSError, match="Input/output error"):
        store.write("FIC-211", samples(1.0))
    assert entries(folder) == [f"{0:020d}.json"]
    assert data_files(folder) == set()


class Interrupted:
    """Lets another writer in between reading and committing."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, times: int, act: Callable[[], object]
    ) -> None:
        self.left = times
        self.act = act
        self.really = SampleLog.commit
        monkeypatch.setattr(SampleLog, "commit", self._patched())

    def _patched(self) -> Callable[..., None]:
        def commit(log: SampleLog, *files: object, **options: object) -> None:
            if self.left:
                self.left -= 1
                left, self.left = self.left, 0
                self.act()
                self.left = left
            self.really(log, *files, **options)

        return commit


def test_a_writer_that_is_overtaken_reads_again_and_loses_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow, quick = SampleStore(folder), SampleStore(folder)
    slow.write("FIC-211", samples(1, 2, 3))
    Interrupted(monkeypatch, 1, lambda: quick.write("FIC-211", samples(1, 20, 3, 4)))
    result = slow.write("FIC-211", samples(1, 2, 30, 40, 50))
    assert (result.new, result.replaced, result.unchanged) == (1, 3, 1)
    assert slow.read("FIC-211").pv.tolist() == [1, 2, 30, 40, 50]
    assert data_files(folder) >= {file.path for file in SampleLog(folder).files()}
    assert slow.span("FIC-211").rows == 5


def test_two_first_uploads_of_a_loop_at_once_store_no_instant_twice(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow, quick = SampleStore(folder), SampleStore(folder)
    Interrupted(monkeypatch, 1, lambda: quick.write("FIC-211", samples(1, 2, 3)))
    result = slow.write("FIC-211", samples(1, 2, 30))
    assert (result.new, result.replaced, result.unchanged) == (0, 1, 2)
    assert slow.span("FIC-211").rows == 3


def test_days_that_nobody_touched_are_not_worked_out_again(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow, quick = SampleStore(folder), SampleStore(folder)
    worked: list[str] = []

    def noted(*arguments: Any) -> Change:
        worked.append(str(arguments[2]))
        return change_day(*arguments)

    Interrupted(monkeypatch, 1, lambda: quick.write("FIC-211", samples(9, day="2026-01-02")))
    monkeypatch.setattr(sample_store, "change_day", noted)
    slow.write("FIC-211", [samples(1, day="2026-01-01"), samples(2, day="2026-01-02")])
    assert worked == ["2026-01-01", "2026-01-02", "2026-01-02", "2026-01-02"]  # one is the quick's
    assert slow.read("FIC-211").pv.tolist() == [1, 2]


def test_a_writer_overtaken_time_after_time_gives_up_in_words(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow, quick = SampleStore(folder), SampleStore(folder)
    monkeypatch.setattr(sample_store, "ATTEMPTS", 3)
    numbers = iter(range(100))
    Interrupted(monkeypatch, 99, lambda: quick.write("FIC-211", samples(float(next(numbers)))))
    with pytest.raises(StoreBusy, match="got in first 3 times, so nothing was stored") as refusal:
        slow.write("FIC-211", samples(-1, -2))
    assert refusal.value.attempts == 3
    assert slow.read("FIC-211").pv.tolist() == [2.0]
    slow.tidy(keep_hours=0)
    assert len(data_files(folder)) == 1


def test_loops_that_share_a_file_do_not_overwrite_each_other(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow, quick = SampleStore(folder), SampleStore(folder)
    for loop in ONE_BUCKET:
        slow.write(loop, samples(1, 2))
    assert slow.tidy().written == 1
    Interrupted(monkeypatch, 1, lambda: quick.write("L04", samples(10, 2)))
    slow.write("L10", samples(1, 20))
    assert slow.read("L04").pv.tolist() == [10, 2]
    assert slow.read("L10").pv.tolist() == [1, 20]


def test_threads_of_one_store_lose_nothing(folder: Path) -> None:
    store = SampleStore(folder)
    days = [f"2026-01-{day:02d}" for day in range(1, 5)]
    threads = [
        threading.Thread(target=store.write, args=("FIC-211", samples(1, 2, 3, day=day)))
        for day in days
    ]
    for thread in threads:
        thread.start()
    for _ in range(20):  # a reader moves its own view only
        store.read_in_parts("FIC-211")
    for thread in threads:
        thread.join()
    assert store.span("FIC-211").rows == 12


def test_a_full_disk_is_said_so_and_leaves_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = SampleStore(folder)

    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", refuse)
    with pytest.raises(DiskFull, match="disk that holds the samples is full"):
        store.write("FIC-211", samples(1.0))
    assert data_files(folder) == set()
    assert entries(folder) == [f"{0:020d}.json"]


def test_a_full_disk_under_the_log_is_said_so_and_leaves_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = SampleStore(folder)

    def refuse(*_: object, **__: object) -> None:
        raise DeltaError("Generic LocalFileSystem error: ... No space left on device (os error 28)")

    with monkeypatch.context() as patch:
        patch.setattr(DeltaTable, "create_write_transaction", refuse)
        with pytest.raises(DiskFull):
            store.write("FIC-211", samples(1.0))
    assert data_files(folder) == set()
    assert store.write("FIC-211", samples(1.0)).new == 1


def test_files_of_a_commit_that_got_in_before_its_error_stay(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = SampleStore(folder)

    def lost_answer(_: SampleLog) -> None:
        raise OSError(errno.EIO, "Input/output error")

    with monkeypatch.context() as patch:
        patch.setattr(SampleLog, "secure", lost_answer)
        with pytest.raises(OSError, match="Input/output"):
            store.write("FIC-211", samples(1.0))
    assert store.read("FIC-211").pv.tolist() == [1.0]
    assert store.write("FIC-211", samples(1.0)).unchanged == 1


def test_files_stay_where_nobody_knows_whether_the_commit_is_in(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = SampleStore(folder)

    def fails(*_: object, **__: object) -> None:
        raise StoreDamaged("the disk is gone")

    with monkeypatch.context() as patch:
        patch.setattr(SampleLog, "commit", fails)
        patch.setattr(SampleLog, "holds", fails)
        with pytest.raises(StoreDamaged, match="the disk is gone"):
            store.write("FIC-211", samples(1.0))
    assert len(data_files(folder)) == 1
    assert store.tidy(keep_hours=0).deleted == 1
    assert data_files(folder) == set()


def test_opening_reads_a_checkpoint_instead_of_every_entry(
    folder: Path, synced: list[Path]
) -> None:
    store = SampleStore(folder)
    for number in range(CHECKPOINT_EVERY + 2):
        store.write(f"L{number % 3}", samples(float(number)))
    checkpoint = folder / "_delta_log" / f"{CHECKPOINT_EVERY:020d}.checkpoint.parquet"
    assert {checkpoint, checkpoint.with_name("_last_checkpoint")} <= set(synced)
    again = SampleStore(folder)
    assert [again.read(f"L{n}").pv.tolist() for n in range(3)] == [[51], [49], [50]]
    log = SampleLog(folder)
    assert log.version == CHECKPOINT_EVERY + 2


def test_a_checkpoint_that_cannot_be_written_is_no_failure(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_: DeltaTable) -> None:
        raise DeltaError("No space left on device")

    store = SampleStore(folder)
    monkeypatch.setattr(DeltaTable, "create_checkpoint", fails)
    store.write("FIC-211", samples(1.0))
    assert store.tidy().deleted == 0
    assert store.read("FIC-211").pv.tolist() == [1.0]


def test_tidying_leaves_what_an_upload_changes_meanwhile(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, other = SampleStore(folder), SampleStore(folder)
    for loop in ONE_BUCKET:
        store.write(loop, samples(1, 2))
    Interrupted(monkeypatch, 1, lambda: other.write("L04", samples(10, 2)))
    tidied = store.tidy()
    assert (tidied.joined, tidied.written, tidied.left) == (0, 0, 2)
    assert store.read("L04").pv.tolist() == [10, 2]
    tidied = store.tidy()
    assert (tidied.joined, tidied.written, tidied.left) == (2, 1, 0)
    assert store.read("L04").pv.tolist() == [10, 2]
    assert store.tidy().joined == 0


def test_tidying_leaves_large_files_alone(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = SampleStore(folder)
    monkeypatch.setattr(sample_tidy, "ROWS_A_FILE", 5)
    store.write(ONE_BUCKET[0], samples(1, 2, 3, 4))
    store.write(ONE_BUCKET[1], samples(1, 2))
    assert store.tidy().joined == 0
    store.write("L27", samples(1, 2))
    assert store.tidy().joined == 2
    assert store.read(ONE_BUCKET[0]).pv.tolist() == [1, 2, 3, 4]


def test_tidying_does_not_write_a_large_file_again_for_a_few_samples(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = SampleStore(folder)
    monkeypatch.setattr(sample_tidy, "MOST_TIMES_LARGER", 3)
    store.write(ONE_BUCKET[0], samples(*range(40)))
    store.write(ONE_BUCKET[1], samples(1, 2))
    assert store.tidy().joined == 0
    store.write("L27", samples(*range(5)))
    assert store.tidy().joined == 2  # 2 and 5 samples are alike
    store.write("L33", samples(*range(7)))
    assert store.tidy().joined == 3  # 7, 7 and 40 are, too
    assert [store.span(loop).rows for loop in (*ONE_BUCKET, "L27", "L33")] == [40, 2, 5, 7]


def test_tidying_spares_files_that_a_reader_may_still_have_open(folder: Path) -> None:
    store = SampleStore(folder)
    store.write("L04", samples(1, 2))
    before = SampleLog(folder)
    store.write("L04", samples(10, 2))
    assert store.tidy().deleted == 0
    assert all((folder / file.path).exists() for file in before.files())
    assert store.tidy(keep_hours=0).deleted == 1


def test_a_view_whose_entries_were_cleaned_away_starts_over(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = SampleStore(folder)
    log = SampleLog(folder)
    store.write("L04", samples(1, 2))

    def gone(_: DeltaTable) -> None:
        raise DeltaError("entry 1 is gone")

    monkeypatch.setattr(DeltaTable, "update_incremental", gone)
    log.refresh()
    assert log.version == 1


def test_the_trap_itself_two_commits_on_one_version_do_not_both_get_in(folder: Path) -> None:
    store = SampleStore(folder)
    store.write("L04", samples(1.0))
    one, other = SampleLog(folder), SampleLog(folder)
    (file,) = one.files()
    one.commit([], [file], loop="L04")
    with pytest.raises(CommitFailedError):
        other.commit([], [file], loop="L04")
