"""Reading sample files back: whole, or one loop's rows out of the row groups that may hold them."""

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from historian.sample_layout import SampleFile
from historian.sample_rows import ROW, SIGNALS, UNKNOWN, Integers, Rows


def read_file(folder: Path, file: SampleFile) -> pa.Table:
    """Read a whole data file, sorted by loop and time."""
    with pq.ParquetFile(folder / file.path, read_dictionary=["loop"]) as parquet:
        return in_order(parquet.read(use_threads=False))


def read_loop(folder: Path, file: SampleFile, loop: str) -> Rows:
    """Read one loop's rows of a data file, sorted by time."""
    with pq.ParquetFile(folder / file.path, read_dictionary=["loop"], memory_map=True) as parquet:
        groups = [
            index
            for index in range(parquet.num_row_groups)
            if _may_hold(parquet.metadata.row_group(index).column(0).statistics, loop)
        ]
        table = in_order(parquet.read_row_groups(groups, use_threads=False))
        start, end = block_of(table, loop)
        return rows_in(table.slice(start, end - start))


def _may_hold(statistics: pq.Statistics | None, loop: str) -> bool:
    if statistics is None or not statistics.has_min_max:
        return True
    return bool(statistics.min <= loop <= statistics.max)


def block_of(table: pa.Table, loop: str) -> tuple[int, int]:
    """Find where the rows of a loop begin and end in a table sorted by loop."""
    names, numbers = _names(table)
    here = np.flatnonzero(numbers == names.index(loop)) if loop in names else numbers[:0]
    return (int(here[0]), int(here[-1]) + 1) if here.size else (0, 0)


def blocks_of(table: pa.Table) -> Iterator[tuple[str, Rows]]:
    """Go through a table sorted by loop, one loop after the other."""
    names, numbers = _names(table)
    rows = rows_in(table)
    bounds = np.r_[0, np.flatnonzero(np.diff(numbers)) + 1, numbers.size]
    for start, end in itertools.pairwise(bounds.tolist()):
        yield names[numbers[start]], rows[start:end]


def rows_in(table: pa.Table) -> Rows:
    """Read the columns of one loop back into rows."""
    rows = np.empty(table.num_rows, ROW)
    rows["time"] = table.column("time").cast(pa.int64()).to_numpy()
    rows["mode"] = table.column("mode").fill_null(UNKNOWN).to_numpy()
    for name in SIGNALS:
        rows[name] = table.column(name).to_numpy()
    return rows


def in_order(table: pa.Table) -> pa.Table:
    """Sort a table by loop and time where another program has written it otherwise."""
    names, numbers = _names(table)
    ranks = np.argsort(np.argsort(names))[numbers] if names else numbers
    times = table.column("time").cast(pa.int64()).to_numpy()
    step = np.diff(ranks)
    if np.all((step > 0) | ((step == 0) & (np.diff(times) > 0))):
        return table
    return table.take(np.lexsort((times, ranks)))


def _names(table: pa.Table) -> tuple[list[str], Integers]:
    """Give the loop names of a table, and for every row the number of its name."""
    column = table.column("loop").unify_dictionaries().combine_chunks()
    return column.dictionary.to_pylist(), column.indices.to_numpy()
