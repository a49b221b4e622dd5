"""One walk through the file: rows become streams of instants and values."""

from collections.abc import Iterable
from functools import partial

import numpy as np
import pyarrow as pa

from historian.accounting import NO_TIME, NOT_A_TIME, Ledger
from historian.assignment import Signal
from historian.cell_meaning import account_odd_cells, blank_bad_quality, modes_of
from historian.cells import CellReader, Cells, Words
from historian.encoding import Block
from historian.instants import InstantReader
from historian.long_rows import LongRows
from historian.options import Layout
from historian.plan import Plan
from historian.streams import GrowingStream, Stream, Values
from loop.signals import Flags


class Walk:
    """Read all blocks of a file under one plan.

    Parameters
    ----------
    plan : Plan
        What was decided.
    ledger : Ledger
        Collects the accounting.
    """

    def __init__(self, plan: Plan, ledger: Ledger) -> None:
        self._plan = plan
        self._ledger = ledger
        self._cells = CellReader(plan, ledger)
        self._instants = InstantReader(plan)

    def streams(self, blocks: Iterable[Block]) -> list[Stream]:
        """Walk through the blocks of samples."""
        if self._plan.assignment.long is not None:
            long = LongRows(self._plan, self._ledger, self._instants)
            for cells in self._each(blocks):
                long.append(cells)
            pa.default_memory_pool().release_unused()  # sorting needs the room
            return long.finished()
        groups = self._groups()
        growing = [GrowingStream(self._plan.expected_rows) for _ in groups]
        for cells in self._each(blocks):
            for group, stream in zip(groups, growing, strict=True):
                self._append(stream, group, cells)
        return [stream.finished() for stream in growing]

    def _each(self, blocks: Iterable[Block]) -> Iterable[Cells]:
        for block in blocks:
            cells = self._cells.read(block)
            if cells is not None:
                yield cells

    def _groups(self) -> list[list[Signal]]:
        """Signals that share their time columns."""
        groups: dict[tuple[int, ...], list[Signal]] = {}
        for signal in self._plan.assignment.signals:
            groups.setdefault(signal.time.columns, []).append(signal)
        return list(groups.values())

    def _append(self, stream: GrowingStream, group: list[Signal], cells: Cells) -> None:
        instants, good, blank = self._instants.read(cells, group[0].time)
        if not good.all():
            self._reject(group, cells, good, blank)
        else:
            self._ledger.rows_read[self._owner(group)] += good.size
        values: dict[str, Values] = {}
        for signal in group:
            whole = self._values(signal, cells, good)
            values[signal.tag] = whole if good.all() else whole[good]
        if good.all():
            stream.append(instants, cells.lines, values)
        else:
            stream.append(instants[good], cells.lines[good], values)

    def _is_empty(self, group: list[Signal], cells: Cells) -> Flags:
        """Find the rows in which the signals have nothing at all."""
        empty = np.ones(cells.lines.size, dtype=np.bool_)
        for signal in group:
            if signal.is_mode:
                words = cells.words[signal.column]
                empty &= np.array([not word for word in words.words])[words.places]
            else:
                empty &= np.isnan(cells.numbers[signal.column])
                if signal.column in cells.odd:
                    empty[cells.odd[signal.column][0]] = False
        return empty

    def _owner(self, group: list[Signal]) -> str:
        """Tag that rows are counted for, empty where all tags share them."""
        return group[0].tag if self._plan.assignment.layout is Layout.PAIRS else ""

    def _reject(self, group: list[Signal], cells: Cells, good: Flags, blank: Flags) -> None:
        """Reject the rows without a time, except those that are empty or repeat the headings."""
        owner, column = self._owner(group), group[0].time.columns[-1]
        empty = blank & self._is_empty(group, cells)
        doubtful = np.flatnonzero(~good & ~empty)
        heading = self._plan.heading_of(column)
        if heading is not None and doubtful.size:
            repeated = cells.is_time_text(column, doubtful, heading)
            self._ledger.passed_over["repeated headings"] += int(np.count_nonzero(repeated))
            doubtful = doubtful[~repeated]
        if not owner:
            self._ledger.passed_over["empty lines"] += int(np.count_nonzero(empty))
        self._ledger.rows_read[owner] += int(np.count_nonzero(good)) + doubtful.size
        for rows, reason in (
            (doubtful[blank[doubtful]], NO_TIME),
            (doubtful[~blank[doubtful]], NOT_A_TIME),
        ):
            texts = partial(cells.time_text_at, column, rows)
            self._ledger.reject_rows(cells.lines[rows], owner, texts, reason)

    def _values(self, signal: Signal, cells: Cells, used: Flags) -> Values:
        if signal.is_mode:
            return modes_of(self._plan, self._ledger, cells.words[signal.column], used)
        values = cells.numbers[signal.column]
        if signal.column in cells.odd:
            rows, words = cells.odd[signal.column]
            account_odd_cells(self._ledger, signal.tag, rows, words, cells.lines, used)
        self._ledger.empty[signal.tag] += cells.empty_in(signal.column, used)
        if signal.quality is None:
            return values
        owner = Words(np.zeros(values.size, dtype=np.int64), [signal.tag])
        quality = cells.words[signal.quality]
        scheme = self._plan.schemes[signal.quality]
        return blank_bad_quality(
            self._plan, self._ledger, scheme, owner, quality, values, cells.lines, used
        )
