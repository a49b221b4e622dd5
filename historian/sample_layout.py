"""How samples lie on disk: one row an instant of a loop, in Parquet files by date and bucket.

Every file is sorted by loop and time, so that one loop's month and one day of all loops are both a
few row groups. The sizes are measured: docs/decisions/0002-sample-store.md.
"""

import itertools
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path
from uuid import uuid4

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from historian.arrow_views import array_of, array_of_text
from historian.sample_rows import DAY, SIGNALS, UNKNOWN, Rows
from historian.samples import EPOCH

BUCKETS = 8
ROWS_A_GROUP = 14_400  # one loop's rows are found by decoding whole groups: ten days of minutes
# A dictionary pays while few values repeat often: rounded data yes, full precision no.
DICTIONARY_BYTES = 32_768  # beyond it a group goes on with plain values
ROWS_A_VALUE = 3  # how often a value has to come in the first group for a dictionary
PARTITIONS = ("date", "bucket")

FILE_SCHEMA = pa.schema(
    [
        pa.field("loop", pa.string()),
        pa.field("time", pa.timestamp("us", "UTC")),
        pa.field("sp", pa.float64()),
        pa.field("pv", pa.float64()),
        pa.field("op", pa.float64()),
        pa.field("mode", pa.int8()),
    ]
)
TABLE_SCHEMA = pa.schema([("date", pa.date32()), ("bucket", pa.int32()), *FILE_SCHEMA])
# Names repeat a thousand times: in memory they are kept once, with a number a row.
MEMORY_SCHEMA = FILE_SCHEMA.set(0, pa.field("loop", pa.dictionary(pa.int32(), pa.string())))


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleFile:
    """One data file of the table, as its log describes it.

    Attributes
    ----------
    path : str
        Place below the folder of the table.
    size : int
        Length. [byte]
    rows : int
        Number of samples.
    day : date
        Day all samples belong to, in UTC.
    bucket : int
        Bucket all loops belong to.
    first_loop, last_loop : str
        Smallest and largest loop name inside.
    first_time, last_time : int
        Earliest and latest sample, since 1970 in UTC. [us]
    """

    path: str
    size: int
    rows: int
    day: date
    bucket: int
    first_loop: str
    last_loop: str
    first_time: int
    last_time: int

    def only_holds(self, loop: str) -> bool:
        """Tell whether no other loop is inside."""
        return self.first_loop == loop == self.last_loop


def bucket_of(loop: str) -> int:
    """Choose the bucket of a loop: the same on every machine and in every version."""
    return zlib.crc32(loop.encode()) % BUCKETS


def day_of(time: int) -> date:
    """Name the day in UTC that a time since 1970 falls on. [us]"""
    return EPOCH.date() + timedelta(days=time // DAY)


def tables_of(loop: str, rows: Rows) -> Iterator[pa.Table]:
    """Lay rows of one loop out as columns, a row group at a time.

    A missing cell becomes null, never NaN.
    """
    for start in range(0, rows.size, ROWS_A_GROUP):
        group = rows[start : start + ROWS_A_GROUP]
        columns = {
            "loop": pa.DictionaryArray.from_arrays(
                array_of(np.zeros(group.size, np.int32), pa.int32()), array_of_text(loop)
            ),
            "time": array_of(group["time"], pa.timestamp("us", "UTC")),
            "mode": array_of(group["mode"], pa.int8(), group["mode"] == UNKNOWN),
        }
        for name in SIGNALS:
            columns[name] = array_of(group[name], pa.float64(), np.isnan(group[name]))
        yield pa.table(columns).select(MEMORY_SCHEMA.names)


def write_file(folder: Path, day: date, bucket: int, tables: Iterable[pa.Table]) -> SampleFile:
    """Write tables that follow each other by loop and time into one new file of a partition.

    Nobody sees the file before it is committed to the table's log.

    Raises
    ------
    OSError
        The disk is full or broken; nothing is left behind.
    """
    place = f"date={day.isoformat()}/bucket={bucket}/{uuid4()}.parquet"
    path = folder / place
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        extent = _write_groups(path, tables)
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    return SampleFile(
        path=place,
        size=path.stat().st_size,
        rows=extent.rows,
        day=day,
        bucket=bucket,
        first_loop=extent.first_loop,
        last_loop=extent.last_loop,
        first_time=extent.first_time,
        last_time=extent.last_time,
    )


@dataclass(slots=True)
class _Extent:
    """What has gone into a file so far."""

    rows: int
    first_loop: str
    last_loop: str
    first_time: int
    last_time: int


def _write_groups(path: Path, tables: Iterable[pa.Table]) -> _Extent:
    extent: _Extent | None = None
    coming = iter(tables)
    start = next(coming, None)
    if start is None:
        raise ValueError("a sample file needs at least one row, got none")
    with pq.ParquetWriter(
        path,
        FILE_SCHEMA,
        compression="zstd",
        use_dictionary=["loop", "sp", "mode", *_repeating(start)],
        dictionary_pagesize_limit=DICTIONARY_BYTES,
        column_encoding={"time": "DELTA_BINARY_PACKED"},
        store_schema=False,
    ) as writer:
        for table in itertools.chain([start], coming):
            group = table.cast(FILE_SCHEMA)
            writer.write_table(group, row_group_size=ROWS_A_GROUP)
            times = pc.min_max(group.column("time").cast(pa.int64())).as_py()
            first, last = group.column("loop")[0].as_py(), group.column("loop")[-1].as_py()
            if extent is None:
                extent = _Extent(group.num_rows, first, last, times["min"], times["max"])
            else:
                extent.rows += group.num_rows
                extent.last_loop = last
                extent.first_time = min(extent.first_time, times["min"])
                extent.last_time = max(extent.last_time, times["max"])
    assert extent is not None  # noqa: S101 - there was a first table
    return extent


def _repeating(table: pa.Table) -> list[str]:
    """Name the signals whose values repeat often enough for a dictionary."""
    most = min(table.num_rows // ROWS_A_VALUE, DICTIONARY_BYTES // 8)
    return [name for name in ("pv", "op") if pc.count_distinct(table[name]).as_py() <= most]


def regrouped(tables: Iterable[pa.Table]) -> Iterator[pa.Table]:
    """Cut tables that follow each other into full row groups."""
    whole = pa.concat_tables(tables)
    for start in range(0, whole.num_rows, ROWS_A_GROUP):
        yield whole.slice(start, ROWS_A_GROUP)


def loops_apart(files: Iterable[SampleFile]) -> Iterator[list[SampleFile]]:
    """Put files of one day together so that no loop is in files of two heaps."""
    heap: list[SampleFile] = []
    last = ""
    for file in sorted(files, key=lambda file: (file.bucket, file.first_loop)):
        if heap and (file.bucket != heap[-1].bucket or file.first_loop > last):
            yield heap
            heap, last = [], ""
        heap.append(file)
        last = max(last, file.last_loop)
    if heap:
        yield heap
