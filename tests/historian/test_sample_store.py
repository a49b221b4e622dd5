from collections.abc import Iterator
from datetime import UTC, date, datetime, timedelta, timezone
from pathlib import Path
from uuid import UUID

import numpy as np
import pytest

from historian.sample_layout import bucket_of
from historian.sample_store import SampleStore, Span
from historian.samples import Samples
from loop.errors import NoSamples
from loop.record import Mode, Record

NAN = float("nan")
MIDNIGHT = datetime(2026, 3, 29, tzinfo=UTC)  # the night in which Europe's clocks go forward


def samples(
    seconds: list[float],
    *,
    pv: float | list[float] = NAN,
    sp: float | list[float] = NAN,
    op: float | list[float] = NAN,
    mode: int | list[int] = -1,
    start: datetime = MIDNIGHT,
) -> Samples:
    """Make samples at seconds after midnight; a single value holds for all of them."""
    n = len(seconds)
    offsets = (np.array(seconds, dtype=np.float64) * 1e6).astype("timedelta64[us]")
    return Samples(
        time=np.datetime64(start.replace(tzinfo=None), "us") + offsets,
        pv=np.broadcast_to(np.asarray(pv, float), n).copy(),
        sp=np.broadcast_to(np.asarray(sp, float), n).copy(),
        op=np.broadcast_to(np.asarray(op, float), n).copy(),
        mode=np.broadcast_to(np.asarray(mode, np.int8), n).copy(),
    )


def seconds_of(stored: Samples) -> list[float]:
    origin = np.datetime64(MIDNIGHT.replace(tzinfo=None), "us")
    return [float(us) / 1e6 for us in (stored.time - origin).astype(np.int64)]


def same(one: Samples, other: Samples) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=name != "mode")
        for name in ("time", "pv", "sp", "op", "mode")
    )


@pytest.fixture
def store(tmp_path: Path) -> SampleStore:
    return SampleStore(tmp_path / "samples")


def files(folder: Path) -> Iterator[tuple[str, int]]:
    for path in sorted((folder / "samples").rglob("*")):
        if path.is_file():
            yield str(path), path.stat().st_mtime_ns


def test_what_was_written_is_read_back(store: SampleStore) -> None:
    sent = samples(
        [0, 1.5, 2.000001], pv=[1.1, NAN, -3e-300], sp=5.0, op=[NAN, 2, 3], mode=[1, 0, -1]
    )
    result = store.write("FIC-211", sent)
    assert same(store.read("FIC-211"), sent)
    assert (result.rows, result.new, result.replaced, result.unchanged) == (3, 3, 0, 0)
    assert result.first == MIDNIGHT
    assert result.last == MIDNIGHT + timedelta(seconds=2.000001)


def test_uploading_again_changes_nothing_at_all(store: SampleStore, tmp_path: Path) -> None:
    sent = samples([0, 60, 120], pv=[1, NAN, 3], sp=NAN, op=[4, 5, NAN], mode=[1, -1, 2])
    store.write("FIC-211", sent)
    before = list(files(tmp_path))
    result = store.write("FIC-211", sent)
    assert (result.new, result.replaced, result.unchanged) == (0, 0, 3)
    assert list(files(tmp_path)) == before


def test_overlapping_exports_merge_and_the_newer_value_wins(store: SampleStore) -> None:
    store.write("FIC-211", samples([0, 60, 120, 180], pv=[1, 2, 3, 4], op=50.0))
    result = store.write("FIC-211", samples([120, 180, 240], pv=[3, 40, 5], op=50.0))
    assert (result.new, result.replaced, result.unchanged) == (1, 1, 1)
    assert store.read("FIC-211").pv.tolist() == [1, 2, 3, 40, 5]


def test_a_gap_never_erases_a_value_and_a_value_fills_a_gap(store: SampleStore) -> None:
    store.write("FIC-211", samples([0, 60], pv=[1, NAN], op=[7, 8], mode=[1, -1]))
    result = store.write("FIC-211", samples([0, 60], pv=[NAN, 2], sp=9.0, op=NAN, mode=[-1, 2]))
    assert result.replaced == 2
    merged = samples([0, 60], pv=[1, 2], sp=9.0, op=[7, 8], mode=[1, 2])
    assert same(store.read("FIC-211"), merged)


