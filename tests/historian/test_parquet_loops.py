"""Parquet files without the service: what is a loop in them, and what is refused."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from deltalake import DeltaTable

from historian.errors import ExportRefused
from historian.parquet_loops import loops_in, parquet_files
from historian.sample_store import SampleStore
from historian.samples import Samples
from loop.record import Mode

STAMPS = [datetime(2026, 1, 31, 8, minute, tzinfo=UTC) for minute in range(3)]


def written(folder: Path, **columns: Sequence[object]) -> Path:
    file = folder / "FIC-101.parquet"
    stamps = pa.array(columns.pop("time", STAMPS), pa.timestamp("ms", "Europe/Berlin"))
    pq.write_table(pa.table({"Time": stamps, **columns}), file)
    return file


def test_a_file_without_loop_names_is_one_loop_called_as_the_file(tmp_path: Path) -> None:
    file = written(tmp_path, PV=[1.0, None, 3.0], op=[1, 2, 3], SP=[2.0, 2.0, 2.0])
    ((name, samples),) = loops_in(file)

    assert name == "FIC-101"
    assert samples.time.tolist() == [stamp.replace(tzinfo=None) for stamp in STAMPS]
    np.testing.assert_array_equal(samples.pv, [1.0, np.nan, 3.0])
    np.testing.assert_array_equal(samples.op, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(samples.sp, [2.0, 2.0, 2.0])
    assert set(samples.mode.tolist()) == {int(Mode.UNKNOWN)}


def test_rows_are_put_in_order_and_the_later_of_two_counts(tmp_path: Path) -> None:
    file = written(
        tmp_path,
        time=[STAMPS[1], STAMPS[0], STAMPS[1], None],
        pv=[1.0, 2.0, 3.0, 4.0],
        op=[0.0] * 4,
        mode=["auto", "MAN", "cas ", "AUTO"],
    )
    ((_, samples),) = loops_in(file)

    assert samples.pv.tolist() == [2.0, 3.0]
    assert samples.mode.tolist() == [Mode.MAN, Mode.CAS]


def test_a_column_of_names_makes_many_loops(tmp_path: Path) -> None:
    file = written(tmp_path, tag=["A", "B", "A"], pv=[1.0, 2.0, 3.0], mv=[0.0] * 3)

    assert {name: samples.pv.tolist() for name, samples in loops_in(file)} == {
        "A": [1.0, 3.0],
        "B": [2.0],
    }


def test_mode_numbers_mean_what_is_stated_and_nothing_else(tmp_path: Path) -> None:
    file = written(tmp_path, pv=[1.0] * 3, op=[1.0] * 3, mode=[1, 2, 1])

    ((_, samples),) = loops_in(file, mode_codes={1: Mode.MAN, 2: Mode.AUTO})
    assert samples.mode.tolist() == [Mode.MAN, Mode.AUTO, Mode.MAN]
    with pytest.raises(ExportRefused, match="mode codes 1, 2; state what they mean"):
        list(loops_in(file))


def test_the_sample_stores_own_files_read_back(tmp_path: Path) -> None:
    samples = Samples(
        time=np.array(["2026-01-31T08:00", "2026-01-31T08:01"], "datetime64[us]"),
        pv=np.array([1.0, 2.0]),
        sp=np.array([np.nan, 5.0]),
        op=np.array([3.0, np.nan]),
        mode=np.array([1, -1], np.int8),
    )
    SampleStore(tmp_path / "store").write("TIC-7", samples)

    (file,) = parquet_files(tmp_path)
    ((name, again),) = loops_in(file)
    assert name == "TIC-7"
    for signal in ("time", "pv", "sp", "op", "mode"):
        np.testing.assert_array_equal(getattr(again, signal), getattr(samples, signal))


@pytest.mark.parametrize(
    ("columns", "sentence"),
    [
        ({"pv": [1.0] * 3}, "no column op; it has Time, pv"),
        ({"pv": ["a", "b", "c"], "op": [1.0] * 3}, "Column pv of FIC-101.parquet does not hold"),
    ],
)
def test_what_is_missing_or_no_number_is_said(
    tmp_path: Path, columns: dict[str, list[object]], sentence: str
) -> None:
    with pytest.raises(ExportRefused, match=sentence):
        list(loops_in(written(tmp_path, **columns)))


def test_times_must_say_their_zone(tmp_path: Path) -> None:
    file = tmp_path / "a.parquet"
    naive = pa.array([stamp.replace(tzinfo=None) for stamp in STAMPS], pa.timestamp("us"))
    pq.write_table(pa.table({"time": naive, "pv": [1.0] * 3, "op": [1.0] * 3}), file)

    with pytest.raises(ExportRefused, match="timestamps with a time zone"):
        list(loops_in(file))


def test_a_folder_without_files_and_a_file_that_is_none_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ExportRefused, match="There is no Parquet file below"):
        parquet_files(tmp_path)
    (tmp_path / "broken.parquet").write_bytes(b"PAR1 not")
    with pytest.raises(ExportRefused, match=r"broken.parquet cannot be read as Parquet"):
        list(loops_in(parquet_files(tmp_path)[0]))


def test_of_a_delta_table_only_the_files_that_count_are_read(tmp_path: Path) -> None:
    store = SampleStore(tmp_path / "store")
    for value in (1.0, 2.0):  # the second upload replaces the first
        store.write(
            "TIC-101",
            Samples(
                time=np.datetime64("2026-01-31T00:00", "us")
                + np.arange(3).astype("timedelta64[m]"),
                pv=np.full(3, value),
                sp=np.full(3, 1.0),
                op=np.full(3, 1.0),
                mode=np.ones(3, np.int8),
            ),
        )
    DeltaTable(tmp_path / "store").create_checkpoint()  # Parquet as well, and no data

    for folder in (tmp_path, tmp_path / "store"):
        (file,) = parquet_files(folder)
    ((_, samples),) = loops_in(file)
    assert samples.pv.tolist() == [2.0, 2.0, 2.0]


@pytest.mark.parametrize("column", ["pv", "mode", "loop"])
@pytest.mark.parametrize("cell", [[1], {"a": 1}])
def test_columns_of_lists_and_structures_are_refused_by_name(
    tmp_path: Path, column: str, cell: object
) -> None:
    stamps = pa.array(np.arange(2).astype("datetime64[us]"), pa.timestamp("us", "UTC"))
    columns = {"time": stamps, "pv": pa.array([1.0, 2.0]), "op": pa.array([1.0, 2.0])}
    file = tmp_path / "x.parquet"
    pq.write_table(pa.table(columns | {column: pa.array([cell, cell])}), file)
    with pytest.raises(ExportRefused, match=f"Column {column} of x.parquet"):
        list(loops_in(file))
