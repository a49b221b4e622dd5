"""Loops out of Parquet files: one file a loop, or many loops in one with a column that names them.

Columns are found by name: time (or timestamp), pv, op, and where there are some sp, mode and loop
(or tag). The partitions of a Delta Lake folder, such as the sample store's own, read the same way.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from deltalake import DeltaTable
from deltalake.exceptions import DeltaError

from historian.errors import ExportRefused
from historian.sample_layout import FILE_SCHEMA
from historian.samples import Samples
from loop.record import Mode
from loop.signals import Codes, Real

NAMES = {
    "time": ("time", "timestamp", "datetime", "date_time"),
    "loop": ("loop", "tag", "loop_id", "name"),
    "pv": ("pv",),
    "op": ("op", "mv", "co", "out"),
    "sp": ("sp", "sv"),
    "mode": ("mode",),
}
NEEDED = ("time", "pv", "op")
LARGEST_FILE = 2_000_000_000  # bytes
MOST_FILES = 100_000


def parquet_files(folder: Path) -> list[Path]:
    """List the Parquet files below a folder, by path.

    Of a Delta Lake table those of its newest version: the others are replaced data, still there
    for whoever is reading them, and the log's own.

    Raises
    ------
    ExportRefused
        There are none, or too many.
    """
    tables = [log.parent for log in folder.rglob("_delta_log") if log.is_dir()]
    loose = (
        path
        for path in folder.rglob("*.parquet")
        if path.is_file() and not any(path.is_relative_to(table) for table in tables)
    )
    files = sorted({*loose, *(path for table in tables for path in _in_table(table))})
    if not files:
        raise ExportRefused(f"There is no Parquet file below {folder.name}.")
    if len(files) > MOST_FILES:
        raise ExportRefused(
            f"There are {len(files)} Parquet files below {folder.name}; "
            f"at most {MOST_FILES} are read at once."
        )
    return files


def _in_table(folder: Path) -> list[Path]:
    try:
        return [Path(uri) for uri in DeltaTable(folder).file_uris()]
    except DeltaError as error:
        raise ExportRefused(f"{folder.name} cannot be read as a Delta Lake table.") from error


def loops_in(
    file: Path, *, mode_codes: Mapping[int | str, Mode] | None = None
) -> Iterator[tuple[str, Samples]]:
    """Read every loop of a file, in order of time; a file without loop names is one loop.

    Parameters
    ----------
    file : Path
        Parquet file; without a column of loop names the loop is called as the file.
    mode_codes : mapping, optional
        Meaning of mode codes other than MAN AUTO CAS REMOTE; numbers are never guessed.

    Raises
    ------
    ExportRefused
        It is no Parquet file, is too large, or lacks a column; or its times have no zone.
    """
    if file.stat().st_size > LARGEST_FILE:
        raise ExportRefused(f"{file.name} is larger than {LARGEST_FILE / 1e9:.0f} GB; split it.")
    try:
        table = pq.ParquetFile(file).read()
    except (pa.ArrowInvalid, OSError) as error:
        raise ExportRefused(f"{file.name} cannot be read as Parquet.") from error
    columns, meanings = _columns(table, file), mode_codes or {}
    if "loop" not in columns:
        yield file.stem, _samples(table, columns, meanings, file)
        return
    try:
        names = table.column(columns["loop"]).cast(pa.string())
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
        raise ExportRefused(f"Column {columns['loop']} of {file.name} holds no names.") from error
    for name in pc.unique(names).to_pylist():
        if name is not None:
            yield name, _samples(table.filter(pc.equal(names, name)), columns, meanings, file)


def _columns(table: pa.Table, file: Path) -> dict[str, str]:
    there = {name.strip().casefold(): name for name in table.column_names}
    found = {
        part: there[name] for part, names in NAMES.items() for name in names[::-1] if name in there
    }
    missing = [part for part in NEEDED if part not in found]
    if missing:
        raise ExportRefused(
            f"{file.name} has no column {' and no column '.join(missing)}; "
            f"it has {', '.join(table.column_names[:20])}."
        )
    return found


def _samples(
    table: pa.Table, columns: dict[str, str], meanings: Mapping[int | str, Mode], file: Path
) -> Samples:
    times = table.column(columns["time"])
    if not pa.types.is_timestamp(times.type) or times.type.tz is None:
        raise ExportRefused(
            f"The times of {file.name} are {times.type}; they must be timestamps with a time zone, "
            "such as timestamp[us, tz=UTC]."
        )
    stamps = times.cast(pa.timestamp("us", "UTC"), safe=False).cast(pa.int64())
    known = pc.is_valid(stamps)
    table, stamps = table.filter(known), stamps.filter(known)
    order = np.argsort(stamps.to_numpy(), kind="stable")
    time = stamps.to_numpy()[order]
    # Of two rows at one instant the later one counts, as in the sample store.
    last = np.r_[time[1:] != time[:-1], True] if time.size else np.zeros(0, np.bool_)
    rows = order[last]
    missing = np.full(rows.size, np.nan)
    return Samples(
        time=time[last].view("datetime64[us]"),
        pv=_values(table, columns["pv"], file)[rows],
        op=_values(table, columns["op"], file)[rows],
        sp=_values(table, columns["sp"], file)[rows] if "sp" in columns else missing,
        mode=_modes(table, columns.get("mode"), meanings, file)[rows],
    )


def _values(table: pa.Table, column: str, file: Path) -> Real:
    try:
        cells = table.column(column).cast(pa.float64())
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
        raise ExportRefused(f"Column {column} of {file.name} does not hold numbers.") from error
    values = cells.to_numpy().astype(np.float64)
    return np.where(np.isfinite(values), values, np.nan)


def _modes(
    table: pa.Table, column: str | None, meanings: Mapping[int | str, Mode], file: Path
) -> Codes:
    unknown = int(Mode.UNKNOWN)
    if column is None:
        return np.full(table.num_rows, unknown, np.int8)
    cells = table.column(column)
    if table.schema.names == FILE_SCHEMA.names:  # the sample store's own files
        return np.asarray(cells.fill_null(unknown).to_numpy(), dtype=np.int8)
    if pa.types.is_nested(cells.type):
        raise ExportRefused(f"Column {column} of {file.name} holds no modes, but {cells.type}.")
    words = cells.to_pylist()
    known: dict[object, Mode] = dict(Mode.__members__) | dict(meanings.items())
    foreign = {word for word in set(words) if word is not None and _word(word) not in known}
    if any(not isinstance(word, str) for word in foreign):
        raise ExportRefused(
            f"Column {column} of {file.name} holds the mode codes "
            f"{', '.join(sorted(map(str, foreign)))}; state what they mean, such as 1=AUTO."
        )
    return np.array([known.get(_word(word), Mode.UNKNOWN) for word in words], np.int8)


def _word(cell: object) -> object:
    return cell.strip().upper() if isinstance(cell, str) else cell