def test_signals_with_stamps_of_their_own_stay_apart(store: SampleStore) -> None:
    store.write("FIC-211", samples([0, 10, 20], pv=[1, 2, 3]))
    store.write("FIC-211", samples([5, 20], op=[70, 71]))
    stored = store.read("FIC-211")
    assert seconds_of(stored) == [0, 5, 10, 20]
    np.testing.assert_array_equal(stored.pv, [1, NAN, 2, 3])
    np.testing.assert_array_equal(stored.op, [NAN, 70, NAN, 71])


def test_late_data_lands_where_it_belongs(store: SampleStore) -> None:
    store.write("FIC-211", samples([86_400 * 3, 86_400 * 3 + 60], pv=4.0))
    store.write("FIC-211", samples([60, 86_400 * 3 + 30], pv=[1, 3]))
    stored = store.read("FIC-211")
    assert seconds_of(stored) == [60, 86_400 * 3, 86_400 * 3 + 30, 86_400 * 3 + 60]
    assert stored.pv.tolist() == [1, 4, 3, 4]


def test_rows_in_any_order_are_sorted_and_the_later_of_two_rows_stays(store: SampleStore) -> None:
    newest_first = [
        samples([120, 60], pv=[3, 2]),
        samples([60, 0, 60], pv=[NAN, 1, 20], op=[5, NAN, NAN]),
    ]
    result = store.write("FIC-211", newest_first)
    assert (result.rows, result.new, result.repeated) == (5, 3, 2)
    stored = store.read("FIC-211")
    assert seconds_of(stored) == [0, 60, 120]
    assert stored.pv.tolist() == [1, 20, 3]
    np.testing.assert_array_equal(stored.op, [NAN, 5, NAN])


def test_a_bad_stretch_stays_visible_as_rows_without_values(store: SampleStore) -> None:
    store.write("FIC-211", samples([0, 60, 120], pv=[1, NAN, 3], op=[1, NAN, 3]))
    assert seconds_of(store.read("FIC-211")) == [0, 60, 120]


def test_loops_that_share_files_keep_their_own_samples(store: SampleStore) -> None:
    loops = [f"LIC-{n}" for n in range(40)]
    for n, loop in enumerate(loops):
        store.write(loop, samples([0, 60, 120], pv=float(n)))
    assert store.tidy().written == 8
    store.write("LIC-17", samples([60, 150], pv=[170, 171]))
    for n, loop in enumerate(loops):
        expected = [n, 170, n, 171] if loop == "LIC-17" else [n, n, n]
        assert store.read(loop).pv.tolist() == expected
    assert store.span("LIC-17").rows == 4
    assert store.span("LIC-18").rows == 3


def test_days_between_those_of_an_upload_are_left_alone(store: SampleStore) -> None:
    store.write("FIC-211", samples([86_400], pv=2.0))
    store.write("FIC-211", samples([0, 2 * 86_400], pv=[1, 3]))
    assert store.read("FIC-211").pv.tolist() == [1, 2, 3]


def test_a_loop_is_not_in_a_file_only_because_its_name_would_fit(store: SampleStore) -> None:
    first, between, last = [n for n in map(str, range(100, 200)) if bucket_of(n) == 3][:3]
    for loop in (first, last):
        store.write(loop, samples([0], pv=1.0))
    store.tidy()
    store.write(between, samples([86_400], pv=2.0))
    assert store.span(between).rows == 1
    assert store.read(between).pv.tolist() == [2.0]


def test_a_uuid_and_its_text_are_the_same_loop(store: SampleStore) -> None:
    loop = UUID("6f1c9a54-9e0e-4a3e-8f43-0a3c3f3b5f10")
    store.write(loop, samples([0], pv=1.0))
    assert store.read(str(loop)).pv.tolist() == [1.0]


