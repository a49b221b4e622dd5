"""The sample store: every loop's sp, pv, op and mode over time, in an open Delta Lake table.

Uploading again changes nothing, overlapping exports merge, late data lands where it belongs, and an
upload is in as a whole or not at all. Design and measurements: docs/methods/sample-store.md.
"""

import contextlib
import errno
import itertools
import random
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import date, datetime
from pathlib import Path
from uuid import UUID

import numpy as np
import pyarrow as pa
from deltalake.exceptions import CommitFailedError, DeltaError

from historian.sample_change import Change, change_day, discard
from historian.sample_layout import SampleFile, bucket_of, day_of, loops_apart
from historian.sample_log import SampleLog
from historian.sample_reading import read_files, read_loop, samples_by_loop, samples_in
from historian.sample_recovery import WAITING, sweep_staging
from historian.sample_rows import rows_of, sorted_once
from historian.sample_spool import Spool
from historian.sample_tidy import Tidied, tidy
from historian.samples import EARLIEST, LATEST, Samples, instant, microseconds
from loop.errors import DiskFull, LoopError, NoSamples, StoreBusy

ATTEMPTS = 60
LONGEST_WAIT = 0.5  # s
ROWS_AT_ONCE = 250_000
READERS = 4
DEAD_AFTER = 3600.0  # s without a write, after which the writer of a staging file counts as dead
BEGINNING, END = (int(limit.astype(np.int64)) for limit in (EARLIEST, LATEST))
LONGEST_NAME = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class WriteResult:
    """What an upload did.

    Attributes
    ----------
    rows : int
        Rows that were handed in.
    new, replaced, unchanged : int
        Instants that were not stored before, that changed, that brought nothing new.
    repeated : int
        Rows that share their instant with a later row of the same upload.
    first, last : datetime or None
        Earliest and latest instant of the upload in UTC, none if it had no rows.
    """

    rows: int
    new: int
    replaced: int
    unchanged: int
    repeated: int
    first: datetime | None
    last: datetime | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """How much is stored of a loop.

    Attributes
    ----------
    rows : int
        Number of samples.
    first, last : datetime
        Earliest and latest sample in UTC.
    """

    rows: int
    first: datetime
    last: datetime


