"""Cells of one block as arrays: numbers at full speed, the odd cells one by one."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv

from historian.accounting import Ledger
from historian.arrow_views import as_flags, as_floats, as_integers, equals, taken
from historian.encoding import Block, text_of
from historian.errors import ExportRefused
from historian.lines import clean_lines, is_suspect
from historian.numbers import LARGEST, without_denormals
from historian.options import Layout
from historian.plan import Plan
from historian.quality import bad_spellings
from loop.signals import Flags, Real

LineNumbers = npt.NDArray[np.int64]
Places = npt.NDArray[np.int64]

MOST_GAP_WORDS = 1000
_NUMBER = r"^[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?$"
_COMMA_NUMBER = r"^[+-]?([0-9]+,?[0-9]*|,[0-9]+)([eE][+-]?[0-9]+)?$"


@dataclass(slots=True)
class Words:
    """A column of few different words.

    Attributes
    ----------
    places : ndarray of int, shape (n,)
        Place of every cell in `words`.
    words : list of str
        The different words.
    """

    places: Places
    words: list[str]


@dataclass(slots=True)
class Cells:
    """Cells of one block.

    Attributes
    ----------
    lines : ndarray of int64, shape (n,)
        Line of every row.
    numbers, words, times : dict of int to arrays of length n
        Cells by column. Numbers are NaN where `odd` lists the row.
    odd : dict of int to (rows, texts)
        Cells of number columns that are not empty and no number, by column.
    gaps : set of int
        Number columns in which there may be gaps.
    """

    lines: LineNumbers
    numbers: dict[int, Real]
    words: dict[int, Words]
    times: dict[int, pa.Array]
    odd: dict[int, tuple[Places, Words]] = field(default_factory=dict)
    gaps: set[int] = field(default_factory=set)

    def time_text_at(self, column: int, rows: Places, place: int) -> str:
        """Read the time cell of one of some rows as it stands in the file."""
        cells, row = self.times[column], int(rows[place])
        if pa.types.is_dictionary(cells.type):
            cells, row = cells.dictionary, cells.indices[row].as_py()
        return bytes(cells[row].as_buffer()).decode("latin-1").strip()

    def is_time_text(self, column: int, rows: Places, text: str) -> Flags:
        """Tell in which of some rows a time cell holds exactly this text."""
        return equals(pc.ascii_trim_whitespace(taken(self.times[column], rows)), text)

    def empty_in(self, column: int, used: Flags) -> int:
        """Count the empty cells of a number column in the rows that are used."""
        if column not in self.gaps:
            return 0
        missing = np.isnan(self.numbers[column]) & used
        if column in self.odd:
            missing[self.odd[column][0]] = False
        return int(np.count_nonzero(missing))


class CellReader:
    """Read the cells of block after block.

    Parameters
    ----------
    plan : Plan
        What every column is.
    ledger : Ledger
        Told of rejected lines.
    """

    def __init__(self, plan: Plan, ledger: Ledger) -> None:
        self._plan = plan
        self._ledger = ledger
        self._width = plan.table.width
        self._names = [str(column) for column in range(self._width)]
        self._gap_words = dict.fromkeys(bad_spellings())
        self._direct = not plan.numbers.thousands
        self._used = sorted({*plan.number_columns, *plan.word_columns, *plan.time_columns})

    def read(self, block: Block) -> Cells | None:
        """Read one block; None where it holds no rows."""
        data, ends, lines = block.data, block.ends, None
        table = None
        if not block.terminated:
            self._ledger.unterminated = True
        if not is_suspect(block, self._plan):
            table = self._parse(data, numbers_as_text=not self._direct)
            if table is not None and table.num_rows != block.ends.size:
                table = None
            else:
                lines = np.arange(block.first_line, block.first_line + block.ends.size)
        if table is None:
            good = clean_lines(block, self._plan, self._ledger)
            if not good.texts:
                return None
            lines = np.array(good.numbers)
            data = b"".join(text + b"\n" for text in good.texts)
            ends = np.cumsum([len(text) + 1 for text in good.texts])
            table = self._parse(data, numbers_as_text=not self._direct)
            if table is None or table.num_rows != len(lines):
                raise ExportRefused(
                    "The lines cannot be split into cells; state the right delimiter.",
                    line=good.numbers[0],
                )
        assert lines is not None  # noqa: S101
        return self._cells(table, data, ends, lines)

    def _parse(self, data: bytes, *, numbers_as_text: bool) -> pa.Table | None:
        """Split a block with the fast reader; None where it cannot."""
        try:
            return self._parse_columns(data, self._used, numbers_as_text=numbers_as_text)
        except pa.ArrowInvalid as error:
            if numbers_as_text or "conversion error" not in str(error):
                return None
        return self._parse(data, numbers_as_text=True)

    def _parse_columns(self, data: bytes, columns: list[int], *, numbers_as_text: bool) -> pa.Table:
        few = pa.dictionary(pa.int32(), pa.string())
        types: dict[str, pa.DataType] = {}
        for column in columns:
            if column in self._plan.number_columns:
                kind = pa.string() if numbers_as_text else pa.float64()
            elif column in self._plan.word_columns:
                kind = few
            else:
                long = self._plan.assignment.layout is Layout.LONG
                kind = few if long else pa.string()
            types[str(column)] = kind
        return pa_csv.read_csv(
            pa.BufferReader(data),
            read_options=pa_csv.ReadOptions(
                column_names=self._names, block_size=len(data) + 1, use_threads=True
            ),
            parse_options=pa_csv.ParseOptions(delimiter=self._plan.table.delimiter),
            convert_options=pa_csv.ConvertOptions(
                check_utf8=False,
                column_types=types,
                include_columns=[str(column) for column in columns],
                null_values=["", *self._gap_words],
                strings_can_be_null=False,
                decimal_point=self._plan.numbers.decimal,
            ),
        )

    def _cells(self, table: pa.Table, data: bytes, ends: Places, lines: LineNumbers) -> Cells:
        cells = Cells(lines=lines, numbers={}, words={}, times={})
        for column in self._plan.word_columns:
            cells.words[column] = self._words(_joined(table, column))
        for column in self._plan.time_columns:
            cells.times[column] = _joined(table, column)
        texts: list[int] = []
        unsure: list[int] = []
        gaps = np.zeros(len(lines), dtype=np.bool_)
        for column in self._plan.number_columns:
            array = _joined(table, column)
            if not pa.types.is_floating(array.type):
                texts.append(column)
                cells.numbers[column] = np.full(len(lines), np.nan)
                continue
            values = as_floats(array)
            if values.size and not np.abs(values).max() <= LARGEST:  # or NaN
                gaps |= ~(np.abs(values) <= LARGEST)
                unsure.append(column)
            cells.numbers[column] = values
        if texts:
            self._read_texts(cells, texts, np.arange(len(lines)), table)
        if unsure:
            rows = np.flatnonzero(gaps)
            again = self._parse_columns(_only_lines(data, ends, rows), unsure, numbers_as_text=True)
            self._read_texts(cells, unsure, rows, again)
        for column, values in cells.numbers.items():
            settled, zeros = without_denormals(values)
            cells.numbers[column] = settled
            if zeros:
                self._ledger.zeroed[self._plan.table.names[column]] += zeros
        return cells

    def _words(self, array: pa.Array) -> Words:
        dictionary = array.dictionary.cast(pa.binary())
        words = [text_of(word, self._plan.encoding).strip() for word in dictionary.to_pylist()]
        return Words(as_integers(array.indices), words)

    def _read_texts(self, cells: Cells, columns: list[int], rows: Places, table: pa.Table) -> None:
        """Read number cells of some rows from their text, and list the odd ones."""
        arrays = [_joined(table, column) for column in columns]
        values, places, words = self._numbers_of(pa.concat_arrays(arrays))
        for order, column in enumerate(columns):
            first, end = order * rows.size, (order + 1) * rows.size
            numbers = cells.numbers[column].copy()  # it may be Arrow's own memory
            numbers[rows] = values[first:end]
            cells.numbers[column] = numbers
            cells.gaps.add(column)
            here = (places >= first) & (places < end)
            if here.any():
                odd = Words(words.places[here], words.words)
                cells.odd[column] = (rows[places[here] - first], odd)

    def _numbers_of(self, texts: pa.Array) -> tuple[Real, Places, Words]:
        """Read cells exactly; those that are neither number nor empty are returned as words."""
        texts = pc.ascii_trim_whitespace(texts)
        texts, numeric = self._readable(texts)
        values = np.full(len(texts), np.nan)
        rows = np.flatnonzero(numeric)
        values[rows] = as_floats(taken(texts, rows).cast(pa.float64()))
        values[np.abs(values) > LARGEST] = np.nan
        rest = np.flatnonzero(np.isnan(values))
        words = self._words(taken(texts, rest).dictionary_encode())
        odd = np.ones(rest.size, dtype=np.bool_)
        for place, word in enumerate(words.words):
            number = self._plan.numbers.read(word)
            fits = number is not None and abs(number) <= LARGEST
            if fits or not word:
                where = words.places == place
                values[rest[where]] = np.nan if number is None else number
                odd &= ~where
            elif number is None and len(self._gap_words) < MOST_GAP_WORDS and word.isascii():
                self._gap_words[word] = None
        return values, rest[odd], Words(words.places[odd], words.words)

    def _readable(self, texts: pa.Array) -> tuple[pa.Array, Flags]:
        """Rewrite numbers so that they can be cast, and tell which cells are numbers."""
        numbers = self._plan.numbers
        if numbers.thousands:
            mark = "\\" + numbers.thousands
            grouped = rf"^[+-]?[0-9]{{1,3}}({mark}[0-9]{{3}})+([.,][0-9]*)?$"
            bare = pc.replace_substring(texts, numbers.thousands, "")
            texts = pc.if_else(_matches(texts, grouped), bare, texts)
        if numbers.decimal != ",":
            return texts, as_flags(_matches(texts, _NUMBER))
        fits = _matches(texts, _COMMA_NUMBER)
        pointed = pc.replace_substring(texts, ",", ".")
        return pc.if_else(fits, pointed, texts), as_flags(fits)


def _matches(texts: pa.Array, pattern: str) -> pa.Array:
    return pc.match_substring_regex(texts.cast(pa.binary()), pattern)


def _joined(table: pa.Table, column: int) -> pa.Array:
    return table.column(str(column)).chunk(0)  # a block is read as one chunk


def _only_lines(data: bytes, ends: Places, rows: Places) -> bytes:
    starts = np.where(rows > 0, ends[rows - 1], 0).tolist()
    stops = ends[rows].tolist()
    return b"".join(data[a:b] for a, b in zip(starts, stops, strict=True))
