"""The import checklist: every quirk of a file is read, or refused in words, as stated."""

import gzip
import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from historian.csv_file import read_export
from historian.errors import (
    AmbiguousColumns,
    AmbiguousNumber,
    AmbiguousTime,
    ColumnNotFound,
    ExportRefused,
    ExportTooLarge,
)
from historian.export import Export
from historian.options import Columns, ReadOptions
from loop.record import Mode

EXPORTS = Path(__file__).parent / "exports"
NAN = float("nan")


def read(name: str, **options: object) -> Export:
    return read_export(EXPORTS / name, options=ReadOptions(**options))


def written(folder: Path, data: str | bytes, name: str = "export.csv") -> Path:
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def instants(export: Export, tag: str) -> list[str]:
    return [str(stamp) for stamp in export.signals[tag].time.astype("datetime64[s]")]


SAME_TABLE = {
    "bom.csv": ("utf-8", "LF", ","),
    "semicolon.csv": ("utf-8", "LF", ";"),
    "tab.txt": ("utf-8", "LF", "\t"),
    "crlf.csv": ("utf-8", "CRLF", ","),
    "bare_cr.csv": ("utf-8", "CR", ","),
    "decimal_comma.csv": ("utf-8", "LF", ";"),
    "utf16.csv": ("utf-16-le", "CRLF", "\t"),
    "utf16_without_mark.csv": ("utf-16-be", "LF", ","),
    "latin1.csv": ("latin-1", "LF", ","),
    "packed.csv.gz": ("utf-8", "LF", ","),
    "packed.zip": ("utf-8", "LF", ","),
}


@pytest.mark.parametrize("name", SAME_TABLE)
def test_encoding_line_end_separator_and_packing_change_nothing(name: str) -> None:
    export = read(name)
    record = export.record()
    assert record.t.tolist() == [0, 10, 20, 30]
    assert record.pv.tolist() == [20, 20.125, 20.25, 20.375]
    assert record.sp is not None
    assert record.sp.tolist() == [20, 20, 20, 20]
    assert record.op.tolist() == [50, 49.75, 49.5, 49.25]
    assert str(record.start) == "2024-02-01 10:00:00+00:00"
    decided = export.decisions
    assert (decided.encoding, decided.line_end, decided.delimiter) == SAME_TABLE[name]
    assert export.accounting.rows_kept == 4


def test_latin1_is_stated_and_keeps_the_degree_sign() -> None:
    export = read("latin1.csv")
    assert export.record().pv_unit == "°C"
    assert "encoding: Latin-1, since the bytes are not UTF-8" in export.decisions.words


@pytest.mark.parametrize(
    ("name", "decimal", "thousands"),
    [
        ("thousands.csv", ".", ","),
        ("thousands_by_points.csv", ",", "."),
        ("thousands_by_blanks.csv", ",", " "),
    ],
)
def test_thousands_separators(name: str, decimal: str, thousands: str) -> None:
    export = read(name)
    assert export.record().pv.tolist() == [1234.5, 12_345_678.25, 999.75]
    assert (export.decisions.decimal, export.decisions.thousands) == (decimal, thousands)


def test_a_comma_before_three_digits_is_refused_with_both_readings() -> None:
    name = "refused_comma_decimal_or_thousands.csv"
    with pytest.raises(AmbiguousNumber, match=r"Line 2.*'1,234' may mean 1\.234.*or 1234") as no:
        read(name)
    assert no.value.readings == ("1.234 (decimal comma)", "1234 (thousands)")
    assert read(name, decimal=",").record().pv.tolist() == [1.234, 2.345]
    assert read(name, decimal=".").record().pv.tolist() == [1234, 2345]


def test_metadata_lines_before_the_header() -> None:
    export = read("metadata_before_header.csv")
    record = export.record()
    assert (export.decisions.header_line, export.decisions.first_line) == (6, 7)
    assert record.pv.tolist() == [20.5, 20.25, 20]
    assert (record.pv_unit, record.op_unit) == ("m3/h", "%")


def test_a_second_header_line_may_hold_units() -> None:
    record = read("units_in_second_header.csv").record()
    assert (record.pv_unit, record.op_unit) == ("m3/h", "%")
    assert record.pv.tolist() == [20.5, 20.25]


def test_stated_units_go_before_those_of_the_file() -> None:
    record = read("units_in_second_header.csv", pv_unit="t/h", op_unit="mA").record()
    assert (record.pv_unit, record.op_unit) == ("t/h", "mA")


