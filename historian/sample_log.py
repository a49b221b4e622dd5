"""The table's log: which files are in, and the one atomic commit that changes it.

Delta writes its log without fsync, which is safe against a killed process and not against a power
cut. A commit here returns only once its data files, its log entry, the entries before it that
another writer may not have secured yet, and their folders are on the disk.
"""

import contextlib
import json
import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import date
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from deltalake import CommitProperties, DeltaTable, PostCommitHookProperties, Transaction
from deltalake.exceptions import DeltaError, TableNotFoundError
from deltalake.transaction import AddAction, RemoveAction

from historian.arrow_views import array_of_flags, array_of_text, as_flags, whole_number
from historian.sample_layout import PARTITIONS, TABLE_SCHEMA, SampleFile
from historian.sample_recovery import set_aside_torn_entries
from historian.samples import EPOCH
from loop.errors import StoreDamaged

CHECKPOINT_EVERY = 50  # log entries that opening the table may have to read
# Everybody who commits secures this many entries, so that none before an answered one is torn.
SECURED_ENTRIES = 64
AT_ONCE = 8
SETTINGS = {
    "delta.deletedFileRetentionDuration": "interval 1 days",
    "delta.logRetentionDuration": "interval 30 days",
}
FIRST_NAME, LAST_NAME = "", "\U0010ffff"
NO_HOOKS = PostCommitHookProperties(create_checkpoint=False, cleanup_expired_logs=False)


