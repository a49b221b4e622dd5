"""Every row of the table of historian formats has a file here, read as the plant means it."""

from pathlib import Path

import numpy as np
import pytest

from historian.csv_file import read_export
from historian.errors import AmbiguousTime, ColumnNotFound, ExportRefused
from historian.export import Export
from historian.options import Columns, Layout, ReadOptions
from loop.record import Mode
from loop.signals import Real

EXPORTS = Path(__file__).parent / "exports"
NAN = float("nan")


def read(name: str, **options: object) -> Export:
    return read_export(EXPORTS / name, options=ReadOptions(**options))


def same(values: Real | None, expected: list[float]) -> bool:
    assert values is not None
    return bool(np.array_equal(values, expected, equal_nan=True))


def stamps(export: Export, tag: str) -> list[str]:
    return [str(stamp) for stamp in export.signals[tag].time.astype("datetime64[ms]")]


def test_pi_datalink_wide_with_error_text_and_decimal_commas() -> None:
    export = read("pi_datalink_wide.csv")
    record = export.record()
    assert same(record.pv, [101.25, NAN, NAN, NAN, NAN, NAN, NAN, 99.5])
    assert same(record.op, [45.5, 45.5, 45.75, 46, 46, 46.25, 46.25, 46.5])
    assert same(record.t, [60.0 * k for k in range(8)])
    assert export.decisions.decimal == ","
    assert export.decisions.line_end == "CRLF"
    assert export.accounting.gap_words == {
        "[-11059] No Good Data For Calculation": 1,
        "[-11057] Not Enough Values For Calculation": 1,
        "#N/A": 1,
        "#VALUE!": 1,
        "#REF!": 1,
        "Resize to show all values": 1,
    }
    assert export.accounting.rejected_cells == 0


def test_pi_datalink_compressed_with_a_time_column_per_tag() -> None:
    export = read("pi_datalink_compressed.csv")
    assert export.decisions.layout is Layout.PAIRS
    assert {tag: signal.value.size for tag, signal in export.signals.items()} == {
        "FIC101.PV": 6,
        "FIC101.OP": 3,
        "FIC101.SP": 2,
    }
    assert same(export.signals["FIC101.PV"].value, [NAN, 101.25, 101.5, 101, 100.75, 100.5])
    assert stamps(export, "FIC101.OP")[1] == "2024-02-01T10:00:25.000"
    record = export.record()
    assert same(record.op, [NAN, 45.5, 45.5, 45.5, 47, 48])
    assert same(record.sp, [NAN, 100, 100, 100, 105, 105])
    assert export.loops["FIC101"].held == ("op", "sp")
    assert any("last value is held" in words for words in export.decisions.words)
    assert export.accounting.gap_words == {"Pt Created": 1}
    assert (export.accounting.rows_read, export.accounting.rows_kept) == (11, 11)


def test_pi_digital_states_become_gaps_with_and_without_the_blank() -> None:
    export = read("pi_digital_states.csv")
    record = export.record()
    assert same(record.pv, [20.5, *[NAN] * 22, 21.5])
    assert same(record.op, [40.0] * 24)
    words = export.loops["TIC7"].accounting.gap_words
    assert sum(words.values()) == len(words) == 22
    assert {"I/O Timeout", "I/OTimeout", "Arc Off-line", "Snapfix"} <= set(words)


def test_pi_bulk_file_of_one_tag_without_header_and_seven_digits() -> None:
    export = read("pi_bulk_utc.csv", tag="TI9.PV")
    signal = export.signals["TI9.PV"]
    assert export.decisions.header_line is None
    assert export.time_zone == "UTC"
    assert [str(stamp) for stamp in signal.time] == [
        "2020-01-01T00:00:00.000000000",
        "2020-01-01T00:00:00.123456700",
        "2020-01-01T00:00:10.000000100",
        "2020-01-01T00:00:20.000000000",
    ]
    assert same(signal.value, [20.5, 20.625, NAN, 21])
    assert list(read("pi_bulk_utc.csv").signals) == ["pi_bulk_utc"]


def test_pi_bulk_file_with_local_time_value_and_tag() -> None:
    export = read("pi_bulk_local.csv", time_zone="Europe/Berlin")
    assert export.decisions.layout is Layout.LONG
    assert stamps(export, "FIC101.PV")[2] == "2023-12-31T23:00:00.000"
    assert same(export.record().pv, [12.5, 12.25, 13, 13.5])
    assert same(export.record().op, [NAN, NAN, 44.5, 44.5])


def test_ip21_rest_keeps_only_good_status() -> None:
    export = read("ip21_rest.csv", tag="FIC101.PV")
    signal = export.signals["FIC101.PV"]
    assert same(signal.value, [20.5, NAN, NAN, 21, NAN, NAN, 22])
    assert stamps(export, "FIC101.PV")[0] == "2024-01-01T00:00:00.000"
    assert export.accounting.gap_words == {f"quality {code}": 1 for code in (1, 2, 5, 6)}


def test_wincc_archive_with_validity_and_day_numbers() -> None:
    export = read("wincc.csv")
    record = export.record()
    assert stamps(export, "FIC101.PV")[0] == "2024-04-03T10:00:00.000"
    assert same(record.pv, [50, NAN, 52.5])
    assert same(record.op, [40, 42.5, 45])
    assert same(record.sp, [50, 50, 50])
    assert export.accounting.rows_rejected == 0
    assert any("1 footers" in words for words in export.decisions.words)


