"""The sample store: one loop's month, a day of all loops, late and corrected samples."""

import itertools
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
from deltalake import DeltaTable, QueryBuilder

from benchmarks.section import Section, Target
from benchmarks.timing import Timing, duration, interleaved
from historian.sample_layout import BUCKETS, bucket_of, regrouped, tables_of, write_file
from historian.sample_log import SampleLog
from historian.sample_rows import ROW, Rows
from historian.sample_store import SampleStore
from historian.samples import Samples

LOOPS = 5_000
DAYS = 30
STEP = 60  # s
FIRST = date(2026, 1, 1)
MONTH_BUCKET = 3  # the others get one day: a month of all takes minutes to make
PATTERNS = 64
MONTH_LIMIT, DAY_LIMIT, CHANGE_LIMIT = 12.0, 44.0, 80.0
MILLION = 1e6


def _names() -> list[str]:
    return [f"{zlib.crc32(str(n).encode()):08x}-loop-{n:04d}" for n in range(LOOPS)]


def _patterns() -> list[Rows]:
    """Days of one loop, rounded to two decimals as historians export, 0.1 % bad."""
    rng = np.random.default_rng(1)
    size = 86_400 // STEP
    days = []
    for _ in range(PATTERNS):
        rows = np.empty(size, ROW)
        for name, middle in (("pv", 50.0), ("op", 40.0)):
            walk = np.cumsum(rng.standard_normal(size) * 0.3)
            rows[name] = np.round(middle + walk - np.linspace(0, walk[-1], size), 2)
        rows["pv"][rng.random(size) < 1e-3] = np.nan
        rows["sp"], rows["mode"] = np.repeat([50.0, 51.0], size // 2), 1
        days.append(rows)
    return days


def _tables(
    loops: Sequence[str], day: date, patterns: Iterator[Rows], rng: np.random.Generator
) -> Iterator[pa.Table]:
    midnight = int(np.datetime64(day, "us").astype(np.int64))
    for loop in loops:
        rows = next(patterns).copy()
        rows["time"] = midnight + np.arange(rows.size) * STEP * 1_000_000
        shift = int(rng.integers(rows.size))
        for name in ("pv", "op"):
            rows[name] = np.round(np.roll(rows[name], shift) + shift / 100, 2)
        yield from tables_of(loop, rows)


def _build(folder: Path) -> None:
    """Write a store as it lies once it is tidied: one file for each day and bucket."""
    log = SampleLog(folder)
    patterns = itertools.cycle(_patterns())
    rng = np.random.default_rng(2)
    for day in (FIRST + timedelta(days=day) for day in range(DAYS)):
        files = []
        for bucket in range(BUCKETS) if day == FIRST else (MONTH_BUCKET,):
            loops = sorted(name for name in _names() if bucket_of(name) == bucket)
            tables = regrouped(_tables(loops, day, patterns, rng))
            files.append(write_file(folder, day, bucket, tables))
        log.commit(files)


def _day_of(store: SampleStore) -> int:
    return sum(len(found) for _, found in store.read_day(FIRST))


def _with_datafusion(folder: Path, condition: str) -> pa.Table:
    query = f"select loop, time, sp, pv, op, mode from s where {condition}"  # noqa: S608
    found = QueryBuilder().register("s", DeltaTable(folder)).execute(query).read_all()
    return pa.table(found)


def _late(loop: str, store: SampleStore, second: int, days: int, pv: float) -> tuple[int, int]:
    """Upload a sample a minute, `second` behind it: new and replaced instants."""
    times = np.datetime64(FIRST, "us") + (np.arange(days * 1440) * STEP + second).astype(
        "timedelta64[s]"
    )
    signal = np.full(times.size, pv)
    mode = np.ones(times.size, np.int8)
    done = store.write(loop, Samples(time=times, pv=signal, sp=signal, op=signal, mode=mode))
    return done.new, done.replaced


def _written(loops: Sequence[str], store: SampleStore) -> dict[str, Timing]:
    """Time uploads, each with loops of its own, so that every one changes something."""
    spare = iter(loops)
    return interleaved(
        {
            "late": lambda: _late(next(spare), store, 30, DAYS, 1.0),
            "corrected": lambda: _late(next(spare), store, 0, 1, 1.0),
        },
        repeats=7,
        seconds=15.0,
    )


def run() -> Section:
    """Build a store, read it beside DataFusion over the same files, then change it."""
    with tempfile.TemporaryDirectory(prefix="loopwright-bench-") as temporary:
        folder = Path(temporary) / "samples"
        _build(folder)
        files = SampleLog(folder).files()
        bytes_a_row = sum(file.size for file in files) / sum(file.rows for file in files)
        store = SampleStore(folder)
        mine = [name for name in _names() if bucket_of(name) == MONTH_BUCKET]
        turn = itertools.cycle(mine[:300])
        per_day, size = 86_400 // STEP, DAYS * 86_400 // STEP
        start = datetime.combine(FIRST, datetime.min.time(), UTC)
        whole = store.read(mine[0])
        same = _with_datafusion(folder, f"loop = '{mine[0]}' and bucket = {MONTH_BUCKET}")
        assert len(whole) == same.num_rows == size
        by_time = np.argsort(same["time"].to_numpy())
        assert np.array_equal(whole.pv, same["pv"].to_numpy()[by_time], equal_nan=True)
        assert _day_of(store) == LOOPS * per_day
        read = interleaved(
            {
                "month": lambda: store.read(next(turn)),
                "month, DataFusion": lambda: _with_datafusion(
                    folder, f"loop = '{next(turn)}' and bucket = {MONTH_BUCKET}"
                ),
                "one day": lambda: store.read(next(turn), start, start + timedelta(days=1)),
                "day": lambda: _day_of(store),
                "day, DataFusion": lambda: _with_datafusion(folder, f"date = '{FIRST}'"),
            },
            repeats=9,
            seconds=25.0,
        )
        assert _late(mine[-1], store, 30, DAYS, 1.0) == (size, 0)
        assert _late(mine[-1], store, 0, 1, 2.0) == (0, per_day)
        wrote = _written(mine[300:-1], store)
    month, change = read["month"].median * 1e3, wrote["corrected"].median * 1e3
    rows_a_day = LOOPS * per_day
    return Section(
        title="Sample store",
        how=(
            f"{LOOPS:,} loops of one sample a minute, two decimals, as a tidied store holds them: "
            f"a day of all ({rows_a_day / MILLION:.1f} million rows), and {DAYS} days of one "
            f"bucket of eight ({len(mine)} loops, {len(mine) * size / MILLION:.0f} million rows), "
            f"{bytes_a_row:.2f} bytes a row: {bytes_a_row * rows_a_day * DAYS / MILLION:.0f} MB "
            f"for {DAYS} days of all. The page cache is warm. Beside it DataFusion, which comes "
            "with deltalake, over the same files. Processor time, its threads included."
        ),
        columns=("work", "Loopwright", "DataFusion"),
        rows=(
            (f"one loop, {DAYS} days", _shown(read["month"]), _shown(read["month, DataFusion"])),
            ("one loop, one day", _shown(read["one day"]), ""),
            ("one day, all loops", _shown(read["day"]), _shown(read["day, DataFusion"])),
            (f"{size:,} late samples of one loop onto {DAYS} days", _shown(wrote["late"]), ""),
            ("a day of one loop corrected in a file of 625", _shown(wrote["corrected"]), ""),
        ),
        targets=(
            Target(what="one loop, 30 days", limit=MONTH_LIMIT, reached=month, unit="ms"),
            Target(
                what="one day, all loops",
                limit=DAY_LIMIT,
                reached=read["day"].median * 1e3,
                unit="ms",
            ),
            Target(what="a corrected day", limit=CHANGE_LIMIT, reached=change, unit="ms"),
        ),
        notes=(
            "The limits were measured on bare Parquet files in this layout, before there was a "
            "store: no log to look into, no check of the values, columns instead of samples, and "
            "no write that reaches the disk before it is answered.",
            "DataFusion skips pages, pyarrow only row groups, hence ours are small. Its answer is "
            "columns in no order; ours are the samples of each loop, in order and checked.",
        ),
    )


def _shown(timing: Timing) -> str:
    return f"{duration(timing.median)} ({duration(timing.best)})"
