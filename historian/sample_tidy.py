"""Keeping the table quick: small files joined, the log shortened, dead files deleted."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from deltalake.exceptions import CommitFailedError

from historian.sample_change import discard
from historian.sample_layout import SampleFile, regrouped, write_file
from historian.sample_log import SampleLog
from historian.sample_reading import read_files

ROWS_A_FILE = 1_000_000  # the most that is joined into one file, about 100 MB of memory
MOST_TIMES_LARGER = 8  # so that a sample is written again a few times at most, however it comes


@dataclass(frozen=True, slots=True, kw_only=True)
class Tidied:
    """What tidying did.

    Attributes
    ----------
    joined : int
        Small files that were joined with others.
    written : int
        Files they were joined into.
    left : int
        Small files left for another time because an upload changed them meanwhile.
    deleted : int
        Files deleted that no version of the last hours refers to.
    """

    joined: int
    written: int
    left: int
    deleted: int


def tidy(folder: Path, log: SampleLog, *, keep_hours: int) -> Tidied:
    """Join small files a partition at a time, write a checkpoint, delete dead files.

    Every partition is a commit of its own: stopped at any moment, the table is whole, and what is
    left over is joined the next time.

    Parameters
    ----------
    folder : Path
        Folder of the table.
    log : SampleLog
        View of the table that nobody else uses meanwhile.
    keep_hours : int
        Time for which files that were replaced stay readable. [h]
    """
    joined = written = left = 0
    for heap in list(_heaps(log.files())):
        table = read_files(folder, heap)
        file = write_file(folder, heap[0].day, heap[0].bucket, regrouped([table]))
        try:
            log.commit([file], heap)
        except CommitFailedError:
            discard(folder, [file])
            log.refresh()
            left += len(heap)
        else:
            joined, written = joined + len(heap), written + 1
    log.checkpoint()
    return Tidied(
        joined=joined, written=written, left=left, deleted=log.clean(keep_hours=keep_hours)
    )


def _heaps(files: Sequence[SampleFile]) -> Iterator[list[SampleFile]]:
    """Choose files of one partition to join, each heap within `ROWS_A_FILE`."""

    def place(file: SampleFile) -> tuple[str, int, int, str]:
        # Of like size by loop, so that files hold ranges of loops and one loop is in few of them.
        return file.day.isoformat(), file.bucket, file.rows.bit_length(), file.first_loop

    for _, members in itertools.groupby(sorted(files, key=place), lambda file: place(file)[:2]):
        heap: list[SampleFile] = []
        rows = 0
        for file in members:
            # Sorted by size: a file far larger than all before it is not written again for them.
            if rows + file.rows > ROWS_A_FILE or (heap and file.rows > MOST_TIMES_LARGER * rows):
                if len(heap) > 1:
                    break
                heap, rows = [], 0
            heap.append(file)
            rows += file.rows
        if len(heap) > 1:
            yield heap
