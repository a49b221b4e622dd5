"""Reading sample files back: whole, or one loop's rows out of the row groups that may hold them."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from historian.arrow_views import as_floats, as_stored, whole_number
from historian.sample_layout import SampleFile
from historian.sample_rows import (
    ROW,
    SIGNALS,
    UNKNOWN,
    Integers,
    Rows,
    rows_of,
    samples_of,
    sorted_once,
)
from historian.samples import Samples
from loop.signals import Codes, Real

NO_MODE = whole_number(UNKNOWN, pa.int8())
FOOTERS = 64  # kept, of 350 kB each at most: two months of one loop


@dataclass(frozen=True, slots=True, eq=False)
class _Footer:
    """What the end of a file tells: where its row groups lie, and the loops from and to in each."""

    metadata: pq.FileMetaData
    loops: tuple[tuple[str, str] | None, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Columns:
    """Columns of a table as arrays, perhaps not to be written to."""

    time: Integers
    sp: Real
    pv: Real
    op: Real
    mode: Codes


def read_files(folder: Path, files: Sequence[SampleFile]) -> pa.Table:
    """Read whole data files into one table, sorted by loop and time."""
    tables = []
    for file in files:
        with pq.ParquetFile(
            folder / file.path, read_dictionary=["loop"], memory_map=True
        ) as parquet:
            tables.append(parquet.read(use_threads=False))
    return _in_order(pa.concat_tables(tables))


def read_loop(
    folder: Path, file: SampleFile, loop: str, *, columns: Sequence[str] | None = None
) -> pa.Table:
    """Read one loop's rows of a data file, sorted by time.

    Parameters
    ----------
    folder : Path
        Folder of the table.
    file : SampleFile
        The file.
    loop : str
        Name of the loop.
    columns : sequence of str, optional
        Columns to decode beside the name and the time. Default: all.
    """
    path = folder / file.path
    footer = _footer(path)
    groups = [
        group
        for group, held in enumerate(footer.loops)
        if held is None or held[0] <= loop <= held[1]
    ]
    wanted = None if columns is None else ["loop", "time", *columns]
    with (
        pa.memory_map(str(path)) as opened,
        pq.ParquetFile(opened, metadata=footer.metadata, read_dictionary=["loop"]) as parquet,
    ):
        table = parquet.read_row_groups(groups, columns=wanted, use_threads=False)
    return _rows_of_loop(table, loop)


def _rows_of_loop(table: pa.Table, loop: str) -> pa.Table:
    """Take the rows of a loop by time, wherever another program may have put them."""
    names, numbers = _names(table)
    here = np.flatnonzero(numbers == names.index(loop)) if loop in names else numbers[:0]
    if not here.size:
        return table.slice(0, 0)
    together = here[-1] - here[0] + 1 == here.size
    rows = table.slice(here[0], here.size) if together else table.take(here)
    times = as_stored(rows.column("time").combine_chunks())
    if np.all(times[1:] > times[:-1]):
        return rows
    return rows.take(np.argsort(times, kind="stable"))


@lru_cache(FOOTERS)  # a data file is never written again under its name
def _footer(path: Path) -> _Footer:
    metadata = pq.read_metadata(path)
    groups = (metadata.row_group(index).column(0) for index in range(metadata.num_row_groups))
    return _Footer(metadata, tuple(_extent(group.statistics) for group in groups))


def _extent(statistics: pq.Statistics | None) -> tuple[str, str] | None:
    if statistics is None or not statistics.has_min_max:
        return None
    return statistics.min, statistics.max


def block_of(table: pa.Table, loop: str) -> tuple[int, int]:
    """Find where the rows of a loop begin and end in a table sorted by loop."""
    names, numbers = _names(table)
    here = np.flatnonzero(numbers == names.index(loop)) if loop in names else numbers[:0]
    return (int(here[0]), int(here[-1]) + 1) if here.size else (0, 0)


def samples_by_loop(table: pa.Table) -> Iterator[tuple[str, Samples]]:
    """Go through a table sorted by loop, one loop after the other."""
    names, numbers = _names(table)
    rows = _columns(table)
    bounds = np.r_[0, np.flatnonzero(np.diff(numbers)) + 1, numbers.size]
    for start, end in itertools.pairwise(bounds.tolist()):
        yield names[numbers[start]], _once(rows, slice(start, end))


def samples_in(tables: Sequence[pa.Table]) -> Samples:
    """Read what several files hold of one loop into samples in order of time."""
    if not tables:
        return samples_of(np.empty(0, ROW))
    return _once(_columns(pa.concat_tables(tables)), slice(None))


def _once(columns: _Columns, part: slice) -> Samples:
    """Copy one loop's samples out; put them in order where files hold the same time, seldom."""
    samples = Samples(
        time=columns.time[part].view("datetime64[us]").copy(),
        pv=columns.pv[part].copy(),
        sp=columns.sp[part].copy(),
        op=columns.op[part].copy(),
        mode=columns.mode[part].copy(),
    )
    if np.all(samples.time[1:] > samples.time[:-1]):
        return samples
    return samples_of(sorted_once(rows_of(samples)))


def _columns(table: pa.Table) -> _Columns:
    """Give the columns of a table as arrays, a missing value as NaN or unknown mode."""
    return _Columns(
        time=as_stored(table.column("time").combine_chunks()),
        mode=as_stored(pc.fill_null(table.column("mode"), NO_MODE).combine_chunks()),
        **{name: as_floats(table.column(name).combine_chunks()) for name in SIGNALS},
    )


def rows_in(table: pa.Table) -> Rows:
    """Read the columns of one loop back into rows."""
    columns = _columns(table)
    rows = np.empty(table.num_rows, ROW)
    for name in ROW.names or ():
        rows[name] = getattr(columns, name)
    return rows


def _in_order(table: pa.Table) -> pa.Table:
    """Sort a table by loop and time where another program has written it otherwise."""
    names, numbers = _names(table)
    times = as_stored(table.column("time").combine_chunks())
    next_loop = np.flatnonzero(numbers[1:] != numbers[:-1])
    met = [names[number] for number in numbers[np.r_[next_loop, -1]]] if numbers.size else []
    back = np.flatnonzero(times[1:] <= times[:-1])
    if sorted(set(met)) == met and np.all(np.isin(back, next_loop)):
        return table
    ranks = np.argsort(np.argsort(names))[numbers]
    return table.take(np.lexsort((times, ranks)))


def _names(table: pa.Table) -> tuple[list[str], Integers]:
    """Give the loop names of a table, and for every row the number of its name."""
    column = table.column("loop").unify_dictionaries().combine_chunks()
    return column.dictionary.to_pylist(), as_stored(column.indices)
