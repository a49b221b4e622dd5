"""Local time to UTC, against the zone database walked hour by hour."""

from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from historian.csv_file import read_export
from historian.errors import ExportRefused
from historian.options import ReadOptions
from historian.zones import changes_between, to_utc, zone_named

ZONES = (
    "Europe/Berlin",
    "America/New_York",
    "Australia/Lord_Howe",  # changes by half an hour
    "America/Sao_Paulo",
    "Asia/Kolkata",
    "Africa/Casablanca",
    "UTC",
)


def local_of(moments: list[datetime], zone: ZoneInfo) -> npt.NDArray[np.int64]:
    naive = [moment.astimezone(zone).replace(tzinfo=None) for moment in moments]
    return np.array(naive, dtype="datetime64[ns]").astype(np.int64)


def utc_of(moments: list[datetime]) -> npt.NDArray[np.int64]:
    return np.array([m.replace(tzinfo=None) for m in moments], dtype="datetime64[ns]").astype(
        np.int64
    )


@settings(max_examples=80, deadline=None)
@given(
    name=st.sampled_from(ZONES),
    start=st.datetimes(datetime(2015, 1, 1), datetime(2026, 1, 1)),  # noqa: DTZ001
    step=st.integers(60, 1500),
    count=st.integers(2, 600),
    newest_first=st.booleans(),
)
def test_rows_in_order_come_back_through_every_change(
    name: str, start: datetime, step: int, count: int, newest_first: bool
) -> None:
    zone = ZoneInfo(name)
    start = start.replace(microsecond=0, tzinfo=UTC)
    moments = [start + timedelta(seconds=step * k) for k in range(count)]
    if newest_first:
        moments.reverse()
    converted = to_utc(local_of(moments, zone), zone)
    assert not converted.missing.any()
    known = ~converted.unclear
    assert np.array_equal(converted.instants[known], utc_of(moments)[known])
    if converted.unclear.any():
        hidden = np.flatnonzero(converted.unclear)
        edges = {0, count - 1}
        assert edges & set(hidden.tolist()), "only a record that starts or ends there is unclear"


@pytest.mark.parametrize("name", ZONES)
def test_changes_are_those_of_the_zone_database(name: str) -> None:
    zone = ZoneInfo(name)
    first = int(datetime(2017, 1, 1, tzinfo=UTC).timestamp())
    last = int(datetime(2020, 1, 1, tzinfo=UTC).timestamp())
    start, changes = changes_between(zone, first, last)
    found = {change.instant: change.after - change.before for change in changes}
    expected = {}
    offset = datetime.fromtimestamp(first, tz=zone).utcoffset()
    assert offset is not None
    assert start == offset.total_seconds()
    for instant in range(first, last + 86400, 1800):
        later = datetime.fromtimestamp(instant, tz=zone).utcoffset()
        assert later is not None
        if later != offset:
            expected[instant] = int((later - offset).total_seconds())
            offset = later
    assert {k: v for k, v in found.items() if k <= last} == {
        k: v for k, v in expected.items() if k <= last
    }


def test_a_repeated_hour_without_a_step_back_is_unclear() -> None:
    zone = ZoneInfo("Europe/Berlin")
    local = np.array(
        ["2024-10-27T01:45", "2024-10-27T02:15", "2024-10-27T02:45", "2024-10-27T03:15"],
        dtype="datetime64[ns]",
    ).astype(np.int64)
    converted = to_utc(local, zone)
    assert converted.unclear.tolist() == [False, True, True, False]
    assert converted.instants[[0, 3]].astype("datetime64[ns]").astype(str).tolist() == [
        "2024-10-26T23:45:00.000000000",
        "2024-10-27T02:15:00.000000000",
    ]


def test_hourly_rows_with_two_equal_stamps_are_the_two_passes() -> None:
    zone = ZoneInfo("Europe/Berlin")
    local = np.array(
        ["2024-10-27T01", "2024-10-27T02", "2024-10-27T02", "2024-10-27T03"],
        dtype="datetime64[ns]",
    ).astype(np.int64)
    converted = to_utc(local, zone)
    assert not converted.unclear.any()
    assert np.diff(converted.instants).tolist() == [3_600_000_000_000] * 3


def test_unclear_rows_of_a_file_are_rejected_with_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text("Time,X.PV,X.OP\n2024-10-27 02:15,1,2\n2024-10-27 03:15,1,2\n")
    export = read_export(path, options=ReadOptions(time_zone="Europe/Berlin"))
    assert [r.line for r in export.accounting.rejections] == [2]
    assert "occurred twice in Europe/Berlin in autumn" in export.accounting.rejections[0].reason
    assert export.accounting.rows_kept == 1


def test_each_tag_of_a_long_file_has_its_own_order(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    rows = [
        f"2024-10-27 {clock},{tag},{k}"
        for k, clock in enumerate(["01:30", "02:00", "02:30", "02:00", "02:30", "03:00"])
        for tag in ("X.PV", "X.OP")
    ]
    path.write_text("Time,Tag,Value\n" + "\n".join(rows) + "\n")
    export = read_export(path, options=ReadOptions(time_zone="Europe/Berlin"))
    assert export.record().t.tolist() == [1800.0 * k for k in range(6)]
    assert export.record().op.tolist() == [0, 1, 2, 3, 4, 5]


def test_stamps_with_their_offset_need_no_zone(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text(
        "Time,X.PV,X.OP\n2024-10-27T02:30:00+02:00,1,2\n2024-10-27T02:30:00+01:00,3,4\n"
    )
    record = read_export(path, options=ReadOptions(time_zone="Asia/Tokyo")).record()
    assert record.t.tolist() == [0, 3600]
    assert str(record.start) == "2024-10-27 00:30:00+00:00"


@pytest.mark.parametrize("name", ["Mars/Olympus", "", "../etc/passwd"])
def test_an_unknown_zone_is_refused_in_words(name: str) -> None:
    with pytest.raises(ExportRefused, match="is not known; use a name such as"):
        zone_named(name)