def test_a_range_begins_with_start_and_ends_before_end(store: SampleStore) -> None:
    store.write("FIC-211", samples([86_340, 86_400, 86_460, 86_520], pv=[1, 2, 3, 4]))
    start = MIDNIGHT + timedelta(days=1)
    assert store.read("FIC-211", start).pv.tolist() == [2, 3, 4]
    assert store.read("FIC-211", start, start + timedelta(seconds=60)).pv.tolist() == [2]
    assert store.read("FIC-211", None, start).pv.tolist() == [1]
    assert len(store.read("FIC-211", start + timedelta(days=900))) == 0
    far = datetime(9999, 12, 31, tzinfo=UTC)
    assert len(store.read("FIC-211", datetime(1, 1, 1, tzinfo=UTC), far)) == 4


def test_a_range_beyond_the_calendar_of_utc_holds_nothing(store: SampleStore) -> None:
    store.write("FIC-211", samples([0, 60, 120, 180], pv=1.0))
    east, west = timezone(timedelta(hours=14)), timezone(timedelta(hours=-12))
    last = datetime(9999, 12, 31, 20, tzinfo=west)
    assert len(store.read("FIC-211", last, last + timedelta(hours=1))) == 0
    assert len(store.read("FIC-211", datetime(1, 1, 1, tzinfo=east), last)) == 4


def test_a_range_is_refused_in_words(store: SampleStore) -> None:
    with pytest.raises(ValueError, match="no time zone"):
        store.read("FIC-211", datetime(2026, 1, 1))  # noqa: DTZ001
    with pytest.raises(ValueError, match="start must not be after end"):
        store.read("FIC-211", MIDNIGHT, MIDNIGHT - timedelta(seconds=1))


def test_a_loop_without_samples_is_said_to_have_none(store: SampleStore) -> None:
    with pytest.raises(NoSamples, match="no samples of loop FIC-211") as refusal:
        store.read("FIC-211")
    assert refusal.value.loop == "FIC-211"
    store.write("FIC-212", samples([0], pv=1.0))
    with pytest.raises(NoSamples):
        store.read("FIC-211", MIDNIGHT)
    with pytest.raises(NoSamples):
        store.span("FIC-211")


@pytest.mark.parametrize("name", ["", "x" * 201, "FIC\n211", "FIC\x00"])
def test_a_name_that_cannot_be_is_refused(store: SampleStore, name: str) -> None:
    with pytest.raises(ValueError, match="printable"):
        store.write(name, samples([0], pv=1.0))


@pytest.mark.parametrize("name", ["FIC'211", "../../etc", "Zulauf Ä/1", "a" * 200, "x=y&z"])
def test_any_other_name_is_only_a_name(store: SampleStore, tmp_path: Path, name: str) -> None:
    store.write(name, samples([0], pv=1.0))
    assert store.span(name).rows == 1
    assert [path.name for path in tmp_path.iterdir()] == ["samples"]


def test_an_empty_upload_stores_nothing(store: SampleStore) -> None:
    result = store.write("FIC-211", [])
    assert (result.rows, result.first, result.last) == (0, None, None)
    with pytest.raises(NoSamples):
        store.span("FIC-211")


def test_the_span_counts_late_and_overlapping_uploads_once(store: SampleStore) -> None:
    store.write("FIC-211", samples([60, 120], pv=1.0))
    store.write("FIC-211", samples([0, 60, 86_400], pv=2.0))
    whole = Span(rows=4, first=MIDNIGHT, last=MIDNIGHT + timedelta(days=1))
    assert store.span("FIC-211") == whole
    store.tidy()
    assert store.span("FIC-211") == whole


def test_a_day_of_all_loops_is_read_at_once(store: SampleStore) -> None:
    for n in range(12):
        store.write(f"LIC-{n}", samples([0, 60, 86_400], pv=float(n)))
    store.write("LIC-3", samples([30], pv=33.0))
    day = dict(store.read_day(date(2026, 3, 29)))
    assert sorted(day) == sorted(f"LIC-{n}" for n in range(12))
    assert day["LIC-3"].pv.tolist() == [3, 33, 3]
    assert day["LIC-7"].pv.tolist() == [7, 7]
    assert dict(store.read_day(date(2026, 4, 1))) == {}


