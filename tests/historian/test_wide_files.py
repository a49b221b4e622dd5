"""Wide files in all their variants, and what the user may state about them."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest

from historian.csv_file import decide
from historian.errors import AmbiguousColumns, ColumnNotFound, ExportRefused
from historian.export import Export
from historian.options import Columns, Layout, ReadOptions
from loop.record import Mode

Read: TypeAlias = Callable[..., Export]
NAN = float("nan")


def test_columns_that_share_a_name_keep_their_numbers(read: Read) -> None:
    export = read("time,Flow (m3/h),Flow (%),Flow (m3/h)\n0,1,2,3\n1,4,5,6\n")
    assert list(export.signals) == ["Flow (m3/h)", "Flow (%)", "Flow (m3/h) (column 4)"]
    record = read("time,X,X\n0,1,2\n1,3,4\n", columns=Columns(pv=2, op=3), tag="loop").record(
        "loop"
    )
    assert (record.pv.tolist(), record.op.tolist()) == ([1, 3], [2, 4])


def test_parts_are_named_by_heading_number_or_without_case(read: Read) -> None:
    text = "time,T (degC),Q,S,M\n0,1,2,3,MAN\n1,4,5,6,AUTO\n"
    for columns in (
        Columns(pv="T (degC)", op="Q", sp="S", mode="M"),
        Columns(pv="t", op="q", sp="s", mode="m"),
        Columns(pv=2, op="3", sp=4, mode=5),
    ):
        record = read(text, columns=columns).record()
        assert record.pv.tolist() == [1, 4]
        assert record.op.tolist() == [2, 5]
        assert record.sp is not None
        assert record.sp.tolist() == [3, 6]
        assert record.mode is not None
        assert record.mode.tolist() == [Mode.MAN, Mode.AUTO]
        assert record.pv_unit == "degC"


def test_a_stated_part_joins_those_that_are_found(read: Read) -> None:
    text = "time,FT7,FIC7.SP,FIC7.OP\n0,1,2,3\n1,4,5,6\n"
    record = read(text, columns=Columns(pv="FT7")).record()
    assert record.sp is not None
    assert (record.sp.tolist(), record.op.tolist()) == ([2, 5], [3, 6])


@pytest.mark.parametrize(
    ("columns", "sentence"),
    [
        (Columns(pv="absent", op="op"), "no column named 'absent'"),
        (Columns(pv=9, op="op"), "no column number 9"),
        (Columns(time="absent"), "no column named 'absent'"),
        (Columns(pv="X"), "the op; name it"),
    ],
)
def test_columns_that_are_not_there_are_listed(read: Read, columns: Columns, sentence: str) -> None:
    with pytest.raises(ColumnNotFound, match=sentence):
        read("time,X,op2\n0,1,2\n1,3,4\n", columns=columns).record()


def test_names_that_differ_in_case_only_are_ambiguous(read: Read) -> None:
    with pytest.raises(AmbiguousColumns, match="state the column by its number"):
        read("time,Temp,TEMP\n0,1,2\n1,3,4\n", columns=Columns(pv="temp"))


def test_text_columns_and_counters_are_named_and_not_read(read: Read) -> None:
    export = read("No,time,pv,op,Remark\n1,0,1,2,start\n2,1,3,4,end\n")
    words = " ".join(export.decisions.words)
    assert "column 'No' is not read: it counts the rows" in words
    assert "column 'Remark' is not read: it holds text" in words
    assert list(export.signals) == ["pv", "op"]


def test_quality_columns_of_a_wide_file(read: Read) -> None:
    text = (
        "time,X.PV,X.PV.Quality,X.OP,X.OP Status\n"
        "0,1,192,2,192\n1,3,0,4,192\n2,5,192,6,64\n3,7,192,8,216\n"
    )
    record = read(text).record()
    assert np.array_equal(record.pv, [1, NAN, 5, 7], equal_nan=True)
    assert np.array_equal(record.op, [2, 4, NAN, 8], equal_nan=True)


def test_quality_columns_can_be_stated(read: Read) -> None:
    text = "0,1,A,2,A\n1,3,B,4,A\n2,5,A,6,\n"
    export = read(
        text,
        columns=Columns(time=1, pv=2, op=4, quality=(3, 5)),
        good_quality=frozenset({"A"}),
    )
    assert np.array_equal(export.record().pv, [1, NAN, 5], equal_nan=True)
    assert np.array_equal(export.record().op, [2, 4, NAN], equal_nan=True)


def test_quality_codes_that_do_not_tell_are_refused(read: Read) -> None:
    text = "time,X.PV,Status,X.OP\n0,1,0,2\n1,3,1,4\n"
    with pytest.raises(ExportRefused, match=r"'Status': The quality codes \(0, 1\) do not tell"):
        read(text)
    export = read(text, good_quality=frozenset({"0"}))
    assert np.array_equal(export.record().pv, [1, NAN], equal_nan=True)


def test_unknown_quality_is_rejected_with_its_line(read: Read) -> None:
    rows = "".join(f"{k},1,Good,2\n" for k in range(250))
    export = read(f"time,X.PV,Quality,X.OP\n{rows}250,3,Purple,4\n251,5,,6\n252,,,7\n")
    assert [(r.line, r.reason) for r in export.accounting.rejections] == [
        (252, "its quality is not known"),
        (253, "no quality is stated"),
    ]


def test_header_and_first_line_can_be_stated(read: Read) -> None:
    text = "1,2,3\na,b,c\ntime,pv,op\n0,1,2\n1,3,4\n"
    export = read(text, header_line=2, first_line=5, columns=Columns(time="a", pv="b", op="c"))
    assert export.record().pv.tolist() == [3]
    with pytest.raises(ExportRefused, match="Line 99: There is no heading there"):
        read(text, header_line=99)
    export = read("5,6,7\n6,1,2\n7,3,4\n", header_line=0, columns=Columns(pv=2, op=3))
    assert export.record().pv.tolist() == [6, 1, 3]


def test_names_may_stand_in_a_comment(read: Read) -> None:
    record = read("# made by a script\n# time, pv, op\n0, 1, 2\n1, 3, 4\n").record()
    assert record.pv.tolist() == [1, 3]
    with pytest.raises(ColumnNotFound):
        read("# made by a script\n0, 1, 2\n1, 3, 4\n").record()
    with pytest.raises(ColumnNotFound):
        read("# time, pv, op\nplain words\n0, 1, 2\n1, 3, 4\n2, 5, 6\n").record()


def test_rows_with_trailing_separators(read: Read) -> None:
    export = read('time,pv,op\n0,1,2\n1,3,4,,\n2,"5",6,\n')
    assert export.record().pv.tolist() == [1, 3, 5]


def test_a_quoted_cell_may_hold_the_separator(read: Read) -> None:
    export = read('time,pv,op,Remark\n0,1,2,"a,b"\n1,3,4,"say ""x"""\n2,5,6,"c"\n')
    assert export.record().pv.tolist() == [1, 3, 5]


