"""The table on disk: an open format in the layout that was measured best."""

import itertools
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from deltalake import DeltaTable, QueryBuilder

from historian.sample_layout import (
    BUCKETS,
    FILE_SCHEMA,
    ROWS_A_GROUP,
    bucket_of,
    day_of,
    loops_apart,
    tables_of,
    write_file,
)
from historian.sample_log import SampleLog
from historian.sample_reading import read_loop, rows_in
from historian.sample_rows import ROW, Rows
from historian.sample_store import SampleStore
from historian.samples import Samples


def rows(n: int, *, first: int = 0, step: int = 1_000_000, pv: float = 1.0) -> Rows:
    made = np.zeros(n, ROW)
    made["time"] = first + step * np.arange(n)
    made["pv"] = pv
    made["sp"] = np.nan
    made["mode"] = -1
    return made


def day_long(pv: float = 1.0, *, n: int = 100, day: str = "2026-01-01") -> Samples:
    return Samples(
        time=np.datetime64(day, "us") + np.arange(n).astype("timedelta64[s]"),
        pv=np.full(n, pv),
        sp=np.full(n, np.nan),
        op=np.zeros(n),
        mode=np.full(n, -1, np.int8),
    )


def test_a_loop_is_in_the_same_bucket_for_ever() -> None:
    assert bucket_of("123456789") == 0xCBF43926 % 8  # the published check value of CRC-32
    # regression values: another answer would hide every sample stored so far
    assert [bucket_of(loop) for loop in ("FIC-211", "LIC-1", "Ä")] == [5, 6, 3]
    share = np.bincount([bucket_of(f"loop-{n}") for n in range(8000)], minlength=BUCKETS)
    assert share.min() > 800


