"""One walk through the file: rows become streams of instants and values."""

from collections.abc import Iterable

import numpy as np

from historian.accounting import Ledger
from historian.assignment import Signal
from historian.cell_meaning import account_odd_cells, blank_bad_quality, modes_of
from historian.cells import CellReader, Cells
from historian.encoding import Block
from historian.instants import InstantReader
from historian.long_rows import LongRows
from historian.options import Layout
from historian.plan import Plan
from historian.streams import GrowingStream, Stream
from loop.signals import Flags, Real

NO_TIME = "there is no time"
NOT_A_TIME = "the time is not in the format of the file"


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
            return long.finished()
        groups = self._groups()
        growing = [GrowingStream() for _ in groups]
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
        empty = blank & self._is_empty(group, cells) if blank.any() else blank
        self._reject(group, cells, good, blank, empty)
        values = {}
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

    def _reject(
        self, group: list[Signal], cells: Cells, good: Flags, blank: Flags, empty: Flags
    ) -> None:
        paired = self._plan.assignment.layout is Layout.PAIRS
        tag = group[0].tag if paired else ""
        self._ledger.rows_read[tag] += int(np.count_nonzero(~empty))
        if empty.any() and not paired:
            self._ledger.passed_over["empty lines"] += int(np.count_nonzero(empty))
        for row in np.flatnonzero(~good & ~empty).tolist():
            column = group[0].time.columns[-1]
            text = cells.time_text(column, row) if not blank[row] else ""
            reason = NO_TIME if blank[row] else NOT_A_TIME
            self._ledger.reject_row(int(cells.lines[row]), text, reason, tag)

    def _values(self, signal: Signal, cells: Cells, used: Flags) -> Real:
        if signal.is_mode:
            return modes_of(self._plan, self._ledger, cells.words[signal.column], used)
        values = cells.numbers[signal.column]
        if signal.column in cells.odd:
            rows, words = cells.odd[signal.column]
            account_odd_cells(self._ledger, signal.tag, rows, words, cells.lines, used)
        self._ledger.empty[signal.tag] += cells.empty_in(signal.column, used)
        if signal.quality is None:
            return values
        return blank_bad_quality(
            self._plan,
            self._ledger,
            signal.tag,
            signal.quality,
            cells.words[signal.quality],
            values,
            cells.lines,
            used,
        )
