"""Account for every row and cell: kept, gap, merged or rejected with line and reason."""

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int64]

NO_TIME = "there is no time"
NOT_A_TIME = "the time is not in the format of the file"
NO_TAG = "there is no tag"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rejection:
    """A row or a cell that was not used.

    Attributes
    ----------
    line : int
        Line of the file, counted from 1.
    column : str
        Column or tag; empty where the whole row was rejected.
    text : str
        What stands there, shortened.
    reason : str
        Why it was not used.
    """

    line: int
    column: str
    text: str
    reason: str

    def __str__(self) -> str:
        place = f"line {self.line}" + (f", {self.column}" if self.column else "")
        return f"{place}: {self.reason}: {self.text!r}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Accounting:
    """What became of the rows of a file, a loop or a tag.

    Attributes
    ----------
    rows_read, rows_kept, rows_rejected : int
        Rows of samples; read = kept + rejected + duplicates.
    duplicates : int
        Rows merged into another row with the same time.
    conflicts : int
        Cells of merged rows that differ; the later one in the file is kept.
    gap_words : mapping of str to int
        Cells with a bad-quality word or code, by word: they are gaps.
    empty_cells : int
        Cells without anything: they are gaps.
    rejected_cells : int
        Cells that are neither number nor known word, or beyond any measurement: gaps, too.
    zeroed_cells : int
        Numbers too small for single precision, read as zero.
    gaps : int
        Stretches without rows, longer than 1.5 times the usual spacing (10 times where the
        spacing is irregular).
    longest_gap : float
        Longest of them. [s]
    sample_time : float
        Median spacing of rows, 0 for a single row. [s]
    irregular : bool
        Whether more than a tenth of the spacings differ from the median by more than half.
    span : float
        From the first to the last row kept. [s]
    disordered : bool
        Whether rows had to be sorted by time.
    rejections : tuple of Rejection
        The first rejections; their number is limited, the counts are not.
    reasons : mapping of str to int
        Rejected rows and cells by reason.
    """

    rows_read: int = 0
    rows_kept: int = 0
    rows_rejected: int = 0
    duplicates: int = 0
    conflicts: int = 0
    gap_words: Mapping[str, int] = field(default_factory=dict)
    empty_cells: int = 0
    rejected_cells: int = 0
    zeroed_cells: int = 0
    gaps: int = 0
    longest_gap: float = 0.0
    sample_time: float = 0.0
    irregular: bool = False
    span: float = 0.0
    disordered: bool = False
    rejections: tuple[Rejection, ...] = ()
    reasons: Mapping[str, int] = field(default_factory=dict)


class Ledger:
    """Collect the accounting while a file is read.

    Parameters
    ----------
    most : int
        Rejections that are listed one by one.

    Rows are counted by tag in long and paired files, under "" where all tags share them and for
    lines of which nobody knows the tag.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self.rejections: list[Rejection] = []
        self.reasons: Counter[str] = Counter()
        self.rows_read: Counter[str] = Counter()
        self.rows_rejected: Counter[str] = Counter()
        self.words: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self.empty: Counter[str] = Counter()
        self.cells_rejected: Counter[str] = Counter()
        self.zeroed: Counter[str] = Counter()
        self.unknown_modes: Counter[str] = Counter()
        self.passed_over: Counter[str] = Counter()
        self.unterminated = False

    def reject_row(self, line: int, text: str, reason: str, tag: str = "") -> None:
        """Count a row that is not used, of one tag or of the whole file."""
        self.rows_rejected[tag] += 1
        self._reject(line, tag, text, reason)

    def reject_rows(
        self, lines: Integers, tag: str, text_of: Callable[[int], str], reason: str
    ) -> None:
        """Count rows that are not used, for one reason; `text_of` gives the text of the k-th."""
        self.rows_rejected[tag] += lines.size
        if lines.size:
            self.reasons[reason] += lines.size
        for place, line in enumerate(lines[: self._most - len(self.rejections)].tolist()):
            self._list(line, tag, text_of(place), reason)

    def reject_cells(self, lines: Integers, column: str, text: str, reason: str) -> None:
        """Count equal cells that are not used."""
        self.cells_rejected[column] += lines.size
        self.reasons[reason] += lines.size
        for line in lines[: self._most - len(self.rejections)].tolist():
            self._list(line, column, text, reason)

    def _reject(self, line: int, column: str, text: str, reason: str) -> None:
        self.reasons[reason] += 1
        if len(self.rejections) < self._most:
            self._list(line, column, text, reason)

    def _list(self, line: int, column: str, text: str, reason: str) -> None:
        self.rejections.append(Rejection(line=line, column=column, text=text[:80], reason=reason))

    def gap_word(self, column: str, word: str, count: int) -> None:
        """Count cells with a bad-quality word."""
        self.words[column][word] += count