def test_a_file_without_header_is_read_by_column_numbers() -> None:
    with pytest.raises(ColumnNotFound, match="column 2, column 3"):
        read("no_header.csv").record()
    record = read("no_header.csv", columns=Columns(pv=2, op=3)).record()
    assert record.pv.tolist() == [20.5, 20.25, 20]
    assert record.op.tolist() == [50, 51, 52]


def test_us_and_european_dates_are_told_apart_by_a_day_above_twelve() -> None:
    assert instants(read("us_dates.csv"), "TIC1.PV") == [
        "2024-03-04T22:00:00",
        "2024-03-13T10:00:00",
    ]
    assert instants(read("european_dates.csv"), "TIC1.PV") == [
        "2024-04-03T22:00:00",
        "2024-04-13T10:00:00",
    ]


def test_ambiguous_dates_are_refused_with_both_readings_and_can_be_stated() -> None:
    name = "refused_ambiguous_dates.csv"
    with pytest.raises(AmbiguousTime, match=r"3 Apr 2024.*4 Mar 2024.*day_first") as refused:
        read(name)
    assert refused.value.line == 2
    assert instants(read(name, day_first=True), "TIC1.PV")[0] == "2024-04-03T10:00:00"
    assert instants(read(name, day_first=False), "TIC1.PV")[0] == "2024-03-04T10:00:00"
    assert instants(read(name, time_format="M/D/Y"), "TIC1.PV")[0] == "2024-03-04T10:00:00"


@pytest.mark.parametrize("late", ["13/05/2024 10:00:00", "05/13/2024 10:00:00"])
def test_one_day_above_twelve_anywhere_in_the_file_settles_the_order(
    tmp_path: Path, late: str
) -> None:
    seconds = range(0, 36_000, 3)
    early = "".join(
        f"03/04/2024 {s // 3600:02d}:{s // 60 % 60:02d}:{s % 60:02d},1,2\n" for s in seconds
    )
    path = written(tmp_path, f"Time,pv,op\n{early}{late},1,2\n")
    assert path.stat().st_size > 256 * 1024
    first = read_export(path).signals["pv"].time[0]
    assert str(first)[:10] == ("2024-04-03" if late.startswith("13") else "2024-03-04")


def test_two_digit_years_that_fit_three_orders_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "Time,pv,op\n05-04-03 10:00,1,2\n05-04-03 10:01,1,2\n")
    with pytest.raises(AmbiguousTime) as refused:
        read_export(path)
    assert refused.value.readings == (
        "5 Apr 2003 (D/M/Y)",
        "4 May 2003 (M/D/Y)",
        "3 Apr 2005 (Y/M/D)",
    )
    export = read_export(path, options=ReadOptions(time_format="Y/M/D"))
    assert instants(export, "pv")[0] == "2005-04-03T10:00:00"


def test_autumn_hour_is_resolved_by_the_order_of_rows() -> None:
    export = read("autumn_hour.csv", time_zone="Europe/Berlin")
    assert instants(export, "TIC1.PV") == [
        "2024-10-26T23:30:00",
        "2024-10-27T00:00:00",
        "2024-10-27T00:30:00",
        "2024-10-27T01:00:00",
        "2024-10-27T01:30:00",
        "2024-10-27T02:00:00",
        "2024-10-27T02:30:00",
    ]
    assert export.record().pv.tolist() == [20, 21, 22, 23, 24, 25, 26]
    assert export.time_zone == "Europe/Berlin"


def test_autumn_hour_without_a_zone_is_pointed_out() -> None:
    export = read("autumn_hour.csv")
    assert export.accounting.conflicts == 2
    assert any("clock is set back in autumn" in words for words in export.decisions.words)
    assert export.record().start is None


def test_spring_hour_that_never_was_is_rejected_with_line_and_reason() -> None:
    export = read("spring_hour.csv", time_zone="Europe/Berlin")
    assert export.record().t.tolist() == [0, 1800, 3600]
    assert [r.line for r in export.accounting.rejections] == [3, 4]
    assert "jumped over this time in spring" in export.accounting.rejections[0].reason
    assert export.accounting.rows_rejected == 2


def test_excel_days_with_decimal_comma() -> None:
    export = read("excel_days.csv")
    assert instants(export, "TIC1.PV") == [
        "2024-02-01T10:00:00",
        "2024-02-01T10:01:00",
        "2024-02-01T10:02:00",
    ]
    assert export.decisions.time_format == "excel"