class SampleStore:
    """Samples of all loops in one folder, for several threads and processes at once.

    Parameters
    ----------
    folder : Path
        Folder of the table; it is made if it is not there.
    dead_after : float
        Age at which a file left by a killed writer is removed when the store is opened. [s]
    """

    def __init__(self, folder: Path, *, dead_after: float = DEAD_AFTER) -> None:
        self._folder = folder.resolve()
        self._reading = threading.Lock()
        self._writing = threading.Lock()
        # Two views, so that a reader never moves the version a writer's commit is checked against.
        self._read_log = SampleLog(self._folder)
        self._write_log = SampleLog(self._folder)
        sweep_staging(self._folder, older_than=dead_after)

    def write(
        self,
        loop_id: str | UUID,
        samples: Samples | Iterable[Samples],
        *,
        progress: Callable[[int], None] | None = None,
    ) -> WriteResult:
        """Take in samples of a loop, all of them or none, and answer once they are on the disk.

        Of two values for one cell (a signal at an instant) the newer upload's stays, and within an
        upload the later row's. A gap (NaN, unknown mode) never erases a stored value.

        Parameters
        ----------
        loop_id : str or UUID
            Name of the loop in the store.
        samples : Samples or iterable of Samples
            The samples, in any order; many of them best come in chunks.
        progress : callable, optional
            Told how many rows are merged, once all have come in.

        Raises
        ------
        StoreBusy
            Other writers changed the same files time after time. Nothing is stored.
        DiskFull
            The disk has no room. Nothing is stored.
        """
        loop = _name(loop_id)
        chunks = [samples] if isinstance(samples, Samples) else samples
        try:
            with Spool(self._folder / WAITING) as spool:
                for chunk in chunks:
                    for start in range(0, len(chunk), ROWS_AT_ONCE):
                        spool.add(rows_of(chunk, start, start + ROWS_AT_ONCE))
                with self._writing:
                    return self._take_in(loop, spool, progress or (lambda _: None))
        except (OSError, DeltaError, pa.ArrowException) as error:
            if _is_full(error):
                raise DiskFull from error
            raise

    def _take_in(self, loop: str, spool: Spool, progress: Callable[[int], None]) -> WriteResult:
        changes: dict[date, Change] = {}
        try:
            self._commit_in_turn(loop, spool, changes, progress)
        except BaseException:
            self._forget(changes)
            raise
        return _result(spool, changes)

    def _commit_in_turn(
        self,
        loop: str,
        spool: Spool,
        changes: dict[date, Change],
        progress: Callable[[int], None],
    ) -> None:
        for attempt in range(ATTEMPTS):
            self._write_log.refresh()
            self._work_out(loop, spool, changes, progress)
            with contextlib.suppress(CommitFailedError):
                self._commit(loop, changes)
                return
            # A random wait that grows, so that writers step out of each other's way.
            wait = min(LONGEST_WAIT, 0.005 * 2.0**attempt)
            time.sleep(random.uniform(0, wait))  # noqa: S311
        raise StoreBusy(ATTEMPTS)

    def _work_out(
        self,
        loop: str,
        spool: Spool,
        changes: dict[date, Change],
        progress: Callable[[int], None],
    ) -> None:
        """Bring the change of every day up to the version the log shows now."""
        days = spool.days()
        if not days:
            return
        stored: dict[date, list[SampleFile]] = {day: [] for day in days}
        for file in self._write_log.files(
            bucket=bucket_of(loop), loop=loop, first_day=days[0], last_day=days[-1]
        ):
            if file.day in stored:
                stored[file.day].append(file)
        for day in days:
            known = changes.get(day)
            if known is not None:
                if known.seen == {file.path for file in stored[day]}:
                    continue
                discard(self._folder, changes.pop(day).add)
            rows = sorted_once(spool.of_day(day))
            changes[day] = change_day(self._folder, loop, day, rows, stored[day])
            progress(sum(done.new + done.replaced + done.unchanged for done in changes.values()))

    def _commit(self, loop: str, changes: dict[date, Change]) -> None:
        add = [file for change in changes.values() for file in change.add]
        remove = [file for change in changes.values() for file in change.remove]
        if add:
            self._write_log.commit(add, remove, loop=loop)
        else:  # all of it is in already, perhaps by a writer that was killed before it was safe
            self._write_log.secure()

    def _forget(self, changes: dict[date, Change]) -> None:
        """Remove files of a failed upload, unless the log took them in before it failed."""
        files = [file for change in changes.values() for file in change.add]
        # Where even that cannot be found out the files stay, and `tidy` removes them later.
        with contextlib.suppress(DeltaError, LoopError, OSError):
            if files and not self._write_log.holds(files[0]):
                discard(self._folder, files)

    def read(
        self, loop_id: str | UUID, start: datetime | None = None, end: datetime | None = None
    ) -> Samples:
        """Read the samples of a loop with start <= time < end, in order of time.

        Parameters
        ----------
        loop_id : str or UUID
            Name of the loop in the store.
        start, end : datetime, optional
            Bounds with a time zone. Default: everything.

        Returns
        -------
        Samples
            Times increase strictly; empty where the loop has no sample in the range.

        Raises
        ------
        NoSamples
            Nothing is stored of this loop at all.
        ValueError
            A bound has no time zone, or start is after end.
        """
        loop = _name(loop_id)
        since, until = _range(start, end)
        files = self._listed(
            bucket=bucket_of(loop), loop=loop, first_day=day_of(since), last_day=day_of(until)
        )
        found = self._found(loop, files, since, until)
        if not len(found):
            self.span(loop)  # says so where there is nothing of the loop at all
        return found

    def read_in_parts(
        self, loop_id: str | UUID, start: datetime | None = None, end: datetime | None = None
    ) -> Iterator[Samples]:
        """Read as `read` does, a day in memory at a time, in order of time.

        A loop or range without samples gives nothing.
        """
        loop = _name(loop_id)
        since, until = _range(start, end)
        files = self._listed(
            bucket=bucket_of(loop), loop=loop, first_day=day_of(since), last_day=day_of(until)
        )
        for _, of_day in itertools.groupby(files, lambda file: file.day):
            found = self._found(loop, list(of_day), since, until)
            if len(found):
                yield found

    def read_day(self, day: date) -> Iterator[tuple[str, Samples]]:
        """Go through all loops of one day in UTC, each file read once.

        What files have loops in common is in memory at a time: after `tidy` about a million rows.
        Loops come in no particular order; a day without samples gives nothing.
        """
        for files in loops_apart(self._listed(first_day=day, last_day=day)):
            yield from samples_by_loop(read_files(self._folder, files))

    def span(self, loop_id: str | UUID) -> Span:
        """Tell how much is stored of a loop.

        Raises
        ------
        NoSamples
            Nothing is stored of this loop.
        """
        loop = _name(loop_id)
        rows, first, last = 0, END, BEGINNING
        for file in self._listed(bucket=bucket_of(loop), loop=loop):
            if file.only_holds(loop):
                rows += file.rows
                first, last = min(first, file.first_time), max(last, file.last_time)
                continue
            times = read_loop(self._folder, file, loop, columns=())["time"].cast(pa.int64())
            if len(times):
                rows += len(times)
                first, last = min(first, times[0].as_py()), max(last, times[-1].as_py())
        if not rows:
            raise NoSamples(loop)
        return Span(rows=rows, first=instant(first), last=instant(last))

    def tidy(self, *, keep_hours: int = 24) -> Tidied:
        """Join small files, write a checkpoint and delete what nobody can be reading any more.

        Parameters
        ----------
        keep_hours : int
            Time for which files that were replaced stay readable. No reader and no upload may take
            longer. [h]
        """
        with self._writing:
            self._write_log.refresh()
            return tidy(self._folder, self._write_log, keep_hours=keep_hours)

    def _listed(
        self,
        *,
        bucket: int | None = None,
        first_day: date | None = None,
        last_day: date | None = None,
        loop: str | None = None,
    ) -> list[SampleFile]:
        with self._reading:
            self._read_log.refresh()
            return self._read_log.files(
                bucket=bucket, first_day=first_day, last_day=last_day, loop=loop
            )

    def _found(self, loop: str, files: Sequence[SampleFile], since: int, until: int) -> Samples:
        with ThreadPoolExecutor(READERS) as readers:
            tables = list(readers.map(lambda file: read_loop(self._folder, file, loop), files))
        return samples_in(tables).between(since, until)


