"""The time of an export: stamps, split, elapsed, epochs, day numbers."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest

from historian.csv_file import read_export
from historian.errors import AmbiguousColumns, ColumnNotFound, ExportRefused
from historian.export import Export
from historian.options import Columns

Read: TypeAlias = Callable[..., Export]
NAN = float("nan")


def seconds(export: Export, tag: str) -> list[str]:
    return [str(stamp)[-8:] for stamp in export.signals[tag].time.astype("datetime64[s]")]


def test_dates_of_a_spreadsheet_with_empty_clock_join_the_time_of_day(read: Read) -> None:
    export = read(
        "Date,Time,pv,op\n2024-02-01 00:00:00,10:00:00,1,2\n2024-02-01 00:00:00,10:00:10,3,4\n"
    )
    assert export.decisions.time_columns == ("Date", "Time")
    assert seconds(export, "pv") == ["10:00:00", "10:00:10"]


def test_split_date_and_time_can_be_stated(read: Read) -> None:
    text = "a,b,pv,op\n2024-02-01,10:00:00.250,1,2\n2024-02-01,10:00:10.250,3,4\n"
    export = read(text, columns=Columns(date="a", time=2))
    assert str(export.signals["pv"].time[0]) == "2024-02-01T10:00:00.250000000"


def test_milliseconds_beside_a_split_time(read: Read) -> None:
    export = read(
        "Date,Time,ms,pv,op\n2024-02-01,10:00:00,250,1,2\n2024-02-01,10:00:00,750,3,4\n"
        "2024-02-01,10:00:01,1750,3,4\n"
    )
    assert export.record().t.tolist()[:2] == [0, 0.5]


def test_impossible_milliseconds_reject_the_row(read: Read) -> None:
    rows = "".join(f"2024-02-01 10:00:{k % 60:02d},5,1,2\n" for k in range(250))
    export = read(f"Time,ms,pv,op\n{rows}2024-02-01 11:00:00,1750,3,4\n")
    assert export.accounting.rows_rejected == 1


def test_a_date_alone_is_midnight(read: Read) -> None:
    export = read("Date,pv,op\n2024-02-01,1,2\n2024-02-02,3,4\n")
    assert export.record().t.tolist() == [0, 86400]


def test_times_of_day_without_a_date_are_elapsed(read: Read) -> None:
    export = read("Time,pv,op\n10:00:00,1,2\n10:00:10.5,3,4\n")
    assert export.record().t.tolist() == [36_000, 36_010.5]
    assert export.record().start is None
    assert export.decisions.time_format == "clock"


def test_times_of_day_that_pass_midnight_are_refused(read: Read) -> None:
    with pytest.raises(ExportRefused, match="Line 3: The time of day runs backwards"):
        read("Time,pv,op\n23:59:50,1,2\n00:00:00,3,4\n")


@pytest.mark.parametrize(
    ("heading", "factor"),
    [
        ("t_s", 1), ("Time (sec)", 1), ("time", 1), ("elapsed_ms", 1e-3), ("Time [min]", 60),
        ("t_h", 3600), ("time (days)", 86400), ("t (s)", 1), ("Elapsed Seconds", 1),
    ],
)  # fmt: skip
def test_elapsed_time_goes_by_the_unit_in_the_heading(
    read: Read, heading: str, factor: float
) -> None:
    export = read(f"{heading},pv,op\n0,1,2\n1.5,3,4\n3,3,4\n")
    assert export.record().t.tolist() == [0, 1.5 * factor, 3 * factor]
    assert export.time_zone is None


def test_the_unit_of_elapsed_time_can_be_stated(read: Read) -> None:
    export = read("time,pv,op\n0,1,2\n2,3,4\n", time_format="elapsed_min")
    assert export.record().t.tolist() == [0, 120]


def test_epoch_seconds_with_fractions_and_words(read: Read) -> None:
    rows = "".join(f"{1706781600.25 + k / 2},1,2\n" for k in range(20))
    export = read(f"time,pv,op\n{rows}x,5,6\n1e30,7,8\n")
    assert export.record().t.tolist() == [k / 2 for k in range(20)]
    assert [r.line for r in export.accounting.rejections] == [22, 23]


@pytest.mark.parametrize(("unit", "factor"), [("epoch_us", 10**6), ("epoch_ns", 10**9)])
def test_epochs_in_small_units_are_exact(read: Read, unit: str, factor: int) -> None:
    first = 1_706_781_600 * factor + 1
    export = read(f"t_stamp,pv,op\n{first},1,2\n{first + 1},3,4\n")
    assert export.decisions.time_format == unit
    ticks = export.signals["pv"].time.astype("datetime64[ns]").astype(np.int64)
    assert np.diff(ticks).tolist() == [10**9 // factor]


def test_excel_days_are_local_time_of_a_stated_zone(read: Read) -> None:
    export = read("time,pv,op\n45323.5,1,2\n45323.75,3,4\nx,1,2\n", time_zone="America/New_York")
    assert str(export.record().start) == "2024-02-01 17:00:00+00:00"


def test_day_like_numbers_under_a_heading_in_seconds_stay_seconds(read: Read) -> None:
    assert read("t_s,pv,op\n45323.5,1,2\n45323.75,3,4\n").record().t.tolist() == [
        45323.5,
        45323.75,
    ]


def test_compact_stamps(read: Read) -> None:
    export = read("Time,pv,op\n20240201100000,1,2\n20240201100010,3,4\n")
    assert seconds(export, "pv") == ["10:00:00", "10:00:10"]
    export = read("Time,pv,op\n20240201,1,2\n20240202,3,4\n")
    assert export.record().t.tolist() == [0, 86400]


def test_a_stated_numeric_time_refuses_stamps(read: Read) -> None:
    with pytest.raises(ExportRefused, match="not in the format of the file"):
        read("Time,pv,op\n2024-02-01,1,2\n2024-02-02,3,4\n", time_format="elapsed_s")


def test_stamps_in_other_places_are_named_and_not_read(read: Read) -> None:
    text = "Time,pv,op,Checked\n2024-02-01 10:00,1,2,2024-03-01 08:00\n"
    with pytest.raises(AmbiguousColumns, match=r"columns\.time.*Time, Checked"):
        read(text)
    export = read(text, columns=Columns(time="Time"))
    assert ("'Checked' is not read: another column is the time") in " ".join(export.decisions.words)


def test_two_numeric_times_are_ambiguous(read: Read) -> None:
    with pytest.raises(AmbiguousColumns, match="time, seconds"):
        read("time,seconds,pv,op\n0,0,1,2\n1,1,3,4\n")


def test_without_any_time_the_columns_are_listed(read: Read) -> None:
    with pytest.raises(ColumnNotFound, match=r"the time.*Level, Valve"):
        read("Level,Valve\n3,2\n1,5\n2,4\n")
    with pytest.raises(ColumnNotFound):
        read("X.PV,X.OP\n1,2\n2,5\n3,4\n")


def test_a_single_numeric_row_is_taken_as_it_is(read: Read) -> None:
    assert read("time,pv,op\n0,1,2\n").record().t.tolist() == [0]


def test_stamps_of_two_orders_are_refused(read: Read) -> None:
    with pytest.raises(ExportRefused, match="fit no single order"):
        read("Time,pv,op\n13/04/2024 10:00,1,2\n04/13/2024 10:00,3,4\n")


def test_stamps_that_contradict_each_other_late_are_refused(tmp_path: Path) -> None:
    rows = [f"03/04/2024 {k // 3600:02d}:{k // 60 % 60:02d}:{k % 60:02d},1,2" for k in range(9000)]
    path = tmp_path / "export.csv"
    path.write_text("\n".join(["Time,pv,op", *rows, "13/13/2024 10:00:00,1,2", ""]))
    with pytest.raises(ExportRefused, match="fit no single order"):
        read_export(path)


def test_damaged_lines_do_not_stop_the_search_for_the_order(tmp_path: Path) -> None:
    rows = [f"03/04/2024 {k // 3600:02d}:{k // 60 % 60:02d}:{k % 60:02d},1,2" for k in range(9000)]
    path = tmp_path / "export.csv"
    path.write_text("\n".join(["Time,pv,op", *rows, "x", "13/04/2024 10:00:00,1,2", ""]))
    assert str(read_export(path).signals["pv"].time[0])[:10] == "2024-04-03"