def test_wincc_stamps_without_day_numbers_are_ambiguous(tmp_path: Path) -> None:
    lines = (EXPORTS / "wincc.csv").read_text().splitlines()
    path = tmp_path / "wincc.csv"
    path.write_text("\n".join(line.rpartition(";")[0] for line in lines))
    with pytest.raises(AmbiguousTime) as refused:
        read_export(path)
    assert refused.value.readings == ("3 Apr 2024 (D/M/Y)", "4 Mar 2024 (M/D/Y)")


def test_proficy_sections_comments_and_us_dates() -> None:
    export = read("proficy.csv")
    record = export.record()
    assert stamps(export, "FIC101.PV")[0] == "2024-07-20T13:07:00.000"
    assert same(record.pv, [101.25, NAN, 101.75])
    assert same(record.op, [45.5, 45.75, 46])
    assert list(export.signals) == ["FIC101.PV", "FIC101.OP"]
    assert export.accounting.gap_words == {"quality Bad": 1}
    assert export.accounting.rows_rejected == 0


def test_citect_milliseconds_blanks_na_and_gated() -> None:
    export = read("citect.csv")
    record = export.record("Pane1-FIC101")
    assert stamps(export, "Pane1-FIC101.PV")[:2] == [
        "2024-06-15T01:17:25.100",
        "2024-06-15T01:17:25.600",
    ]
    assert same(record.pv, [NAN, 9.5, NAN, 9.75])
    assert same(record.op, [50, 50, NAN, 51])
    account = export.loops["Pane1-FIC101"].accounting
    assert (account.gap_words, account.empty_cells) == ({"NA": 1, "GATED": 1}, 1)
    assert any("'Pane2-Alarm' is not read" in words for words in export.decisions.words)


def test_scada_with_two_header_rows_and_a_restart() -> None:
    export = read("scada_two_headers.csv")
    assert (export.decisions.header_line, export.decisions.first_line) == (1, 3)
    assert same(export.record().pv, [101.5, 101.25, 99, 99.5])
    assert any("1 empty lines" in words for words in export.decisions.words)
    assert export.accounting.rows_rejected == 0
    assert export.accounting.longest_gap == 290


def test_rtap_quality_after_each_value_without_header() -> None:
    export = read("rtap.csv", columns=Columns(pv=2, op=4))
    record = export.record()
    assert same(record.pv, [101.5, NAN, 101, 100.5])
    assert same(record.op, [45.5, 45.75, NAN, 46.25])
    with pytest.raises(ColumnNotFound, match="column 2, column 4"):
        read("rtap.csv").record()


def test_ignition_sql_history_with_epoch_milliseconds_and_opc_quality() -> None:
    export = read("ignition.csv", columns=Columns(pv=12, op="17"), tag="TIC7")
    record = export.record()
    assert stamps(export, "12")[0] == "2024-01-01T00:00:00.123"
    assert same(record.pv, [20.5, NAN, 21])
    assert same(record.op, [40, 41, 42])
    assert record.tag == "TIC7"
    assert export.time_zone == "UTC"


def test_yokogawa_style_text_with_metadata_descriptions_and_denormals() -> None:
    export = read("yokogawa.txt", mode_codes={1: Mode.AUTO, 0: Mode.MAN})
    record = export.record("7FIC900")
    assert (export.decisions.header_line, export.decisions.first_line) == (3, 6)
    assert same(record.pv, [0, 101.25, 101.5, 101.75])
    assert same(record.op, [45.5, 45.75, 46, 46.25])
    assert same(record.sp, [0, 100, 100, 100])
    assert record.mode is not None
    assert record.mode.tolist() == [Mode.AUTO, Mode.AUTO, Mode.MAN, Mode.AUTO]
    assert export.accounting.zeroed_cells == 1


def test_yokogawa_mode_codes_are_not_guessed() -> None:
    export = read("yokogawa.txt")
    mode = export.record().mode
    assert mode is not None
    assert set(mode.tolist()) == {Mode.UNKNOWN}
    assert any(words.startswith("mode '1' (3 rows) is UNKNOWN") for words in export.decisions.words)


def test_plant_export_with_split_date_and_time_newest_first() -> None:
    export = read("plant_split_date_time.csv", columns=Columns(pv="FT_900", op="FV_900"))
    record = export.record()
    assert stamps(export, "FT_900")[0] == "2024-02-01T23:56:00.000"
    assert same(record.pv, [102, NAN, 102.25, 102.5])
    assert same(record.op, [37, 37.25, NAN, 37.5])
    assert "id" not in export.signals
    assert not export.accounting.disordered


@pytest.mark.parametrize("path", sorted(EXPORTS.glob("*.*")), ids=lambda path: path.name)
def test_rows_read_are_kept_merged_or_rejected(path: Path) -> None:
    if path.name.startswith("."):
        return
    try:
        export = read_export(path)
    except ExportRefused:
        assert path.name.startswith("refused_")
        return
    for account in (export.accounting, *(loop.accounting for loop in export.loops.values())):
        assert account.rows_read == account.rows_kept + account.rows_rejected + account.duplicates
