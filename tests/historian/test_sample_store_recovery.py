"""What kills and power cuts leave behind is put right when the store is opened."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from deltalake import DeltaTable
from deltalake.exceptions import DeltaError

from historian.sample_log import SampleLog
from historian.sample_recovery import set_aside_torn_entries, sweep_staging
from historian.sample_rows import ROW
from historian.sample_spool import Spool
from historian.sample_store import SampleStore
from historian.samples import Samples
from loop.errors import StoreDamaged


def samples(*pv: float) -> Samples:
    n = len(pv)
    return Samples(
        time=np.datetime64("2026-01-01", "us") + np.arange(n).astype("timedelta64[m]"),
        pv=np.array(pv),
        sp=np.full(n, np.nan),
        op=np.zeros(n),
        mode=np.full(n, -1, np.int8),
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "samples"


def entry(folder: Path, version: int) -> Path:
    return folder / "_delta_log" / f"{version:020d}.json"


def left_by_a_kill(folder: Path, name: str, *, age: float) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"half a file")
    os.utime(path, (time.time() - age, time.time() - age))
    return path


@pytest.mark.parametrize(
    "name",
    [
        "date=2026-01-01/bucket=3/8f7d.parquet#1",
        "_delta_log/00000000000000000009.json#12",
        "_delta_log/_last_checkpoint#1",
        "_staging/6f1c9a54/2026-01-01",
    ],
)
def test_staging_files_of_dead_writers_are_swept_when_the_store_opens(
    folder: Path, name: str
) -> None:
    SampleStore(folder).write("FIC-211", samples(1.0))
    dead = left_by_a_kill(folder, name, age=100_000.0)
    alive = left_by_a_kill(folder, name.replace("6f1c", "0a3c").replace("#", "x#"), age=10.0)
    store = SampleStore(folder)
    assert not dead.exists()
    assert alive.exists()
    assert store.read("FIC-211").pv.tolist() == [1.0]


def test_sweeping_takes_nothing_that_is_not_staging(folder: Path) -> None:
    store = SampleStore(folder)
    store.write("FIC#1", samples(1.0))
    for name in ("notes#.txt", "a#1.parquet", "#", "date=2026-01-01/#x1"):
        left_by_a_kill(folder, name, age=100_000.0)
    assert sweep_staging(folder, older_than=0.0) == 0
    assert store.read("FIC#1").pv.tolist() == [1.0]


def test_a_staging_file_that_goes_away_meanwhile_is_no_trouble(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left_by_a_kill(folder, "a.parquet#1", age=100_000.0)

    def gone(_: Path, **__: object) -> None:
        raise FileNotFoundError

    monkeypatch.setattr(Path, "unlink", gone)
    assert sweep_staging(folder, older_than=0.0) == 0


TORN: dict[str, Callable[[bytes], bytes]] = {
    "cut short": lambda whole: whole[: len(whole) // 2],
    "zeros": lambda whole: b"\0" * len(whole),
}


@pytest.mark.parametrize("kind", TORN)
def test_a_torn_newest_entry_is_set_aside(folder: Path, kind: str) -> None:
    store = SampleStore(folder)
    store.write("FIC-211", samples(1, 2))
    store.write("FIC-211", samples(1, 20, 30))
    entry(folder, 2).write_bytes(TORN[kind](entry(folder, 2).read_bytes()))
    with pytest.raises(DeltaError):
        DeltaTable(folder)

    again = SampleStore(folder)
    assert again.read("FIC-211").pv.tolist() == [1, 2]
    assert entry(folder, 2).with_suffix(".json.torn").exists()
    result = again.write("FIC-211", samples(1, 20, 30))  # was never answered: sent again
    assert (result.new, result.replaced) == (1, 1)
    assert SampleStore(folder).read("FIC-211").pv.tolist() == [1, 20, 30]


def test_an_empty_newest_entry_is_an_entry_without_content(folder: Path) -> None:
    store = SampleStore(folder)
    store.write("FIC-211", samples(1, 2))
    entry(folder, 2).write_bytes(b"")
    again = SampleStore(folder)
    again.write("FIC-211", samples(1, 20))
    assert again.read("FIC-211").pv.tolist() == [1, 20]


@pytest.mark.parametrize("hint", [None, b"", b"{}", b'{"version":"x"}', b"7"])
def test_a_torn_checkpoint_is_set_aside_and_the_entries_tell_all(
    folder: Path, hint: bytes | None
) -> None:
    store = SampleStore(folder)
    store.write("FIC-211", samples(1, 2))
    SampleLog(folder).checkpoint()
    (checkpoint,) = (folder / "_delta_log").glob("*.checkpoint.parquet")
    checkpoint.write_bytes(checkpoint.read_bytes()[:100])
    if hint is not None:
        (folder / "_delta_log" / "_last_checkpoint").write_bytes(hint)
    assert SampleStore(folder).read("FIC-211").pv.tolist() == [1, 2]
    assert not checkpoint.exists()


def test_what_is_whole_is_left_alone(folder: Path) -> None:
    SampleStore(folder).write("FIC-211", samples(1.0))
    SampleLog(folder).checkpoint()
    assert set_aside_torn_entries(folder / "_delta_log") == []


def test_a_log_torn_in_the_middle_is_refused_in_words(folder: Path) -> None:
    store = SampleStore(folder)
    store.write("FIC-211", samples(1.0))
    store.write("FIC-211", samples(2.0))
    entry(folder, 1).write_bytes(b'{"add"')
    with pytest.raises(StoreDamaged, match="The sample store cannot be read: ") as refusal:
        SampleStore(folder)
    assert "\n" not in refusal.value.reason
    entry(folder, 2).write_bytes(b'{"add"')
    with pytest.raises(StoreDamaged):
        SampleStore(folder)


def test_a_folder_that_cannot_become_a_table_is_refused_in_words(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise DeltaError("no luck")

    monkeypatch.setattr(DeltaTable, "create", fails)
    with pytest.raises(StoreDamaged):
        SampleStore(folder)


def test_a_folder_made_by_another_process_at_the_same_moment_is_used(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    really = DeltaTable.create

    def made_by_both(*arguments: object, **options: object) -> None:
        really(*arguments, **options)
        really(*arguments, **options)

    monkeypatch.setattr(DeltaTable, "create", made_by_both)
    store = SampleStore(folder)
    store.write("FIC-211", samples(1.0))
    assert store.read("FIC-211").pv.tolist() == [1.0]


def test_rows_that_vanish_while_they_wait_are_an_error_not_a_short_upload(tmp_path: Path) -> None:
    rows = np.zeros(10, ROW)
    with Spool(tmp_path, in_memory=5) as spool:
        spool.add(rows)
        (day,) = spool.days()
        (waiting,) = tmp_path.glob("*/*")
        waiting.write_bytes(waiting.read_bytes()[:-7])
        with pytest.raises(OSError, match="that waited for their merge are gone"):
            spool.of_day(day)