@pytest.mark.parametrize("name", ["epoch_seconds", "epoch_milliseconds"])
def test_epochs_are_known_by_their_range(name: str) -> None:
    export = read(f"{name}.csv")
    assert instants(export, "pv") == ["2024-02-01T10:00:00", "2024-02-01T10:00:10"]
    assert export.time_zone == "UTC"
    assert any("by the range of the numbers" in words for words in export.decisions.words)
    stated = read(f"{name}.csv", time_format="elapsed_s")
    assert stated.record().start is None


def test_seven_digit_fractions_are_kept_to_the_last() -> None:
    time = read("seven_digits.csv").signals["TIC1.PV"].time
    assert [str(stamp)[-10:] for stamp in time] == [".123456700", ".765432100"]


def test_states_among_numbers_are_gaps_and_unknown_words_are_rejected() -> None:
    export = read("states_among_numbers.csv")
    record = export.record()
    assert np.array_equal(record.pv, [20.5, NAN, 20.25, NAN, 20], equal_nan=True)
    assert np.array_equal(record.op, [50, 50, NAN, 51, 52], equal_nan=True)
    assert record.mode is not None
    assert record.mode.tolist() == [Mode.AUTO, Mode.MAN, Mode.CAS, Mode.UNKNOWN, Mode.REMOTE]
    account = export.loops["TIC1"].accounting
    assert account.gap_words == {"Bad Input": 1, "Configure": 1}
    assert [(r.line, r.column, r.text) for r in account.rejections] == [(5, "TIC1.PV", "Kaputt")]
    assert "line 5, TIC1.PV: it is no number" in str(account.rejections[0])
    assert account.rejected_cells == 1


@pytest.mark.parametrize("name", ["naming_sv_mv", "naming_sp_co", "naming_sp_out"])
def test_set_point_and_output_go_by_many_names(name: str) -> None:
    record = read(f"{name}.csv").record("FIC7")
    assert record.sp is not None
    assert (record.pv.tolist(), record.sp.tolist(), record.op.tolist()) == (
        [1, 4],
        [2, 5],
        [3, 6],
    )


def test_duplicates_merge_conflicts_keep_the_later_row_and_irregular_stamps_stay() -> None:
    export = read("duplicates_and_irregular.csv")
    record = export.record()
    assert record.t.tolist() == [0, 10, 13, 45, 60]
    assert record.pv.tolist() == [20.5, 20.25, 19, 19.5, 18]
    assert record.op.tolist() == [50, 51, 52, 53, 52]
    account = export.accounting
    assert (account.rows_read, account.rows_kept, account.duplicates) == (8, 5, 3)
    assert account.conflicts == 1
    assert account.disordered
    assert account.irregular


def test_denormals_stand_for_zero() -> None:
    export = read("denormals.csv")
    assert export.record().pv.tolist() == [0, 0, 1.2e-38, 0]
    assert export.accounting.zeroed_cells == 2


def test_nul_bytes_reject_the_line_they_stand_in() -> None:
    export = read("nul_bytes.csv")
    assert export.record().pv.tolist() == [20.5, 20]
    assert [(r.line, r.reason) for r in export.accounting.rejections] == [
        (3, "it holds NUL bytes"),
        (5, "the last line is cut off, it holds NUL bytes"),
    ]


def test_infinite_and_huge_numbers_are_rejected_cell_by_cell() -> None:
    export = read("huge_numbers.csv")
    assert np.array_equal(export.record().pv, [20.5, NAN, NAN, NAN, 20, NAN], equal_nan=True)
    assert [(r.line, r.text) for r in export.accounting.rejections] == [
        (3, "1e308"),
        (4, "inf"),
        (5, "-Infinity"),
        (7, "1e999"),
    ]


def test_a_truncated_last_line_is_rejected_with_its_number() -> None:
    export = read("truncated.csv")
    assert export.accounting.rows_kept == 3
    (rejection,) = export.accounting.rejections
    assert rejection.line == 5
    assert rejection.reason == "the last line is cut off, it has 2 columns instead of 4"


def test_a_number_cut_at_its_decimal_mark_is_rejected(tmp_path: Path) -> None:
    export = read_export(written(tmp_path, "time,pv,op\n0,1,2.5\n1,1,2."))
    assert export.accounting.rows_kept == 1
    assert [(r.line, r.reason) for r in export.accounting.rejections] == [
        (3, "the last line is cut off, its last number ends in the decimal mark")
    ]