def test_the_day_is_the_day_in_utc() -> None:
    for moment in (
        datetime(1970, 1, 1, tzinfo=UTC),
        datetime(2026, 3, 29, 23, 59, 59, 999_999, UTC),
    ):
        us = round((moment - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds() * 1e6)
        assert day_of(us) == moment.date()


def test_files_lie_by_date_and_bucket_sorted_and_packed_as_measured(tmp_path: Path) -> None:
    store = SampleStore(tmp_path / "s")
    store.write("FIC-211", day_long(n=86_400))
    (path,) = (tmp_path / "s").glob("date=2026-01-01/bucket=5/*.parquet")
    meta = pq.read_metadata(path)
    assert [meta.row_group(i).num_rows for i in range(meta.num_row_groups)] == [14_400] * 6
    columns = {meta.row_group(0).column(i).path_in_schema: i for i in range(meta.num_columns)}
    assert list(columns) == FILE_SCHEMA.names
    time = meta.row_group(0).column(columns["time"])
    assert "DELTA_BINARY_PACKED" in time.encodings
    assert all(meta.row_group(0).column(i).compression == "ZSTD" for i in columns.values())


def test_rows_become_full_row_groups_when_small_files_are_joined(tmp_path: Path) -> None:
    store = SampleStore(tmp_path / "s")
    loops = [loop for n in range(60) if bucket_of(loop := f"L{n:02d}") == 0]
    for loop in loops:
        store.write(loop, day_long(n=20_000))
    store.tidy(keep_hours=0)
    (path,) = (tmp_path / "s").glob("date=*/bucket=0/*.parquet")
    meta = pq.read_metadata(path)
    sizes = [meta.row_group(i).num_rows for i in range(meta.num_row_groups)]
    assert sum(sizes) == 20_000 * len(loops)
    assert set(sizes[:-1]) == {ROWS_A_GROUP}
    table = pq.read_table(path, partitioning=None)
    assert table.column("loop").to_pylist()[::20_000] == sorted(loops)


def test_rounded_values_get_a_dictionary_and_full_precision_none(tmp_path: Path) -> None:
    exact = np.random.default_rng(1).standard_normal(20_000) * 1e-3 + 50
    sizes = []
    for n, pv in enumerate((np.round(exact, 4), exact)):
        made = rows(exact.size)
        made["pv"] = pv
        file = write_file(tmp_path, date(1970, 1, 1), n, tables_of("L1", made))
        first = pq.read_metadata(tmp_path / file.path).row_group(0).column(3)
        assert ("RLE_DICTIONARY" in first.encodings) == (n == 0)
        back = rows_in(read_loop(tmp_path, file, "L1"))
        assert back["pv"].tobytes() == pv.tobytes()  # to the last bit
        sizes.append(file.size)
    assert sizes[0] < sizes[1] / 3


def test_joined_files_hold_ranges_of_loops(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("historian.sample_tidy.ROWS_A_FILE", 300)
    store = SampleStore(tmp_path / "s")
    loops = [loop for n in range(60) if bucket_of(loop := f"L{n:02d}") == 0]
    for n, loop in enumerate([*loops[1::2], *loops[::2]]):
        store.write(loop, day_long(float(n), n=70 + 7 * (n % 5)))
    while store.tidy().joined:
        pass
    files = SampleLog(tmp_path / "s").files()
    assert len(files) == 3  # of eight loops, 640 rows
    assert [len(heap) for heap in loops_apart(files)] == [1, 1, 1]


def test_a_day_gives_each_loop_once_however_it_lies_in_files(tmp_path: Path) -> None:
    store = SampleStore(tmp_path / "s")
    loops = [loop for n in range(60) if bucket_of(loop := f"L{n:02d}") == 0]
    for loop in loops:
        store.write(loop, day_long(n=10))
    store.tidy()
    later = day_long(2.0, n=30)
    store.write(loops[3], later)  # ten instants change, twenty go into a file of their own
    day = list(store.read_day(date(2026, 1, 1)))
    assert sorted(loop for loop, _ in day) == loops
    for loop, found in day:
        assert len(found) == (30 if loop == loops[3] else 10)
        assert np.array_equal(found.pv, store.read(loop).pv)
        found.pv[:] = 0  # anybody's own
    assert store.read(loops[3]).pv.tolist() == [2.0] * 30


def test_any_delta_reader_sees_the_same_samples(tmp_path: Path) -> None:
    store = SampleStore(tmp_path / "s")
    store.write("FIC-211", day_long(3.0))
    store.write("FIC-211", day_long(4.0, n=10))
    query = "select count(*) as n, sum(pv) as pv, count(sp) as sp, min(time) as t from s"
    table = DeltaTable(tmp_path / "s")
    answer = QueryBuilder().register("s", table).execute(query).read_all()
    found = {name: answer[name][0].as_py() for name in ("n", "pv", "sp", "t")}
    start = datetime(2026, 1, 1, tzinfo=UTC)
    assert found == {"n": 100, "pv": 310.0, "sp": 0, "t": start}  # gaps are null, not NaN
    frame = table.to_pyarrow_table(filters=[("date", "=", date(2026, 1, 1))])
    assert frame.num_rows == 100


def test_files_that_another_program_joined_are_read_as_before(tmp_path: Path) -> None:
    store = SampleStore(tmp_path / "s")
    loops = [loop for n in range(60) if bucket_of(loop := f"L{n:02d}") == 0]
    for n, loop in enumerate(reversed(loops)):
        store.write(loop, day_long(float(n)))
    table = DeltaTable(tmp_path / "s")
    table.optimize.compact()  # joins files as they come, not sorted by loop
    assert len(table.file_uris()) == 1
    for n, loop in enumerate(reversed(loops)):
        assert set(store.read(loop).pv.tolist()) == {n}
        assert store.span(loop).rows == 100
    store.write(loops[0], day_long(77.0, n=50))
    assert store.read(loops[0]).pv.tolist()[::50] == [77.0, len(loops) - 1]
    assert store.read(loops[1]).pv.tolist()[::50] == [len(loops) - 2] * 2


def test_row_groups_without_statistics_are_searched(tmp_path: Path) -> None:
    file = write_file(tmp_path, date(1970, 1, 1), 0, tables_of("L1", rows(5)))
    bare = pq.read_table(tmp_path / file.path, partitioning=None)
    pq.write_table(bare, tmp_path / file.path, write_statistics=False)
    assert read_loop(tmp_path, file, "L1").num_rows == 5
    assert read_loop(tmp_path, file, "L2").num_rows == 0


def test_a_file_needs_rows(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least one row"):
        write_file(tmp_path, date(2026, 1, 1), 0, [])
    assert not list(tmp_path.rglob("*.parquet"))


def test_long_uploads_wait_on_disk_and_leave_nothing_behind(tmp_path: Path) -> None:
    store = SampleStore(tmp_path / "s")
    days = [f"2026-01-{day:02d}" for day in range(9, 0, -1)]
    chunks = itertools.chain(
        (day_long(1.0, n=80_000, day=day) for day in days),
        (day_long(2.0, n=10, day=day) for day in days),  # and back again over every day
    )
    seen: list[int] = []

    def watched() -> Iterator[Samples]:
        for chunk in chunks:
            yield chunk
            seen.append(len(list((tmp_path / "s" / "_staging").rglob("*"))))

    result = store.write("FIC-211", watched())
    assert max(seen) > 5
    assert (result.new, result.repeated) == (9 * 80_000, 9 * 10)
    assert not list((tmp_path / "s" / "_staging").iterdir())
    parts = [(len(part), part.pv[:11].tolist()) for part in store.read_in_parts("FIC-211")]
    assert parts == [(80_000, [2.0] * 10 + [1.0])] * 9


def test_the_store_works_without_pandas(tmp_path: Path) -> None:
    program = (
        "import sys; from datetime import date; from pathlib import Path; import numpy as np\n"
        "from historian.sample_store import SampleStore; from historian.samples import Samples\n"
        "gap = np.array([1.0, np.nan]); time = np.array([0, 60_000_000]).view('M8[us]')\n"
        "modes = np.array([-1, 1], np.int8); store = SampleStore(Path(sys.argv[1]))\n"
        "store.write('L', Samples(time=time, pv=gap, sp=gap, op=gap, mode=modes)); store.tidy()\n"
        "store.read('L'); store.span('L'); list(store.read_day(date(1970, 1, 1)))\n"
        "print('pandas' in sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\n"  # 45 MB and half a second of every process