def _range(start: datetime | None, end: datetime | None) -> tuple[int, int]:
    since = BEGINNING if start is None else microseconds(start)
    until = END if end is None else microseconds(end)
    if since > until:
        raise ValueError(f"start must not be after end, got {start} and {end}")
    # Nothing is stored beyond, and not every instant there has a day in the calendar.
    return max(BEGINNING, min(since, END)), max(BEGINNING, min(until, END))


def _name(loop_id: str | UUID) -> str:
    loop = str(loop_id)
    if not loop or len(loop) > LONGEST_NAME or not loop.isprintable():
        raise ValueError(f"a loop needs a name of 1 to {LONGEST_NAME} printable characters")
    return loop


def _result(spool: Spool, changes: dict[date, Change]) -> WriteResult:
    new = sum(change.new for change in changes.values())
    replaced = sum(change.replaced for change in changes.values())
    unchanged = sum(change.unchanged for change in changes.values())
    return WriteResult(
        rows=spool.rows,
        new=new,
        replaced=replaced,
        unchanged=unchanged,
        repeated=spool.rows - new - replaced - unchanged,
        first=None if spool.first is None else instant(spool.first),
        last=None if spool.last is None else instant(spool.last),
    )


def _is_full(error: Exception) -> bool:
    """Tell whether the disk or its quota is full; Delta says so only in words."""
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return True
    return "No space left on device" in str(error)