def test_the_layout_can_be_stated(read: Read) -> None:
    text = "Time,Name,pv,op\n2024-02-01 10:00,a,1,2\n2024-02-01 10:01,a,3,4\n"
    assert read(text, layout=Layout.WIDE).record().pv.tolist() == [1, 3]
    with pytest.raises(AmbiguousColumns, match="the value"):
        read(text)
    with pytest.raises(ColumnNotFound, match="the tag"):
        read("Time,pv,op\n2024-02-01 10:00,1,2\n2024-02-01 10:01,3,4\n", layout=Layout.LONG)
    with pytest.raises(ColumnNotFound, match="the times of pairs"):
        read("a,b\n1,2\n2,3\n", layout=Layout.PAIRS)


def test_one_value_is_named_by_its_file(read: Read) -> None:
    assert list(read("2024-02-01,1\n2024-02-02,2\n", "FIC101.PV.csv").signals) == ["FIC101.PV"]


def test_a_wide_file_of_only_text_has_no_value(read: Read) -> None:
    with pytest.raises(ColumnNotFound, match="a value"):
        read("Time,Remark\n2024-02-01,start\n2024-02-02,end\n")


def test_decisions_say_what_why_and_where(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text("Time;X.PV;X.OP\n2024-02-01 10:00:00;1,5;2\n", encoding="utf-8")
    assert decide(path, options=ReadOptions(time_zone="Europe/Paris")).words == (
        "container: plain",
        "encoding: UTF-8",
        "separator: semicolon",
        "decimal mark: comma, digits grouped by nothing",
        "layout: wide: a row is one instant",
        "headings: line 1, first sample: line 2",
        "time: column 'Time', year, month, day, in digits (first: '2024-02-01 10:00:00')",
        "time zone: Europe/Paris, as stated",
    )


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"time_format": "YYYY"}, "time_format must be one of Y/M/D"),
        ({"decimal": "_"}, "decimal must be"),
        ({"delimiter": "::"}, "delimiter must be one ASCII character"),
        ({"delimiter": ",", "decimal": ","}, "delimiter and decimal must differ"),
        ({"max_bytes": 0}, "max_bytes must be positive"),
        ({"first_line": 0}, "first_line counts from 1"),
        ({"header_line": -1}, "header_line counts from 1"),
    ],
)
def test_options_that_cannot_be_are_refused(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        ReadOptions(**options)
