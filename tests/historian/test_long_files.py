"""Long files: a row is one sample of one tag."""

from collections.abc import Callable
from typing import TypeAlias

import pytest

from historian.errors import AmbiguousColumns, ExportRefused
from historian.export import Export
from historian.options import Columns
from loop.record import Mode

Read: TypeAlias = Callable[..., Export]
NAN = float("nan")


LONG = "Tag;Time;Value;Quality\n"


def test_modes_in_a_long_file_are_words_or_stated_codes(read: Read) -> None:
    rows = "".join(
        f"X.PV;2024-02-01 10:00:{k:02d};{k};Good\nX.OP;2024-02-01 10:00:{k:02d};5;Good\n"
        f"X.MODE;2024-02-01 10:00:{k:02d};{mode};Good\n"
        for k, mode in enumerate(["AUTO", "MAN", "1", "7", "", "Bad"])
    )
    export = read(LONG + rows, mode_codes={1: Mode.CAS})
    mode = export.record().mode
    assert mode is not None
    assert mode.tolist() == [
        Mode.AUTO, Mode.MAN, Mode.CAS, Mode.UNKNOWN, Mode.UNKNOWN, Mode.UNKNOWN,
    ]  # fmt: skip
    assert any("mode '7' (1 rows)" in words for words in export.decisions.words)
    assert export.accounting.rejected_cells == 0
    stated = read(LONG + rows, columns=Columns(pv="X.PV", op="X.OP", mode="x.mode"))
    assert stated.record().mode is not None


def test_a_long_file_rejects_by_tag(read: Read) -> None:
    text = LONG + (
        "X.PV;2024-02-01 10:00:00;1;Good\n"
        "X.OP;2024-02-01 10:00:00;2;Good\n"
        "X.PV;yesterday;3;Good\n"
        "X.PV;;3;Good\n"
        ";2024-02-01 10:00:10;4;Good\n"
        "X.PV;2024-02-01 10:00:10;Kaputt;Good\n"
        "X.OP;2024-02-01 10:00:10;Bad;Good\n"
        "X.OP;2024-02-01 10:00:20;;Good\n"
        "Tag;Time;Value;Quality\n"
        "X.PV;2024-02-01 10:00:20;7;Bad\n"
        "X.PV;2024-02-01 10:00:20;1;2;3;4\n"
    )
    export = read(text)
    assert [(r.line, r.column, r.reason) for r in export.accounting.rejections] == [
        (4, "X.PV", "the time is not in the format of the file"),
        (5, "X.PV", "there is no time"),
        (6, "", "there is no tag"),
        (7, "X.PV", "it is no number and no known word for a missing value"),
        (12, "", "it has 6 columns instead of 4"),
    ]
    account = export.loops["X"].accounting
    assert (account.rows_read, account.rows_kept, account.rows_rejected) == (8, 6, 2)
    assert account.gap_words == {"Bad": 1, "quality Bad": 1}
    assert account.empty_cells == 1
    whole = export.accounting
    assert (whole.rows_read, whole.rows_kept, whole.rows_rejected) == (10, 6, 4)
    assert any("1 repeated headings" in words for words in export.decisions.words)


def test_columns_of_a_long_file_can_be_stated(read: Read) -> None:
    text = "a,b,c,d,e\nX.PV,2024-02-01,1,9,ok\nX.OP,2024-02-01,2,9,ok\n"
    columns = Columns(tag="a", time="b", value="c", quality="e")
    assert read(text, columns=columns).record().pv.tolist() == [1]
    columns = Columns(tag=1, time=2, value=3, quality=(5,))
    assert read(text, columns=columns).record().op.tolist() == [2]
    with pytest.raises(ExportRefused, match="one quality column"):
        read(text, columns=Columns(tag=1, time=2, value=3, quality=(4, 5)))
    with pytest.raises(AmbiguousColumns, match="the value"):
        read(text, columns=Columns(tag=1, time=2))


def test_a_column_of_many_words_is_no_tag(read: Read) -> None:
    rows = "".join(f"n{k},{k},1\n" for k in range(33_000))
    with pytest.raises(ExportRefused, match="'Tag': The tag column holds more than 32,000"):
        read("Tag,time,Value\n" + rows)


def test_a_long_file_with_a_mode_tag_only(read: Read) -> None:
    export = read("Tag,Time,Value\nX.MODE,2024-02-01,AUTO\nX.MODE,2024-02-02,MAN\n")
    assert export.signals["X.MODE"].value.tolist() == [Mode.AUTO, Mode.MAN]
    assert export.signals["X.MODE"].is_mode


def test_elapsed_times_of_a_long_file_with_decimal_comma(read: Read) -> None:
    export = read("Tag;t_s;Value\nX.PV;0,5;1,25\nX.OP;0,5;2\nX.PV;1,5;x\nX.OP;y;2\n")
    assert export.record().t.tolist() == [0.5, 1.5]
