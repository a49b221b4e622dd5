"""Rows that share their times, gathered block by block, with the line each one came from."""

from dataclasses import dataclass, field
from typing import TypeAlias, TypeVar, cast

import numpy as np
import numpy.typing as npt

from loop.signals import Real

Integers: TypeAlias = npt.NDArray[np.int64]
Instants: TypeAlias = Integers | Real
Array = TypeVar("Array")


@dataclass(slots=True)
class LineMap:
    """Line numbers of rows, kept as the runs in which they count up by one."""

    count: int = 0
    _rows: list[int] = field(default_factory=list)
    _lines: list[int] = field(default_factory=list)

    def extend(self, lines: Integers) -> None:
        """Append the lines of further rows."""
        if not lines.size:
            return
        breaks = np.flatnonzero(np.diff(lines) != 1) + 1
        for row in (0, *breaks.tolist()):
            line = int(lines[row])
            if self._rows and self._lines[-1] - self._rows[-1] == line - self.count - row:
                continue
            self._rows.append(self.count + row)
            self._lines.append(line)
        self.count += lines.size

    def of(self, rows: Integers) -> Integers:
        """Find the lines of some rows."""
        starts = np.array(self._rows, dtype=np.int64)
        place = np.searchsorted(starts, rows, side="right") - 1
        return np.array(self._lines, dtype=np.int64)[place] + (rows - starts[place])


@dataclass(slots=True)
class Stream:
    """Rows that share their times, in the order of the file.

    Attributes
    ----------
    instants : ndarray, shape (n,)
        Nanoseconds since 1970 as int64, or elapsed seconds as float64.
    lines : LineMap
        Lines of the rows of the file.
    rows : ndarray of int64, shape (n,), optional
        Which rows of the file these are; none for all of them.
    values : dict of str to ndarray, shape (n,)
        Values by tag, NaN for gaps; modes as numbers of `Mode`.
    """

    instants: Instants
    lines: LineMap
    values: dict[str, Real]
    rows: Integers | None = None

    def lines_of(self, rows: Integers) -> Integers:
        """Find the lines of some rows."""
        return self.lines.of(rows if self.rows is None else self.rows[rows])


@dataclass(slots=True)
class GrowingStream:
    """Chunks of one stream."""

    _instants: list[Instants] = field(default_factory=list)
    _values: dict[str, list[Real]] = field(default_factory=dict)
    _lines: LineMap = field(default_factory=LineMap)

    def append(self, instants: Instants, lines: Integers, values: dict[str, Real]) -> None:
        """Append the rows of one block."""
        self._instants.append(instants)
        self._lines.extend(lines)
        for tag, chunk in values.items():
            self._values.setdefault(tag, []).append(chunk)

    def finished(self) -> Stream:
        """Join the chunks, letting go of those of a column as soon as they are joined."""
        instants = joined(self._instants) if self._instants else np.zeros(0, dtype=np.int64)
        values = {tag: joined(self._values.pop(tag)) for tag in list(self._values)}
        return Stream(instants, self._lines, values)


def joined(chunks: list[Array]) -> Array:
    """Join chunks into one array and empty their list."""
    arrays = cast("list[npt.NDArray[np.generic]]", chunks)
    whole = cast("Array", np.concatenate(arrays)) if len(chunks) != 1 else chunks[0]
    chunks.clear()
    return whole