def test_a_whole_last_line_without_line_end_is_kept_and_pointed_out(tmp_path: Path) -> None:
    export = read_export(written(tmp_path, "time,pv,op\n0,1,2\n1,1,2"))
    assert export.accounting.rows_kept == 2
    assert any("no line end" in words for words in export.decisions.words)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", r"empty \(0 bytes\)"),
        (b"%PDF-1.7\n", "a PDF document"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"\0" * 600, "an old Excel workbook"),
        (b"<html><body><table>", "HTML or XML"),
        (b'[{"t": 1, "v": 2}]', "JSON"),
        (b"BZh91AY&SY", "bzip2"),
        (b"\0" * 500, "mostly NUL bytes"),
        (b"\xef\xbb\xbf", "no rows"),
        (b"\n\n\n", "no rows"),
        (b"just some words\nand more words\n", "No separator"),
        (b"a,b\nc,d\n", "No column holds times or numbers|No separator"),
        (b"\x1f\x8b\x08\0\0\0", "damaged or cut off"),
        (b"PK\x03\x04 no archive", "damaged or cut off"),
    ],
)
def test_what_is_no_export_is_refused_in_words(tmp_path: Path, data: bytes, sentence: str) -> None:
    with pytest.raises(ExportRefused, match=sentence):
        read_export(written(tmp_path, data))


def test_disguised_fixtures_are_refused() -> None:
    for name in ("refused_empty.csv", "refused_pdf.csv"):
        with pytest.raises(ExportRefused):
            read(name)


def test_a_missing_file_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(ExportRefused, match="cannot be opened"):
        read_export(tmp_path / "absent.csv")


def zipped(members: dict[str, bytes]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return data.getvalue()


TABLE = b"time,pv,op\n" + b"".join(b"%d,1,2\n" % k for k in range(20_000))


@pytest.mark.parametrize("pack", [gzip.compress, lambda data: zipped({"a.csv": data})])
def test_archives_have_a_limit_when_unpacked(
    tmp_path: Path, pack: Callable[[bytes], bytes]
) -> None:
    path = written(tmp_path, pack(TABLE))
    assert read_export(path).accounting.rows_kept == 20_000
    with pytest.raises(ExportTooLarge, match="unpacks to more than the limit of 100,000 bytes"):
        read_export(path, options=ReadOptions(max_bytes=100_000))


def test_plain_files_have_the_same_limit(tmp_path: Path) -> None:
    with pytest.raises(ExportTooLarge, match="holds more than the limit of 1,000 bytes"):
        read_export(written(tmp_path, TABLE), options=ReadOptions(max_bytes=1000))


@pytest.mark.parametrize(
    ("members", "sentence"),
    [
        ({"a.csv": TABLE, "b.csv": TABLE}, "holds 2 files"),
        ({}, "holds 0 files"),
        ({"[Content_Types].xml": b"", "xl/workbook.xml": b""}, "a workbook"),
        ({"a.csv": b"%PDF-1.4"}, "a PDF document"),
    ],
)
def test_archives_of_other_things_are_refused(
    tmp_path: Path, members: dict[str, bytes], sentence: str
) -> None:
    with pytest.raises(ExportRefused, match=sentence):
        read_export(written(tmp_path, zipped(members)))


def test_a_truncated_archive_is_refused(tmp_path: Path) -> None:
    packed = gzip.compress(TABLE)
    with pytest.raises(ExportRefused, match="damaged or cut off"):
        read_export(written(tmp_path, packed[: len(packed) // 2]))


def test_two_columns_for_one_part_are_refused_by_name(tmp_path: Path) -> None:
    export = read_export(written(tmp_path, "time,X.PV,X.OP,X.OUT\n0,1,2,3\n1,1,2,3\n"))
    with pytest.raises(AmbiguousColumns, match=r"the op of loop 'X'.*X\.OP, X\.OUT"):
        export.record()
    with pytest.raises(AmbiguousColumns):
        export.record("X")


def test_several_loops_must_be_named(tmp_path: Path) -> None:
    path = written(tmp_path, "time,X.PV,X.OP,Y.PV,Y.OP\n0,1,2,3,4\n1,1,2,3,4\n")
    export = read_export(path)
    with pytest.raises(AmbiguousColumns, match=r"name the loop\. The choice is: X, Y"):
        export.record()
    assert export.record("Y").op.tolist() == [4, 4]
    with pytest.raises(ColumnNotFound, match=r"loop 'Z'.*X, Y"):
        export.record("Z")


def test_a_loop_without_output_says_what_is_missing(tmp_path: Path) -> None:
    export = read_export(written(tmp_path, "time,X.PV,X.SP\n0,1,2\n1,1,2\n"))
    with pytest.raises(ColumnNotFound, match="the op of loop 'X'"):
        export.record()
