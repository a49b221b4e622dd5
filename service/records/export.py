"""From an uploaded file to the samples of one loop in UTC, with everything that was decided."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from historian.csv_file import read_export
from historian.errors import ExportRefused
from historian.export import Export, LoopSamples
from historian.options import ReadOptions
from historian.samples import Samples, Times
from loop.record import Mode
from service.plain_json import plain
from service.records.progress import Progress

ROWS_AT_ONCE = 250_000
LONGEST = 200 * 365.25 * 86_400.0  # s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopExport:
    """The part of an export that belongs to one loop.

    Attributes
    ----------
    decisions, accounting : dict
        How the file was read and what became of every row, as JSON can say it.
    rows : int
        Number of samples.
    samples : iterator of Samples
        The samples, a part at a time.
    """

    decisions: dict[str, object]
    accounting: dict[str, object]
    rows: int
    samples: Iterator[Samples]


def loop_export(
    path: Path,
    size: int,
    *,
    options: ReadOptions,
    tag: str | None,
    loop_tag: str,
    start: datetime | None,
    progress: Progress,
) -> LoopExport:
    """Read an export and take one loop out of it.

    Parameters
    ----------
    path : Path
        The file.
    size : int
        Its length. [byte]
    options : ReadOptions
        What the sender states about it.
    tag : str, optional
        Loop of the file to take, as the sender names it.
    loop_tag : str
        Tag of the loop it was sent for; chooses where the sender does not.
    start : datetime, optional
        Instant of time 0 of a file that tells elapsed time.
    progress : Progress
        Told how far it is.

    Raises
    ------
    ExportRefused
        The file is no export, the loop is not in it, or its instants are not known.
    """
    export = read_export(path, options=options, progress=progress.counter("reading", size))
    loop = _loop_of(export, tag, loop_tag)
    time = _in_utc(export, loop, start)
    if not time.size:
        raise ExportRefused("The loop has no sample with a time; there is nothing to store.")
    decisions = _dictionary(export.decisions) | {
        "loop": loop.tag,
        "tags": dict(loop.tags),
        "held": list(loop.held),
        "start": None if start is None else start.isoformat(),
        "pv_unit": loop.pv_unit,
        "op_unit": loop.op_unit,
        "other_loops": sorted(tag for tag in {*export.loops, *export.incomplete} - {loop.tag}),
    }
    return LoopExport(
        decisions=decisions,
        accounting=_dictionary(loop.accounting),
        rows=time.size,
        samples=_parts(time, loop, progress),
    )


def _loop_of(export: Export, stated: str | None, loop_tag: str) -> LoopSamples:
    """Choose the loop: the one that is named, the one with the loop's tag, or the only one.

    A name that the file does not know is refused, unless the file gives its only loop no name.
    """
    wanted = stated
    if wanted is None and loop_tag in {*export.loops, *export.incomplete}:
        wanted = loop_tag
    if wanted is not None and wanted in export.loops:
        return export.loops[wanted]
    only = next(iter(export.loops)) if len(export.loops) == 1 else None
    if only is not None and (wanted is None or only == ""):
        return export.loops[only]
    export.record(wanted)  # says why there is no such loop, or which there are
    raise ExportRefused(f"The file holds no loop {wanted!r}.")


def _in_utc(export: Export, loop: LoopSamples, start: datetime | None) -> Times:
    if loop.time.dtype == np.float64:
        if start is None:
            raise ExportRefused(
                "The file tells elapsed time only; state the instant of its time 0 with "
                "start=2026-01-31T08:00:00Z."
            )
        if np.max(np.abs(loop.time)) > LONGEST:
            raise ExportRefused("The elapsed time runs over 200 years; check its unit.")
        origin = np.datetime64(start.astimezone(UTC).replace(tzinfo=None), "us")
        return origin + np.round(loop.time.astype(np.float64) * 1e6).astype("timedelta64[us]")
    if export.time_zone is None:
        raise ExportRefused(
            "The times of the file do not say their zone; state it, such as "
            "time_zone=Europe/Berlin or time_zone=UTC."
        )
    return loop.time.astype("datetime64[us]")


def _parts(time: Times, loop: LoopSamples, progress: Progress) -> Iterator[Samples]:
    nothing = np.full(min(time.size, ROWS_AT_ONCE), np.nan)
    unknown = np.full(min(time.size, ROWS_AT_ONCE), int(Mode.UNKNOWN), np.int8)
    for first in range(0, time.size, ROWS_AT_ONCE):
        part = slice(first, first + ROWS_AT_ONCE)
        rows = time[part].size
        yield Samples(
            time=time[part],
            pv=loop.pv[part],
            sp=nothing[:rows] if loop.sp is None else loop.sp[part],
            op=loop.op[part],
            mode=unknown[:rows] if loop.mode is None else loop.mode[part],
        )
        progress.tell("storing", first + rows, time.size)


def _dictionary(value: object) -> dict[str, object]:
    written = plain(value)
    assert isinstance(written, dict)  # noqa: S101 - a dataclass is written as one
    return written
