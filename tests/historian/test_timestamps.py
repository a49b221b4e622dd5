"""Stamps of every shape, against the standard library that reads them one by one."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from historian.stamp_shape import shape_of
from historian.timestamps import StampReader, date_fields

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)

FORMATS = [
    ("%Y-%m-%d %H:%M:%S", "Y/M/D"),
    ("%Y-%m-%dT%H:%M", "Y/M/D"),
    ("%Y/%m/%d %H:%M:%S.%f", "Y/M/D"),
    ("%Y.%m.%d %H.%M.%S", "Y/M/D"),
    ("%Y%m%d%H%M%S", "Y/M/D"),
    ("%Y%m%dT%H%M%S", "Y/M/D"),
    ("%Y%m%d %H:%M:%S", "Y/M/D"),
    ("%d.%m.%Y %H:%M:%S,%f", "D/M/Y"),
    ("%d/%m/%y %H:%M", "D/M/Y"),
    ("%m/%d/%Y %I:%M:%S %p", "M/D/Y"),
    ("%m-%d-%Y %I:%M%p", "M/D/Y"),
    ("%d-%b-%y %H:%M:%S", "Y/M/D"),
    ("%d-%b-%Y %H:%M:%S.%f", "Y/M/D"),
    ("%d %B %Y %H:%M:%S", "Y/M/D"),
    ("%b %d, %Y %I:%M:%S %p", "Y/M/D"),
    ("%Y-%b-%d %H:%M:%S", "Y/M/D"),
    ("%Y-%m-%d", "Y/M/D"),
    ("%d.%m.%Y", "D/M/Y"),
]
moments = st.datetimes(datetime(1970, 1, 1), datetime(2068, 12, 31))  # noqa: DTZ001


@pytest.mark.parametrize(("pattern", "order"), FORMATS)
@settings(max_examples=25, deadline=None)
@given(found=st.lists(moments, min_size=1, max_size=20))
def test_stamps_read_as_the_standard_library_writes_them(
    pattern: str, order: str, found: list[datetime]
) -> None:
    texts = [moment.strftime(pattern) for moment in found]
    again = [datetime.strptime(text, pattern).replace(tzinfo=UTC) for text in texts]
    instants, good = StampReader(order).read(pa.array(texts))
    assert good.all()
    expected = [(moment - EPOCH) // timedelta(microseconds=1) * 1000 for moment in again]
    assert instants.tolist() == expected


@settings(max_examples=60, deadline=None)
@given(
    moment=moments,
    minutes=st.integers(-14 * 60, 14 * 60),
    digits=st.integers(1, 9),
    fraction=st.integers(0, 10**9 - 1),
)
def test_offsets_and_up_to_nine_digits_of_fraction(
    moment: datetime, minutes: int, digits: int, fraction: int
) -> None:
    sign, size = ("-", -minutes) if minutes < 0 else ("+", minutes)
    kept = f"{fraction:09d}"[:digits]
    text = f"{moment:%Y-%m-%dT%H:%M:%S}.{kept}{sign}{size // 60:02d}:{size % 60:02d}"
    instants, good = StampReader("Y/M/D", zoned=True).read(pa.array([text]))
    whole = moment.replace(microsecond=0, tzinfo=UTC) - timedelta(minutes=minutes)
    assert good.all()
    assert instants[0] == (whole - EPOCH) // timedelta(seconds=1) * 10**9 + int(kept.ljust(9, "0"))


@pytest.mark.parametrize(
    "text",
    [
        "2024-02-30 10:00:00",
        "2023-02-29 10:00:00",
        "2024-13-01 10:00:00",
        "2024-00-10 10:00:00",
        "2024-01-00 10:00:00",
        "2024-01-01 25:00:00",
        "2024-01-01 10:60:00",
        "2024-01-01 10:00:61",
        "2024-01-01 24:00:01",
        "2024-01-01 10:00:00+19:00",
        "01/02/2024 13:00:00 PM",
        "01/02/2024 00:10:00 AM",
        "01/02/2024 10:00:00 XM",
        "01-Foo-24 10:00:00",
        "1799-01-01 10:00:00",
        "10:00:00",
        "no stamp",
        "2024-01-01 10:00:00 CET",
        "２０２４-01-01 10:00:00",
        "",
    ],
)
def test_stamps_that_are_no_instant_are_marked(text: str) -> None:
    fine = "2024-01-01 10:00:00"
    instants, good = StampReader("D/M/Y").read(pa.array([fine, text, fine, text]))
    assert good.tolist() == [True, False, True, False]
    assert instants[0] == instants[2]


def test_noon_and_midnight_on_a_twelve_hour_clock() -> None:
    texts = ["01/02/2024 12:00:00 AM", "01/02/2024 12:30:00 PM", "01/02/2024 1:30:00 p.m."]
    instants, good = StampReader("M/D/Y").read(pa.array(texts))
    assert good.all()
    assert (np.diff(instants) // 10**9).tolist() == [12 * 3600 + 1800, 3600]


def test_midnight_written_as_twenty_four_hours_is_the_next_day() -> None:
    instants, good = StampReader("Y/M/D").read(
        pa.array(["2024-02-29 24:00:00", "2024-03-01 00:00:00"])
    )
    assert good.all()
    assert instants[0] == instants[1]


def test_stamps_with_and_without_offset_are_not_mixed() -> None:
    texts = pa.array(["2024-01-01T10:00:00Z", "2024-01-01T10:00:00"])
    assert StampReader("Y/M/D", zoned=True).read(texts)[1].tolist() == [True, False]
    assert StampReader("Y/M/D", zoned=False).read(texts)[1].tolist() == [False, True]


def test_german_months_are_understood() -> None:
    texts = pa.array(["05-Mrz-24 10:00", "05-Mai-24 10:00", "05-Okt-24 10:00", "05-Dez-24 10:00"])
    instants, good = StampReader("Y/M/D").read(texts)
    months = instants.astype("datetime64[ns]").astype("datetime64[M]").astype(str).tolist()
    assert good.all()
    assert months == ["2024-03", "2024-05", "2024-10", "2024-12"]


def test_an_array_that_is_a_slice_of_another() -> None:
    whole = pa.array(["junk", "2024-01-01 10:00:00", "nonsense", "junk"])
    instants, good = StampReader("Y/M/D").read(whole.slice(1, 2))
    assert good.tolist() == [True, False]
    assert str(instants[:1].astype("datetime64[ns]")[0]) == "2024-01-01T10:00:00.000000000"


def test_fields_of_dates_whose_order_is_open() -> None:
    texts = pa.array(["03/04/2024 10:00", "junk", "13.4.24", "2024-01-01", "31/12/2024"])
    assert sorted(map(tuple, date_fields(texts).tolist())) == [
        (3, 4, 2024),
        (13, 4, 24),
        (31, 12, 2024),
    ]


def test_a_shape_knows_what_it_states() -> None:
    date, clock, both = shape_of("2024-01-01"), shape_of("10:00"), shape_of("2024-01-01 10:00Z")
    assert date is not None
    assert clock is not None
    assert both is not None
    assert (date.has_date, date.has_clock) == (True, False)
    assert (clock.has_date, clock.has_clock) == (False, True)
    assert (both.has_date, both.has_clock, both.utc_sign) == (True, True, 0)
