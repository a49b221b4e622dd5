"""What an upload changes on one day: the files to add and the files they stand for."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from historian.sample_layout import SampleFile, bucket_of, regrouped, tables_of, write_file
from historian.sample_reading import block_of, read_files, read_loop, rows_in
from historian.sample_rows import Rows, merge
from loop.signals import Flags

ROWS_AT_ONCE = 250_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One day of an upload, written to disk but not yet committed.

    Attributes
    ----------
    seen : frozenset of str
        Paths of the stored files the change was worked out against; it holds while they stay.
    add, remove : tuple of SampleFile
        Files written, and stored files that they replace.
    new, replaced, unchanged : int
        Rows at instants not stored before, rows that change a stored one, rows that do not.
    """

    seen: frozenset[str]
    add: tuple[SampleFile, ...]
    remove: tuple[SampleFile, ...]
    new: int
    replaced: int
    unchanged: int


def change_day(
    folder: Path, loop: str, day: date, uploaded: Rows, stored_files: Sequence[SampleFile]
) -> Change:
    """Merge a day of an upload with what is stored and write the outcome beside it.

    Instants that are new go into a file of their own. Only files in which a stored row changes are
    written again, with all the other loops they hold.

    Parameters
    ----------
    folder : Path
        Folder of the table.
    loop : str
        Name of the loop.
    day : date
        Day all rows belong to, in UTC.
    uploaded : ndarray of ROW
        Rows of the upload with strictly increasing times.
    stored_files : sequence of SampleFile
        Files of that day that may hold the loop.
    """
    known = np.zeros(uploaded.size, np.bool_)
    differs = np.zeros(uploaded.size, np.bool_)
    add: list[SampleFile] = []
    remove: list[SampleFile] = []
    try:
        for file in stored_files:
            stored = rows_in(read_loop(folder, file, loop))
            if stored.size and _lay_over(stored, uploaded, known, differs):
                add.append(_rewrite(folder, loop, file, stored))
                remove.append(file)
        new = uploaded[~known] if np.any(known) else uploaded
        if new.size:
            add.append(write_file(folder, day, bucket_of(loop), tables_of(loop, new)))
    except BaseException:
        discard(folder, add)
        raise
    return Change(
        seen=frozenset(file.path for file in stored_files),
        add=tuple(add),
        remove=tuple(remove),
        new=new.size,
        replaced=int(np.count_nonzero(differs)),
        unchanged=int(np.count_nonzero(known & ~differs)),
    )


def _lay_over(stored: Rows, uploaded: Rows, known: Flags, differs: Flags) -> bool:
    """Write an upload into stored rows, a part at a time to keep copies small.

    Marks the rows of the upload that are known, and those that differ; tells whether any does.
    """
    changed = False
    for start in range(0, uploaded.size, ROWS_AT_ONCE):
        part = slice(start, start + ROWS_AT_ONCE)
        outcome = merge(stored, uploaded[part])
        stored[outcome.places] = outcome.values
        known[part] |= outcome.known
        differs[part] |= outcome.differs
        changed = changed or outcome.places.size > 0
    return changed


def _rewrite(folder: Path, loop: str, file: SampleFile, rows: Rows) -> SampleFile:
    """Write a file again with other rows for one of its loops."""
    if file.only_holds(loop):
        return write_file(folder, file.day, file.bucket, tables_of(loop, rows))
    table = read_files(folder, [file])
    start, end = block_of(table, loop)
    parts = [table.slice(0, start), *tables_of(loop, rows), table.slice(end)]
    return write_file(folder, file.day, file.bucket, regrouped(parts))


def discard(folder: Path, files: Sequence[SampleFile]) -> None:
    """Remove files that were written but will not be committed."""
    for file in files:
        (folder / file.path).unlink(missing_ok=True)
