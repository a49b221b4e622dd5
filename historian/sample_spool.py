"""Rows of an upload sorted into days as they come in, on disk as soon as they are many."""

import shutil
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from types import TracebackType
from typing import Self
from uuid import uuid4

import numpy as np

from historian.sample_layout import day_of
from historian.sample_rows import DAY, ROW, Rows

IN_MEMORY = 500_000  # rows, 16 MB


class Spool:
    """Rows waiting for their merge, one heap a day.

    An export may run backwards or jump between days, so no day is complete before the last row has
    come in. Up to `in_memory` rows wait in memory, the rest in a folder that goes away at the end.
    """

    def __init__(self, folder: Path, *, in_memory: int = IN_MEMORY) -> None:
        self._folder = folder / str(uuid4())
        self._in_memory = in_memory
        self._held: dict[date, list[Rows]] = {}
        self._held_rows = 0
        self._spilled: dict[date, int] = {}
        self.rows = 0
        self.first: int | None = None
        self.last: int | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)

    def add(self, rows: Rows) -> None:
        """Take rows, at least one, in any order; of two values of a cell the later added stays."""
        for day, piece in _by_day(rows):
            self._held.setdefault(day, []).append(piece)
            times = piece["time"]
            self._widen(int(np.min(times)), int(np.max(times)))
        self.rows += rows.size
        self._held_rows += rows.size
        if self._held_rows > self._in_memory:
            self._spill()

    def _widen(self, first: int, last: int) -> None:
        self.first = first if self.first is None else min(self.first, first)
        self.last = last if self.last is None else max(self.last, last)

    def days(self) -> list[date]:
        """List the days that have rows."""
        return sorted({*self._held, *self._spilled})

    def of_day(self, day: date) -> Rows:
        """Give all rows of a day in the order they were added."""
        held = self._held.get(day, [])
        spilled = self._spilled.get(day, 0)
        rows = np.empty(spilled + sum(piece.size for piece in held), ROW)
        if spilled:
            with self._path(day).open("rb") as heap:
                if heap.readinto(_bytes(rows[:spilled])) != spilled * ROW.itemsize:
                    raise OSError(f"the rows of {day} that waited for their merge are gone")
        for piece in held:
            rows[spilled : spilled + piece.size] = piece
            spilled += piece.size
        return rows

    def _spill(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        for day, pieces in self._held.items():
            with self._path(day).open("ab") as heap:
                for piece in pieces:
                    heap.write(_bytes(piece))
                    self._spilled[day] = self._spilled.get(day, 0) + piece.size
        self._held.clear()
        self._held_rows = 0

    def _path(self, day: date) -> Path:
        return self._folder / day.isoformat()


def _bytes(rows: Rows) -> memoryview:
    return np.ascontiguousarray(rows).view(np.uint8).data


def _by_day(rows: Rows) -> Iterator[tuple[date, Rows]]:
    """Cut rows into days, keeping their order within a day."""
    days = rows["time"] // DAY
    if np.any(np.diff(days) < 0):
        order = np.argsort(days, kind="stable")
        rows, days = rows[order], days[order]
    for piece in np.split(rows, np.flatnonzero(np.diff(days)) + 1):
        yield day_of(int(piece["time"][0])), piece