def test_a_store_opened_elsewhere_sees_what_was_written(tmp_path: Path) -> None:
    one, other = SampleStore(tmp_path / "s"), SampleStore(tmp_path / "s")
    one.write("FIC-211", samples([0], pv=1.0))
    assert len(other.read("FIC-211")) == 1
    other.write("FIC-211", samples([60], pv=2.0))
    assert one.read("FIC-211").pv.tolist() == [1, 2]


def test_a_record_goes_in_and_comes_out_as_it_was(store: SampleStore) -> None:
    record = Record(
        t=[0, 0.1, 0.30000001],
        pv=[1, NAN, 3],
        op=[4, 5, 6],
        sp=[1, 1, 2],
        mode=[Mode.AUTO, Mode.MAN, Mode.UNKNOWN],
        start=MIDNIGHT,
        tag="FIC-211",
    )
    store.write("FIC-211", Samples.of(record))
    back = store.read("FIC-211").record(tag="FIC-211")
    assert back.start == MIDNIGHT
    np.testing.assert_allclose(back.t, [0, 0.1, 0.3], atol=1e-12)  # kept to the microsecond
    np.testing.assert_array_equal(back.pv, record.pv)
    assert back.sp is not None
    assert back.mode is not None
    np.testing.assert_array_equal(back.sp, [1, 1, 2])
    np.testing.assert_array_equal(back.mode, [1, 0, -1])


def test_signals_known_nowhere_are_left_out_of_a_record(store: SampleStore) -> None:
    store.write("FIC-211", Samples.of(Record(t=[0, 1], pv=[1, 2], op=[3, 4], start=MIDNIGHT)))
    back = store.read("FIC-211").record()
    assert back.sp is None
    assert back.mode is None


def test_a_record_without_a_clock_is_refused() -> None:
    with pytest.raises(ValueError, match="elapsed time only"):
        Samples.of(Record(t=[0, 1], pv=[1, 2], op=[3, 4]))


def test_no_samples_make_no_record() -> None:
    with pytest.raises(ValueError, match="at least one sample"):
        samples([]).record()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"time": np.array(["2026-01-01"], "datetime64[s]")}, r"datetime64\[us\]"),
        ({"time": np.array(["NaT"], "datetime64[us]")}, "needs a time"),
        ({"time": np.array(["0026-01-01"], "datetime64[us]")}, "outside 1970 to 2199"),
        ({"time": np.array(["2200-01-01"], "datetime64[us]")}, "check the time format"),
        ({"pv": np.array([np.inf])}, "gaps are NaN"),
        ({"op": np.zeros(2)}, "one value a sample"),
        ({"mode": np.zeros((1, 1), np.int8)}, "one value a sample"),
    ],
)
def test_samples_that_cannot_be_are_refused(change: dict[str, object], words: str) -> None:
    good = samples([0], pv=1.0, op=2.0)
    fields = {name: getattr(good, name) for name in ("time", "pv", "sp", "op", "mode")}
    with pytest.raises(ValueError, match=words):
        Samples(**(fields | change))


def test_a_long_range_comes_a_day_at_a_time(store: SampleStore) -> None:
    sent = samples([0, 60, 86_400, 86_460, 3 * 86_400], pv=[1, 2, 3, 4, 5])
    store.write("FIC-211", sent)
    store.write("FIC-211", samples([30], pv=1.5))
    parts = [part.pv.tolist() for part in store.read_in_parts("FIC-211")]
    assert parts == [[1, 1.5, 2], [3, 4], [5]]
    start, end = MIDNIGHT + timedelta(seconds=60), MIDNIGHT + timedelta(seconds=86_460)
    assert [part.pv.tolist() for part in store.read_in_parts("FIC-211", start, end)] == [[2], [3]]
    assert list(store.read_in_parts("FIC-212")) == []
