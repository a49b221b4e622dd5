"""Rows of a long file, each one sample of one tag, sorted apart at the end."""

from functools import partial
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from historian.accounting import NO_TAG, NO_TIME, NOT_A_TIME, Ledger
from historian.arrow_views import different
from historian.cell_meaning import account_odd_cells, blank_bad_quality, modes_of
from historian.cells import Cells, Words
from historian.errors import ExportRefused
from historian.instants import InstantReader
from historian.plan import Plan
from historian.streams import Array, GrowingArray, Instants, Integers, LineMap, Stream, Values
from loop.signals import Flags, Real

MOST_TAGS = 32_000
ROWS_AT_ONCE = 250_000  # so that what is worked with is small beside the whole


class LongRows:
    """Gather the samples of all tags.

    Parameters
    ----------
    plan : Plan
        What was decided.
    ledger : Ledger
        Collects the accounting.
    instants : InstantReader
        Reads the times.
    """

    def __init__(self, plan: Plan, ledger: Ledger, instants: InstantReader) -> None:
        assert plan.assignment.long is not None  # noqa: S101
        self._plan = plan
        self._columns = plan.assignment.long
        self._ledger = ledger
        self._instants = instants
        self._tags: dict[str, int] = {}
        self._codes: GrowingArray[npt.NDArray[np.int16]] = GrowingArray(plan.expected_rows)
        self._times: GrowingArray[Instants] = GrowingArray(plan.expected_rows)
        self._values: GrowingArray[Real] = GrowingArray(plan.expected_rows)
        self._lines = LineMap()

    def append(self, cells: Cells) -> None:
        """Append the rows of one block."""
        words = cells.words[self._columns.tag]
        instants, good, blank = self._instants.read(cells, self._columns.time)
        passed = np.array([bool(self._pass_over(word)) for word in words.words])[words.places]
        named = np.array([bool(word) for word in words.words])[words.places]
        used = good & named & ~passed
        self._count_rows(words)
        self._reject(cells, words, used | passed, blank)
        values = self._settled(cells, words, used)
        codes = self._coded(words)[words.places]
        if not used.all():
            codes, instants, values = codes[used], instants[used], values[used]
        self._codes.append(codes)
        self._times.append(instants)
        self._values.append(values)
        self._lines.extend(cells.lines if used.all() else cells.lines[used])

    def _coded(self, words: Words) -> npt.NDArray[np.int16]:
        for word in words.words:
            if word not in self._tags:
                self._tags[word] = len(self._tags)
        if len(self._tags) > MOST_TAGS:
            raise ExportRefused(
                f"The tag column holds more than {MOST_TAGS:,} different names; it is no tag "
                "column, state the right one with columns.tag.",
                column=self._plan.table.names[self._columns.tag],
            )
        return np.array([self._tags[word] for word in words.words], dtype=np.int16)

    def _pass_over(self, tag: str) -> str:
        """Say what a row is that names no tag: a footer or a repeated heading."""
        if tag.startswith("$RT_"):
            return "footers"
        return "repeated headings" if self._plan.heading_of(self._columns.tag) == tag else ""

    def _count_rows(self, words: Words) -> None:
        counts = np.bincount(words.places, minlength=len(words.words)).tolist()
        for word, count in zip(words.words, counts, strict=True):
            what = self._pass_over(word)
            if what:
                self._ledger.passed_over[what] += count
            elif count:
                self._ledger.rows_read[word] += count

    def _reject(self, cells: Cells, words: Words, used: Flags, blank: Flags) -> None:
        bad = np.flatnonzero(~used)
        column = self._columns.time.columns[-1]
        for place in different(words.places[bad]):
            rows = bad[words.places[bad] == place]
            late = rows[~blank[rows]]
            texts = partial(cells.time_text_at, column, late)
            reason = NOT_A_TIME if words.words[place] else NO_TAG
            self._ledger.reject_rows(cells.lines[late], words.words[place], texts, reason)
            early = rows[blank[rows]]
            texts = partial(cells.time_text_at, column, early)
            self._ledger.reject_rows(cells.lines[early], words.words[place], texts, NO_TIME)

    def _settled(self, cells: Cells, words: Words, used: Flags) -> Real:
        """Give every value its meaning: number, gap, or mode."""
        column = self._columns.value
        values = cells.numbers[column]
        modes = np.array([self._is_mode(word) for word in words.words], dtype=np.bool_)
        rows = np.zeros(0, dtype=np.int64)
        odd = Words(rows, [])
        if column in cells.odd:
            rows, odd = cells.odd[column]
        if modes.any():
            values = self._modes_set(values, modes[words.places] & used, rows, odd)
            kept = ~modes[words.places[rows]]
            rows, odd = rows[kept], Words(odd.places[kept], odd.words)
        self._account(cells, words, rows, odd, values, used)
        if self._columns.quality is None:
            return values
        quality = cells.words[self._columns.quality]
        scheme = self._plan.schemes[self._columns.quality]
        return blank_bad_quality(
            self._plan, self._ledger, scheme, words, quality, values, cells.lines, used
        )

    def _is_mode(self, tag: str) -> bool:
        return self._plan.is_mode_tag(tag)

    def _modes_set(self, values: Real, where: Flags, rows: Integers, odd: Words) -> Real:
        """Read the values of mode tags, numbers and words alike, as modes."""
        places = np.zeros(values.size, dtype=np.int64)
        different = ["", *odd.words]
        worded = where[rows]
        places[rows[worded]] = odd.places[worded] + 1
        numeric = where & np.isfinite(values)
        numbers, order = np.unique(values[numeric], return_inverse=True)
        places[numeric] = order + len(different)
        different += [f"{number:g}" for number in numbers.tolist()]
        modes = modes_of(self._plan, self._ledger, Words(places, different), where)
        return np.where(where, modes, values)

    def _account(
        self, cells: Cells, words: Words, rows: Integers, odd: Words, values: Real, used: Flags
    ) -> None:
        missing = np.isnan(values) & used
        missing[rows] = False
        empty = np.bincount(words.places[missing], minlength=len(words.words)).tolist()
        for tag, count in zip(words.words, empty, strict=True):
            if count:
                self._ledger.empty[tag] += count
        tags = words.places[rows]
        for place in different(tags):
            here = tags == place
            account_odd_cells(
                self._ledger, words.words[place], rows[here],
                Words(odd.places[here], odd.words), cells.lines, used,
            )  # fmt: skip

    def finished(self) -> list[Stream]:
        """Sort the samples apart by tag."""
        codes = self._codes.finished()
        counts = np.zeros(len(self._tags), dtype=np.int64)
        for first in range(0, codes.size, ROWS_AT_ONCE):
            counts += np.bincount(codes[first : first + ROWS_AT_ONCE], minlength=counts.size)
        ends = np.cumsum(counts)
        # One array after the other, so that no two of them are held twice at once.
        times = _sorted_apart(self._times.finished(), codes, ends - counts)
        values = _sorted_apart(self._values.finished(), codes, ends - counts)
        streams = []
        for tag, code in self._tags.items():
            own = slice(int(ends[code] - counts[code]), int(ends[code]))
            if counts[code]:
                found: Values = values[own]
                if self._is_mode(tag):
                    found = found.astype(np.int8)
                rows = partial(_rows_of, codes, code)
                streams.append(Stream(times[own], self._lines, {tag: found}, rows))
        return streams


def _rows_of(codes: npt.NDArray[np.int16], code: int) -> Integers:
    return np.flatnonzero(codes == code)


def _sorted_apart(array: Array, codes: npt.NDArray[np.int16], begins: Integers) -> Array:
    """Arrange an array by code, in the order of the file, with little memory but that of a copy."""
    given = cast("npt.NDArray[Any]", array)
    arranged = np.empty_like(given)
    begins = begins.copy()
    for first in range(0, codes.size, ROWS_AT_ONCE):
        part = slice(first, first + ROWS_AT_ONCE)
        order = np.argsort(codes[part], kind="stable")
        code = codes[part][order]
        count = np.bincount(code, minlength=begins.size)
        earlier = np.cumsum(count) - count
        arranged[(begins - earlier)[code] + np.arange(code.size)] = given[part][order]
        begins += count
    return cast("Array", arranged)
