"""Paired files: a time column and a value column for every tag."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import pytest

from historian.errors import AmbiguousColumns, ExportRefused
from historian.export import Export
from historian.options import Columns, Layout
from loop.record import Mode

Read: TypeAlias = Callable[..., Export]
NAN = float("nan")


def test_pairs_named_in_the_time_heading_or_the_row_below(read: Read) -> None:
    rows = "2024-02-01 10:00,1,2024-02-01 10:00,5\n2024-02-01 10:01,3,2024-02-01 10:02,7\n"
    for head in (
        "X.PV Time,X.PV Value,X.OP Time,X.OP Value\n",
        "X.PV,,X.OP,\nTime,Value,Time,Value\n",
        "Time,X.PV (bar),Time,X.OP (%)\n",
        "Timestamp,Value,Timestamp,Value\nX.PV,,X.OP,\n",
    ):
        export = read(head + rows)
        assert list(export.signals) == ["X.PV", "X.OP"]
        assert np.array_equal(export.record().op, [5, 5], equal_nan=True)


def test_pairs_without_names_are_numbered(read: Read) -> None:
    export = read("2024-02-01 10:00,1,2024-02-01 10:00,5\n", columns=Columns(pv=2, op=4))
    assert list(export.signals) == ["column 2", "column 4"]
    assert export.record().op.tolist() == [5]


def test_pairs_with_quality_and_a_blank_column_between(read: Read) -> None:
    export = read(
        "Time,X.PV,Quality,,Time,X.OP,Quality\n"
        "2024-02-01 10:00,1,Good,,2024-02-01 10:00,5,Good\n"
        "2024-02-01 10:01,2,Bad,,2024-02-01 10:01,6,Good\n"
        ",,,,2024-02-01 10:02,7,Good\n"
        ",9,Good,,2024-02-01 10:03,8,Good\n"
    )
    assert np.array_equal(export.record().pv, [1, NAN], equal_nan=True)
    assert export.signals["X.OP"].value.tolist() == [5, 6, 7, 8]
    assert [(r.line, r.column, r.reason) for r in export.accounting.rejections] == [
        (5, "X.PV", "there is no time")
    ]


def test_pairs_of_elapsed_seconds(read: Read) -> None:
    export = read("time,X.PV,time,X.OP\n0,1,0.5,5\n1,2,1.5,6\n")
    assert export.decisions.layout is Layout.PAIRS
    assert np.array_equal(export.record().op, [NAN, 5], equal_nan=True)


def test_pairs_with_modes_hold_them(read: Read) -> None:
    export = read(
        "Time,X.PV,Time,X.OP,Time,X.MODE\n"
        "2024-02-01 10:00,1,2024-02-01 10:00,5,2024-02-01 10:01,AUTO\n"
        "2024-02-01 10:01,2,2024-02-01 10:01,6,,\n"
        "2024-02-01 10:02,3,2024-02-01 10:02,7,,\n"
    )
    mode = export.record().mode
    assert mode is not None
    assert mode.tolist() == [Mode.UNKNOWN, Mode.AUTO, Mode.AUTO]


def test_a_pair_with_two_values_or_none_is_not_guessed(read: Read) -> None:
    with pytest.raises(AmbiguousColumns, match="the value of one pair"):
        read("T1,a,b,T2,c\n2024-02-01 10:00,1,2,2024-02-01 10:00,3\n")
    export = read(
        "Time,X.PV,Time,X.OP,Time\n2024-02-01 10:00,1,2024-02-01 10:00,5,2024-02-01 10:00\n",
        layout=Layout.PAIRS,
    )
    assert "'Time (column 5)' is not read: no value stands beside it" in " ".join(
        export.decisions.words
    )


def test_tags_of_pairs_that_repeat_keep_their_columns(read: Read) -> None:
    export = read("Time,X,Time,X\n2024-02-01 10:00,1,2024-02-01 10:00,3\n")
    assert list(export.signals) == ["X", "X (column 4)"]


def test_a_loop_whose_pv_has_no_samples_is_no_record(read: Read) -> None:
    export = read("Time,X.PV,Time,X.OP\n2024-02-30 10:00,1,2024-02-01 10:00,5\n")
    with pytest.raises(ExportRefused, match="no samples with a time"):
        export.record()
    assert export.accounting.rejections[0].column == "X.PV"
    export = read(
        "Time,X.PV,Time,X.OP,Time,X.MODE\n"
        "2024-02-01 10:00,1,2024-02-30 10:00,5,2024-02-30 10:00,AUTO\n"
    )
    assert np.array_equal(export.record().op, [NAN], equal_nan=True)
    mode = export.record().mode
    assert mode is not None
    assert mode.tolist() == [Mode.UNKNOWN]
