"""Whole files: what a user exports is what a user gets."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from historian.csv_file import decide, read_export
from historian.errors import ColumnNotFound
from historian.options import Columns, Layout, ReadOptions
from loop.record import Mode


def written(folder: Path, text: str, name: str = "export.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode())
    return path


def test_elapsed_seconds_with_bare_names_make_a_record(tmp_path: Path) -> None:
    path = written(tmp_path, "time,pv,op\n0,20,50\n1.5,20.5,50\n3,21.25,55\n")
    record = read_export(path).record()
    assert record.t.tolist() == [0.0, 1.5, 3.0]
    assert record.pv.tolist() == [20.0, 20.5, 21.25]
    assert record.op.tolist() == [50.0, 50.0, 55.0]
    assert record.start is None
    assert record.sp is None


def test_stamps_with_an_offset_start_in_utc(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "Time,TIC7.PV (degC),TIC7.SP,TIC7.OP (%),TIC7.MODE\n"
        "2024-03-01T10:00:00+01:00,80.5,81,40,MAN\n"
        "2024-03-01T10:00:10+01:00,80.6,81,42,AUTO\n",
    )
    export = read_export(path)
    record = export.record()
    assert record.start == datetime(2024, 3, 1, 9, tzinfo=UTC)
    assert record.t.tolist() == [0.0, 10.0]
    assert record.mode is not None
    assert record.mode.tolist() == [Mode.MAN, Mode.AUTO]
    assert (record.tag, record.pv_unit, record.op_unit) == ("TIC7", "degC", "%")
    assert export.time_zone == "UTC"


def test_columns_can_be_named_by_the_user(tmp_path: Path) -> None:
    path = written(tmp_path, "t_s,T1,Q1\n0,23.0,10\n0.25,24.5,10\n")
    with pytest.raises(ColumnNotFound, match=r"pv=\.\.\. and op=.*T1, Q1"):
        read_export(path).record()
    record = read_export(path, options=ReadOptions(columns=Columns(pv="T1", op=3))).record()
    assert record.pv.tolist() == [23.0, 24.5]
    assert record.op.tolist() == [10.0, 10.0]


def test_decisions_are_stated_without_reading_the_whole_file(tmp_path: Path) -> None:
    path = written(tmp_path, "time;pv;op\n0;20,5;50\n1;20,25;50,5\n")
    decisions = decide(path)
    assert decisions.delimiter == ";"
    assert decisions.decimal == ","
    assert decisions.layout is Layout.WIDE
    assert np.array_equal(read_export(path).record().pv, [20.5, 20.25])
