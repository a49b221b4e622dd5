"""From an uploaded file to the samples of one loop in UTC, with everything that was decided."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from historian.errors import ExportRefused
from historian.export import Export, LoopSamples, Times
from historian.export_parts import RunningAccount, read_in_parts
from historian.options import ReadOptions
from historian.samples import Samples
from loop.record import Mode
from service.plain_json import plain
from service.records.progress import Progress

LONGEST = 200 * 365.25 * 86_400.0  # s


class LoopExport:
    """The part of an export that belongs to one loop, read while its samples are taken.

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

    Attributes
    ----------
    rows : int
        Samples so far.
    """

    def __init__(
        self,
        path: Path,
        size: int,
        *,
        options: ReadOptions,
        tag: str | None,
        loop_tag: str,
        start: datetime | None,
        progress: Progress,
    ) -> None:
        self.rows = 0
        self._parts = read_in_parts(
            path, options=options, progress=progress.counter("reading", size)
        )
        self._tag = tag
        self._loop_tag = loop_tag
        self._start = start
        self._account = RunningAccount()
        self._decisions: dict[str, object] = {}

    def samples(self) -> Iterator[Samples]:
        """Read the file and give the loop's samples, a part at a time.

        Raises
        ------
        ExportRefused
            The file is no export, the loop is not in it, or its instants are not known.
        """
        for part in self._parts:
            loop = _loop_of(part, self._tag, self._loop_tag)
            time = _in_utc(part, loop, self._start)
            self._account.add(loop.accounting, loop.time)
            self._decisions = self._decided(part, loop)
            self.rows += time.size
            samples = _samples(time, loop)
            del part, loop, time  # the other signals of a long file need not wait for the writing
            if len(samples):
                yield samples
        if not self.rows:
            raise ExportRefused("The loop has no sample with a time; there is nothing to store.")

    def decisions(self) -> dict[str, object]:
        """Tell how the file was read, as JSON can say it, after its samples were taken."""
        return self._decisions

    def accounting(self) -> dict[str, object]:
        """Tell what became of every row, as JSON can say it, after its samples were taken."""
        return _dictionary(self._account.total())

    def _decided(self, part: Export, loop: LoopSamples) -> dict[str, object]:
        return _dictionary(part.decisions) | {
            "loop": loop.tag,
            "tags": dict(loop.tags),
            "held": list(loop.held),
            "start": None if self._start is None else self._start.isoformat(),
            "pv_unit": loop.pv_unit,
            "op_unit": loop.op_unit,
            "other_loops": sorted({*part.loops, *part.incomplete} - {loop.tag}),
        }


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
        if loop.time.size and np.max(np.abs(loop.time)) > LONGEST:
            raise ExportRefused("The elapsed time runs over 200 years; check its unit.")
        origin = np.datetime64(start.astimezone(UTC).replace(tzinfo=None), "us")
        return origin + np.round(loop.time.astype(np.float64) * 1e6).astype("timedelta64[us]")
    if export.time_zone is None:
        raise ExportRefused(
            "The times of the file do not say their zone; state it, such as "
            "time_zone=Europe/Berlin or time_zone=UTC."
        )
    return loop.time.astype("datetime64[us]")


def _samples(time: Times, loop: LoopSamples) -> Samples:
    return Samples(
        time=time.astype("datetime64[us]"),
        pv=loop.pv,
        sp=np.broadcast_to(np.nan, time.shape) if loop.sp is None else loop.sp,
        op=loop.op,
        mode=np.full(time.size, int(Mode.UNKNOWN), np.int8) if loop.mode is None else loop.mode,
    )


def _dictionary(value: object) -> dict[str, object]:
    written = plain(value)
    assert isinstance(written, dict)  # noqa: S101 - a dataclass is written as one
    return written
