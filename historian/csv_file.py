"""Read a historian's CSV export: decide once from its start, then one walk through all of it."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from historian.accounting import Ledger
from historian.archives import opened
from historian.assembly import assemble
from historian.encoding import Block, blocks
from historian.export import Decisions, Export
from historian.options import ReadOptions
from historian.planning import plan_for, read_head
from historian.sentences import decisions_of
from historian.walk import Walk

DECIDE_ALL = ReadOptions()


def read_export(
    path: Path | str,
    *,
    options: ReadOptions = DECIDE_ALL,
    progress: Callable[[int], None] | None = None,
) -> Export:
    """Read an export: sniff its start, say what was decided, account for every row.

    Parameters
    ----------
    path : Path or str
        The file: text, or one text in a gzip or zip archive.
    options : ReadOptions
        Overrides of single decisions.
    progress : callable, optional
        Told how far the file, packed as it is, has been read. [bytes]

    Returns
    -------
    Export
        Loops, signals, decisions and accounting.

    Raises
    ------
    ExportRefused
        Where the file is no export, or a decision has several answers and the user must state it.
    """
    path = Path(path)
    plan = plan_for(path, options)
    ledger = Ledger(options.max_rejections)
    walk = Walk(plan, ledger)
    with opened(path, options.max_bytes) as (reader, _):
        walked = blocks(reader, read_head(reader), plan.encoding, progress)
        streams = walk.streams(_from_line(walked, plan.table.first_line))
    return assemble(plan, streams, ledger)


def decide(path: Path | str, *, options: ReadOptions = DECIDE_ALL) -> Decisions:
    """Say how a file would be read, from its start alone.

    Raises
    ------
    ExportRefused
        As `read_export`.
    """
    return decisions_of(plan_for(Path(path), options))


def _from_line(walked: Iterable[Block], first_line: int) -> Iterator[Block]:
    """Leave out the lines before the first sample."""
    for block in walked:
        skipped = first_line - block.first_line
        if skipped <= 0:
            yield block
            continue
        if skipped < block.ends.size:
            start = int(block.ends[skipped - 1])
            yield replace(
                block,
                first_line=first_line,
                data=block.data[start:],
                ends=block.ends[skipped:] - start,
            )