class SampleLog:
    """One reader's or writer's view of the table: a version that moves only when told to.

    Not for two threads at once: a commit is checked against the version that was read, and that
    must not move in between.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._entries = folder / "_delta_log"
        self._table = self._open()
        self._listing: tuple[int, pa.Table] | None = None  # of a version, which never changes
        self._lasting_entries = -1  # log entries up to this one are known to be on the disk
        self._lasting_folders = {folder}  # and these folders to be entered in theirs

    def _open(self) -> DeltaTable:
        try:
            return DeltaTable(self._folder)
        except TableNotFoundError:
            return self._create()
        except DeltaError as error:
            if not set_aside_torn_entries(self._entries):
                raise StoreDamaged(_first_line(error)) from error
        try:
            return DeltaTable(self._folder)
        except DeltaError as error:
            raise StoreDamaged(_first_line(error)) from error

    def _create(self) -> DeltaTable:
        self._folder.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(DeltaError):  # another process may create it at this moment
            DeltaTable.create(
                self._folder, TABLE_SCHEMA, partition_by=list(PARTITIONS), configuration=SETTINGS
            )
        try:
            table = DeltaTable(self._folder)
        except DeltaError as error:
            raise StoreDamaged(_first_line(error)) from error
        _secure([self._entry(0), self._entries, self._folder, self._folder.parent])
        return table

    @property
    def version(self) -> int:
        """Number of the newest entry this view knows."""
        return int(self._table.version())

    def refresh(self) -> None:
        """Move to the newest version."""
        try:
            self._table.update_incremental()
        except DeltaError:  # entries between are cleaned away: start over from a checkpoint
            self._table = self._open()

    def files(
        self,
        *,
        bucket: int | None = None,
        first_day: date | None = None,
        last_day: date | None = None,
        loop: str | None = None,
    ) -> list[SampleFile]:
        """List the files that may hold what is asked for, by date."""
        if self._listing is None or self._listing[0] != self.version:
            listed = pa.RecordBatchReader.from_stream(self._table.get_add_actions(flatten=True))
            self._listing = self.version, listed.read_all()
        listed = self._listing[1]
        if not listed.num_rows:
            return []
        wanted = np.ones(listed.num_rows, np.bool_)

        def keep(holds: pa.ChunkedArray) -> None:
            np.logical_and(wanted, as_flags(holds.combine_chunks()), out=wanted)

        if bucket is not None:
            keep(pc.equal(listed["partition.bucket"], whole_number(bucket, pa.int32())))
        if first_day is not None:
            keep(pc.greater_equal(listed["partition.date"], _day(first_day)))
        if last_day is not None:
            keep(pc.less_equal(listed["partition.date"], _day(last_day)))
        if loop is not None:
            name = array_of_text(loop)[0]
            keep(pc.less_equal(pc.fill_null(listed["min.loop"], name), name))
            keep(pc.greater_equal(pc.fill_null(listed["max.loop"], name), name))
        found = listed.filter(array_of_flags(wanted)).sort_by("partition.date")
        return _listed(found)

    def holds(self, file: SampleFile) -> bool:
        """Tell whether a file has got in, after a commit that ended in an error."""
        self.refresh()
        return any(file.path == other.path for other in self.files(bucket=file.bucket))

    def commit(
        self,
        add: Sequence[SampleFile],
        remove: Sequence[SampleFile] = (),
        *,
        loop: str | None = None,
    ) -> None:
        """Put files in and take files out, all or nothing, and make it last.

        Parameters
        ----------
        add, remove : sequence of SampleFile
            Files written and files they stand for.
        loop : str, optional
            Loop whose samples change. Two writers of one loop are never both let in, even where
            each only adds. Without it the same samples are only arranged anew.

        Raises
        ------
        CommitFailedError
            Another writer has changed something since this view was refreshed.
        """
        self._secure_files(add)
        read = self.version
        changes = loop is not None
        written_by = [Transaction(loop, read + 1)] if loop is not None else None
        self._table.create_write_transaction(
            [*(_add(file, changes) for file in add), *(_remove(file, changes) for file in remove)],
            "append",
            TABLE_SCHEMA,
            partition_by=list(PARTITIONS),
            commit_properties=CommitProperties(app_transactions=written_by),
            post_commithook_properties=NO_HOOKS,
        )
        self.refresh()
        self.secure()
        if self.version // CHECKPOINT_EVERY > read // CHECKPOINT_EVERY:
            self.checkpoint()

    def secure(self) -> None:
        """Put the newest entries on the disk itself, whoever wrote them."""
        oldest = max(self._lasting_entries + 1, self.version - SECURED_ENTRIES)
        newest = [self._entry(version) for version in range(oldest, self.version + 1)]
        _secure([path for path in newest if path.exists()])
        _secure([self._entries])
        self._lasting_entries = self.version

    def _secure_files(self, files: Sequence[SampleFile]) -> None:
        """Put data files on the disk itself, with every folder that leads to them."""
        paths = [self._folder / file.path for file in files]
        folders = {path.parent for path in paths}
        # a partition made just now is not yet entered in the folder above it
        made = {above for path in paths for above in path.parents} - self._lasting_folders
        made = {above for above in made if self._folder in above.parents}
        _secure([*paths, *(folders | {above.parent for above in made})])
        self._lasting_folders |= made

    def checkpoint(self) -> None:
        """Write down the present state, so that opening need not read every entry."""
        # Only a shortcut: where it fails, the entries themselves still tell everything.
        with contextlib.suppress(DeltaError, OSError):
            self._table.create_checkpoint()
            hint = self._entries / "_last_checkpoint"
            _secure([*self._entries.glob(f"{self.version:020d}.checkpoint*"), hint, self._entries])

    def clean(self, *, keep_hours: int) -> int:
        """Delete files that no version of the last hours refers to; give their number."""
        gone = self._table.vacuum(
            keep_hours,
            dry_run=False,
            enforce_retention_duration=False,
            full=True,
            post_commithook_properties=NO_HOOKS,
        )
        self._table.cleanup_metadata()
        self.refresh()
        self.secure()
        return len(gone)

    def _entry(self, version: int) -> Path:
        return self._entries / f"{version:020d}.json"


def _add(file: SampleFile, changes: bool) -> AddAction:
    extent = {
        "numRecords": file.rows,
        "minValues": {"loop": file.first_loop, "time": _stamp(file.first_time)},
        "maxValues": {"loop": file.last_loop, "time": _stamp(file.last_time)},
        "nullCount": {"loop": 0, "time": 0},
    }
    return AddAction(
        path=file.path,
        size=file.size,
        partition_values=_partition(file),
        modification_time=int(time.time() * 1000),
        data_change=changes,
        stats=json.dumps(extent),
    )


def _remove(file: SampleFile, changes: bool) -> RemoveAction:
    return RemoveAction(
        path=file.path,
        data_change=changes,
        deletion_timestamp=int(time.time() * 1000),
        size=file.size,
        partition_values=_partition(file),
    )


def _partition(file: SampleFile) -> dict[str, str | None]:
    return {"date": file.day.isoformat(), "bucket": str(file.bucket)}


def _stamp(microseconds: int) -> str:
    return f"{np.datetime64(microseconds, 'us')}Z"


def _day(day: date) -> pa.Scalar:
    return whole_number((day - EPOCH.date()).days, pa.date32())


def _listed(found: pa.Table) -> list[SampleFile]:
    """Read lines of the log; what another program has left out of them counts as unbounded."""
    none = whole_number(0, pa.int64())
    columns = [
        found["path"],
        found["size_bytes"],
        pc.fill_null(found["num_records"], none),
        found["partition.date"],
        found["partition.bucket"],
        pc.fill_null(found["min.loop"], array_of_text(FIRST_NAME)[0]),
        pc.fill_null(found["max.loop"], array_of_text(LAST_NAME)[0]),
        pc.fill_null(found["min.time"].cast(pa.int64()), none),
        pc.fill_null(found["max.time"].cast(pa.int64()), none),
    ]
    return [
        SampleFile(
            path=path,
            size=size,
            rows=rows,
            day=day,
            bucket=bucket,
            first_loop=first_loop,
            last_loop=last_loop,
            first_time=first_time,
            last_time=last_time,
        )
        for path, size, rows, day, bucket, first_loop, last_loop, first_time, last_time in zip(
            *(column.to_pylist() for column in columns), strict=True
        )
    ]


def _secure(paths: Sequence[Path]) -> None:
    """Put files and folders on the disk itself, many at a time: disks take them in one go."""
    if len(paths) < 2:
        for path in paths:
            _put_on_disk(path)
        return
    with ThreadPoolExecutor(AT_ONCE) as threads:
        list(threads.map(_put_on_disk, paths))


def _put_on_disk(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]
