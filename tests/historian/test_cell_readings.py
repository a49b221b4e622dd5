"""Single cells: numbers, words that are gaps, quality codes, modes and tags."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from historian.cell_kind import Kind, kind_of
from historian.csv_file import read_export
from historian.modes import is_mode_word, mode_of
from historian.numbers import NumberFormat, grouping_of, looks_numeric, without_denormals
from historian.options import ReadOptions
from historian.quality import (
    Scheme,
    bad_spellings,
    decide_scheme,
    is_bad_word,
    is_good,
    is_quality_word,
)
from historian.tag_map import Part, TagPart, group_by_loop, part_of, split_unit
from loop.record import Mode

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(finite)
def test_every_number_is_read_as_python_writes_it(value: float) -> None:
    assert NumberFormat().read(repr(value)) == value
    assert NumberFormat(",").read(repr(value).replace(".", ",")) == value
    assert NumberFormat().read(f" {value!r}\u00a0") == value


@given(st.integers(-(10**12), 10**12), st.sampled_from([",", ".", " ", "'"]))
def test_grouped_digits_are_read(value: int, mark: str) -> None:
    decimal = "," if mark == "." else "."
    text = f"{value:,}".replace(",", mark) + decimal + "5"
    expected = float(f"{value}.5")
    assert NumberFormat(decimal, mark).read(text) == expected
    if abs(value) >= 1000:
        assert grouping_of(text) == mark
        assert NumberFormat(decimal).read(text) is None


@pytest.mark.parametrize(
    "text",
    ["", "-", "1 2", "1,2,3", "0x10", "1e", "e5", "1_000", "nan", "inf", "١٢", "--5", "1.2.3"],
)
def test_what_is_no_number_is_not_read(text: str) -> None:
    assert NumberFormat().read(text) is None


def test_a_point_is_no_number_where_commas_mark_decimals() -> None:
    assert NumberFormat(",").read("1.5") is None
    assert NumberFormat(",", ".").read("1.500") == 1500


def test_typographic_signs_are_understood() -> None:
    assert NumberFormat(",", " ").read("−1\u202f234,5") == -1234.5
    assert looks_numeric("−5")
    assert NumberFormat(".", "'").read("1’234.5") == 1234.5


def test_denormals_are_zeroed_in_a_copy_only_where_needed() -> None:
    values = np.array([1.0, np.nan, -2.0])
    assert without_denormals(values)[0] is values
    zeros = np.array([0.0, 1.0])
    assert without_denormals(zeros) == (zeros, 0)
    changed, count = without_denormals(np.array([1e-40, -1e-300, 0.0, 1.0]))
    assert (changed.tolist(), count) == ([0, 0, 0, 1], 2)
    assert without_denormals(np.zeros(0))[1] == 0


@pytest.mark.parametrize(
    ("rows", "decimal", "thousands", "expected"),
    [
        (["1,234", "12.5"], ".", ",", [1234, 12.5]),
        (["1.234", "12,5"], ",", ".", [1234, 12.5]),
        (["1.234", "12.5"], ".", "", [1.234, 12.5]),
        (["0,234", "1,234"], ",", "", [0.234, 1.234]),
        (["1,234,567", "5"], ".", ",", [1_234_567, 5]),
        (["1.234.567", "5"], ",", ".", [1_234_567, 5]),
        (["1'234.5", "5"], ".", "'", [1234.5, 5]),
        (["1,5e3", "2"], ",", "", [1500, 2]),
        (["1,234.5", "1"], ".", ",", [1234.5, 1]),
        (["1.5", "2,5"], ",", "", [float("nan"), 2.5]),
        (["5", "7"], ".", "", [5, 7]),
    ],
)
def test_decimal_and_thousands_marks_are_decided(
    tmp_path: Path, rows: list[str], decimal: str, thousands: str, expected: list[float]
) -> None:
    path = tmp_path / "export.csv"
    path.write_text("t_s;pv;op\n" + "".join(f"{k};{row};1\n" for k, row in enumerate(rows)))
    export = read_export(path)
    assert (export.decisions.decimal, export.decisions.thousands) == (decimal, thousands)
    assert np.array_equal(export.record().pv, expected, equal_nan=True)


def test_a_stated_decimal_mark_decides_the_other(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text("t_s;pv;op\n0;1.234;1\n1;2.345;1\n")
    assert read_export(path, options=ReadOptions(decimal=".")).record().pv[0] == 1.234
    assert read_export(path, options=ReadOptions(decimal=",")).record().pv[0] == 1234
    path.write_text("t_s;pv;op\n0;1 234,5;1\n1;2;1\n")
    assert read_export(path, options=ReadOptions(decimal=",")).record().pv[0] == 1234.5


def test_decimals_that_come_late_in_the_start_of_a_file_count(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    rows = "".join(f"{k};{k};1\n" for k in range(1000))
    path.write_text(f"t_s;pv;op\n{rows}1000;2,5;1\n")
    assert read_export(path).record().pv[-1] == 2.5


@pytest.mark.parametrize("word", ["No Data", "NODATA", "nodata", " no  data ", "[-11059] No Good"])
def test_bad_words_are_known_however_they_are_written(word: str) -> None:
    assert is_bad_word(word)
    assert kind_of(word) is Kind.BAD


def test_words_of_the_list_are_all_known_and_no_numbers() -> None:
    assert all(is_bad_word(word) for word in bad_spellings())
    assert not any(looks_numeric(word) for word in bad_spellings())


@pytest.mark.parametrize(
    ("cell", "kind"),
    [
        ("", Kind.EMPTY),
        ("12,5", Kind.NUMBER),
        ("20240201", Kind.NUMBER),
        ("20240201100000", Kind.STAMP),
        ("2024-02-01", Kind.DATE),
        ("10:00", Kind.CLOCK),
        ("1.2.2024 10:00", Kind.STAMP),
        ("Good", Kind.QUALITY),
        ("AUTO", Kind.MODE),
        ("Feed pump", Kind.TEXT),
        ("x" * 100, Kind.TEXT),
    ],
)
def test_cells_are_of_one_kind(cell: str, kind: Kind) -> None:
    assert kind_of(cell) is kind


@pytest.mark.parametrize(
    ("header", "cells", "scheme"),
    [
        ("Quality", ["Good", "Bad", ""], Scheme.WORDS),
        ("Validity", ["1", "0"], Scheme.VALIDITY),
        ("l", ["0", "4"], Scheme.IP21),
        ("dataintegrity", ["192"], Scheme.OPC),
        ("Quality", ["192", "0"], Scheme.OPC),
        ("DataQuality", ["100", "0"], Scheme.PERCENT),
        ("DataQuality", ["1", "0"], None),
        ("Status", ["0"], None),
    ],
)
def test_quality_codes_are_told_by_heading_and_range(
    header: str, cells: list[str], scheme: Scheme | None
) -> None:
    assert decide_scheme(header, cells) is scheme


@pytest.mark.parametrize(
    ("cell", "scheme", "good"),
    [
        ("Good", Scheme.WORDS, True),
        ("Good, Non-Cascade", Scheme.WORDS, True),
        ("Bad: Comm Failure", Scheme.WORDS, False),
        ("Uncertain", Scheme.WORDS, False),
        ("Purple", Scheme.WORDS, None),
        ("Purple: rain", Scheme.WORDS, None),
        ("", Scheme.WORDS, None),
        ("192", Scheme.OPC, True),
        ("216", Scheme.OPC, True),
        ("64", Scheme.OPC, False),
        ("0", Scheme.OPC, False),
        ("Good", Scheme.OPC, True),
        ("1", Scheme.VALIDITY, True),
        ("0", Scheme.VALIDITY, False),
        ("2", Scheme.VALIDITY, None),
        ("0", Scheme.IP21, True),
        ("4", Scheme.IP21, True),
        ("1", Scheme.IP21, False),
        ("6", Scheme.IP21, False),
        ("3", Scheme.IP21, None),
        ("100", Scheme.PERCENT, True),
        ("99,5", Scheme.PERCENT, False),
    ],
)
def test_quality_codes_mean_good_bad_or_nothing(
    cell: str, scheme: Scheme, good: bool | None
) -> None:
    assert is_good(cell, scheme, None) is good


def test_stated_codes_decide_alone() -> None:
    assert is_good("7", Scheme.STATED, frozenset({"7"})) is True
    assert is_good("Good", Scheme.STATED, frozenset({"7"})) is False
    assert is_quality_word("Suspect")


@pytest.mark.parametrize(
    ("cell", "codes", "mode"),
    [
        ("auto", {}, Mode.AUTO),
        (" Manual ", {}, Mode.MAN),
        ("CASC", {}, Mode.CAS),
        ("RCAS", {}, Mode.REMOTE),
        ("1", {}, None),
        ("1", {1: Mode.AUTO}, Mode.AUTO),
        ("1.0", {1: Mode.AUTO}, Mode.AUTO),
        ("1,0", {"1": Mode.CAS}, Mode.CAS),
        ("1.5", {1: Mode.AUTO}, None),
        ("AUTO", {"AUTO": Mode.REMOTE}, Mode.REMOTE),
        ("IMAN", {}, None),
        ("nan", {}, None),
    ],
)
def test_modes_are_words_or_stated_codes(
    cell: str, codes: dict[int | str, Mode], mode: Mode | None
) -> None:
    assert mode_of(cell, codes) is mode


def test_mode_words_are_recognised() -> None:
    assert is_mode_word("aut")
    assert not is_mode_word("1")


@pytest.mark.parametrize(
    ("tag", "loop", "part"),
    [
        ("FIC101.PV", "FIC101", Part.PV),
        ("FIC101_SP", "FIC101", Part.SP),
        ("FIC101/SV", "FIC101", Part.SP),
        ("FIC101:OP", "FIC101", Part.OP),
        ("FIC101-MV", "FIC101", Part.OP),
        ("5RT101 co", "5RT101", Part.OP),
        ("\\\\server\\FIC101.OUT", "\\\\server\\FIC101", Part.OP),
        ("A/PID1/MODE.ACTUAL", "A/PID1", Part.MODE),
        ("A/PID1/PV.CV", "A/PID1", Part.PV),
        ("TIC7.PV (degC)", "TIC7", Part.PV),
        ("Setpoint", "", Part.SP),
        ("pv", "", Part.PV),
        ("MODE", "", Part.MODE),
    ],
)
def test_tags_tell_loop_and_part(tag: str, loop: str, part: Part) -> None:
    assert part_of(tag) == TagPart(loop, part)


@pytest.mark.parametrize("tag", ["TOP", "STOP", "FT_211", "PVC", "Flow", ".PV", "", "FIC.PVX"])
def test_other_tags_tell_nothing(tag: str) -> None:
    assert part_of(tag) is None


def test_units_are_split_from_tags() -> None:
    assert split_unit("FIC101.PV (m3/h)") == ("FIC101.PV", "m3/h")
    assert split_unit("T [degC]") == ("T", "degC")
    assert split_unit("(x)") == ("(x)", "")
    assert split_unit("T ()") == ("T", "")


def test_tags_are_grouped_in_the_order_of_the_file() -> None:
    groups = group_by_loop(["B.PV", "A.OP", "other", "A.PV", "B.OUT", "B.OP"])
    assert list(groups) == ["B", "A"]
    assert groups["B"] == {Part.PV: ["B.PV"], Part.OP: ["B.OUT", "B.OP"]}
