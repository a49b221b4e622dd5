"""A long export a part at a time, so that its length does not decide the memory it takes.

Only where the parts do not need each other: in a wide file. In the other layouts a signal is held
from samples that may lie anywhere in the file, so those are read as one part: some 40 bytes of
memory for each row of a long file, 16 and more for each sample of a file of pairs. Local time needs
the order of the rows around the hour that repeats in autumn: no part ends within two days of it.
"""

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from historian.accounting import Accounting, Ledger
from historian.archives import opened
from historian.assembly import assemble
from historian.csv_file import read_export
from historian.encoding import Block, blocks
from historian.export import Export, Times
from historian.options import Layout, ReadOptions
from historian.plan import Plan
from historian.planning import plan_for, read_head
from historian.timestamps import SECOND
from historian.walk import Walk
from historian.zones import changes_between, zone_named

PART_BYTES = 16_000_000
LAST_ROWS = 20
AROUND = 2 * 86_400  # s
UNEVEN, EVEN = 10.0, 1.5  # usual spacings that make a gap, as `historian.series` counts them


def read_in_parts(
    path: Path,
    *,
    options: ReadOptions,
    progress: Callable[[int], None] | None = None,
    part_bytes: int = PART_BYTES,
) -> Iterator[Export]:
    """Read an export as `read_export` does, in parts of consecutive rows where that is possible.

    Parameters
    ----------
    path : Path
        The file.
    options : ReadOptions
        Overrides of single decisions.
    progress : callable, optional
        Told how far the file has been read. [bytes]
    part_bytes : int
        Text in a part, roughly. [bytes]

    Yields
    ------
    Export
        A part. Its account counts rows kept, duplicates and gaps of the part, and everything else
        from the start of the file; `RunningAccount` adds them up.

    Raises
    ------
    ExportRefused
        As `read_export`.
    """
    plan = plan_for(path, options)
    if not _can_be_parted(plan):
        yield read_export(path, options=options, progress=progress)
        return
    ledger = Ledger(options.max_rejections)
    walk = Walk(plan, ledger)
    kept = False
    with opened(path, options.max_bytes) as (reader, _):
        walked = _from_line(
            blocks(reader, read_head(reader), plan.encoding, progress), plan.table.first_line
        )
        for first in walked:
            streams = walk.streams(_part(plan, first, walked, part_bytes))
            if any(stream.instants.size for stream in streams):
                kept = True
                yield assemble(plan, streams, ledger)
    if not kept:
        assemble(plan, [], ledger)  # says why no row of the file could be read


def _can_be_parted(plan: Plan) -> bool:
    zoned = plan.time.is_utc or plan.options.time_zone is not None
    timed = plan.time.is_elapsed or (plan.time.is_calendar and zoned)
    return plan.assignment.layout is Layout.WIDE and timed


def _from_line(walked: Iterable[Block], first_line: int) -> Iterator[Block]:
    """Leave out the lines before the first sample."""
    for block in walked:
        skipped = max(0, first_line - block.first_line)
        if skipped < block.ends.size:
            start = int(block.ends[skipped - 1]) if skipped else 0
            yield replace(
                block,
                first_line=block.first_line + skipped,
                data=block.data[start:],
                ends=block.ends[skipped:] - start,
            )


def _part(plan: Plan, first: Block, walked: Iterator[Block], part_bytes: int) -> Iterator[Block]:
    """Take blocks up to the size of a part, and on to where it may end."""
    taken = 0
    for block in itertools.chain([first], walked):
        yield block
        taken += len(block.data)
        if taken >= part_bytes and _may_end_with(block, plan):
            return


def _may_end_with(block: Block, plan: Plan) -> bool:
    """Tell whether no clock is set around the last rows of a block."""
    if plan.options.time_zone is None or plan.time.is_utc or plan.time.is_elapsed:
        return True
    row = max(0, block.ends.size - LAST_ROWS)
    start = int(block.ends[row - 1]) if row else 0
    end = replace(block, data=block.data[start:], ends=block.ends[row:] - start)
    streams = Walk(plan, Ledger(0)).streams([end])
    times = [instant // SECOND for stream in streams for instant in stream.instants.tolist()]
    if not times:
        return False
    zone = zone_named(plan.options.time_zone)
    around = changes_between(zone, int(min(times)) - AROUND, int(max(times)) + AROUND)
    return not around[1]


@dataclass(slots=True)
class RunningAccount:
    """The account of one loop over all parts of a file."""

    _parts: list[Accounting] = field(default_factory=list)
    _ends: list[tuple[float, float]] = field(default_factory=list)

    def add(self, accounting: Accounting, time: Times) -> None:
        """Add a part, whose times are in order."""
        if time.size:
            seconds = (time[0], time[-1])
            if time.dtype != np.float64:
                seconds = tuple(t.astype("datetime64[ns]").astype(np.int64) / 1e9 for t in seconds)
            self._ends.append((float(seconds[0]), float(seconds[1])))
        self._parts.append(accounting)

    def total(self) -> Accounting:
        """Add up what the parts count on their own; the rest has been counted through."""
        if len(self._parts) == 1:
            return self._parts[0]
        spacings = [part.sample_time for part in self._parts if part.sample_time > 0]
        usual = float(np.median(spacings)) if spacings else 0.0
        irregular = any(part.irregular for part in self._parts)
        ordered = sorted(self._ends)
        between = np.array([late[0] - early[1] for early, late in itertools.pairwise(ordered)])
        gaps = between[between > (UNEVEN if irregular else EVEN) * usual]
        return replace(
            self._parts[-1],
            rows_kept=sum(part.rows_kept for part in self._parts),
            duplicates=sum(part.duplicates for part in self._parts),
            conflicts=sum(part.conflicts for part in self._parts),
            gaps=sum(part.gaps for part in self._parts) + int(gaps.size),
            longest_gap=max(*(part.longest_gap for part in self._parts), *gaps.tolist(), 0.0),
            sample_time=usual,
            irregular=irregular,
            span=max(end for _, end in ordered) - ordered[0][0],
            disordered=any(part.disordered for part in self._parts)
            or bool(np.any(between < 0))
            or self._ends not in (ordered, ordered[::-1]),  # newest first is an order, too
        )
