"""Rows that share their times, gathered block by block, with the line each one came from."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, TypeAlias, TypeVar, cast

import numpy as np
import numpy.typing as npt

from loop.signals import Codes, Real

Integers: TypeAlias = npt.NDArray[np.int64]
Instants: TypeAlias = Integers | Real
Values: TypeAlias = Real | Codes
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
    rows : callable, optional
        Finds which rows of the file these are, shape (n,); none for all of them.
    values : dict of str to ndarray, shape (n,)
        Values by tag, NaN for gaps; modes as int8 numbers of `Mode`, UNKNOWN for gaps.
    """

    instants: Instants
    lines: LineMap
    values: dict[str, Values]
    rows: Callable[[], Integers] | None = None

    def lines_of(self, rows: Integers) -> Integers:
        """Find the lines of some rows."""
        return self.lines.of(rows if self.rows is None else self.rows()[rows])


class GrowingArray(Generic[Array]):
    """An array that takes block after block, with little more memory than it needs in the end.

    Parameters
    ----------
    expected : int
        Elements to expect; what is never written takes no memory.
    """

    def __init__(self, expected: int = 0) -> None:
        self._array: npt.NDArray[Any] = np.zeros(0, dtype=np.int64)
        self._size = 0
        self._expected = expected

    def append(self, chunk: Array) -> None:
        """Append a block; all blocks have the type of the first."""
        block = cast("npt.NDArray[Any]", chunk)
        size = self._size + block.size
        if self._size == 0:
            self._array = np.empty(max(size, self._expected), dtype=block.dtype)
        elif size > self._array.size:
            self._array.resize(size + size // 8, refcheck=False)
        self._array[self._size : size] = block
        self._size = size

    def finished(self) -> Array:
        """Give the array away."""
        array, self._array = self._array, np.zeros(0, dtype=np.int64)
        array.resize(self._size, refcheck=False)
        return cast("Array", array)


class GrowingStream:
    """A stream that takes block after block.

    Parameters
    ----------
    expected : int
        Rows to expect.
    """

    def __init__(self, expected: int) -> None:
        self._expected = expected
        self._instants: GrowingArray[Instants] = GrowingArray(expected)
        self._values: dict[str, GrowingArray[Values]] = {}
        self._lines = LineMap()

    def append(self, instants: Instants, lines: Integers, values: dict[str, Values]) -> None:
        """Append the rows of one block."""
        self._instants.append(instants)
        self._lines.extend(lines)
        for tag, chunk in values.items():
            if tag not in self._values:
                self._values[tag] = GrowingArray(self._expected)
            self._values[tag].append(chunk)

    def finished(self) -> Stream:
        """Give the stream away."""
        values = {tag: growing.finished() for tag, growing in self._values.items()}
        return Stream(self._instants.finished(), self._lines, values)
