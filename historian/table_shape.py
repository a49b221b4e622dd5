"""Find the table in a text file: what separates cells, where the samples start, what names them."""

import csv
import re
from collections import Counter
from dataclasses import dataclass

from historian.cell_kind import MEANT, TIMES, Kind, kind_of
from historian.errors import ExportRefused
from historian.options import ReadOptions
from historian.tag_map import part_of

DELIMITERS = (";", "\t", ",", "|")
SAMPLE_LINES = 4000
KIND_LINES = 200
_SECTION = re.compile(r"\s*\[(\w+)\][\s,;]*\Z")
_COMMENT = re.compile(r"\s*(?:\*|//|#(?!N/A|VALUE!|REF!|NAME\?|NUM!|DIV/0!|NULL!))", re.IGNORECASE)

Row = list[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """The table of a file as its start shows it.

    Attributes
    ----------
    delimiter : str
        What separates cells.
    width : int
        Columns of a row of samples.
    first_line : int
        Line of the first sample, counted from 1.
    header_line : int or None
        Line that names the columns.
    names : tuple of str
        Name of every column, "column 3" where there is none.
    other_headers : tuple
        Further rows of headings: units or descriptions.
    rows : tuple of (int, list of str)
        Line number and cells of the sample of data rows.
    notes : tuple of str
        What was passed over, in words.
    """

    delimiter: str
    width: int
    first_line: int
    header_line: int | None
    names: tuple[str, ...]
    other_headers: tuple[tuple[str, ...], ...]
    rows: tuple[tuple[int, Row], ...]
    notes: tuple[str, ...]

    def column(self, index: int) -> list[str]:
        """Cells of one column at the start of the sample, empty where a row is short."""
        return [row[index] if index < len(row) else "" for _, row in self.rows[:KIND_LINES]]


def is_comment(line: str) -> bool:
    """Tell whether a line is a comment of the export tool."""
    return _COMMENT.match(line) is not None


def is_section(line: str) -> bool:
    """Tell whether a line opens a section, such as [Data]."""
    return _SECTION.match(line) is not None


def split_cells(line: str, delimiter: str) -> Row:
    """Split a line into cells without blanks around them; quotes are understood."""
    if '"' in line:
        try:
            cells = next(csv.reader([line], delimiter=delimiter), [])
        except csv.Error:
            cells = line.split(delimiter)
    else:
        cells = line.split(delimiter)
    return [cell.strip() for cell in cells]


def find_table(text: str, line_end: str, options: ReadOptions) -> Table:
    """Find the table in the start of a file.

    Parameters
    ----------
    text : str
        Start of the file, whole lines.
    line_end : str
        "LF", "CRLF" or "CR".
    options : ReadOptions
        What the user states.

    Raises
    ------
    ExportRefused
        Where no table is found.
    """
    lines = text.split("\r") if line_end == "CR" else text.replace("\r\n", "\n").split("\n")
    numbered = [(number, line) for number, line in enumerate(lines, start=1)]
    notes: list[str] = []
    start = _after_data_section(numbered, notes)
    if options.first_line is not None:
        start = max(start, min(options.header_line or options.first_line, options.first_line) - 1)
    sample = _telling_lines(numbered[start : start + SAMPLE_LINES])
    if not sample:
        raise ExportRefused("The file holds no rows; export it again.")
    delimiter = options.delimiter or _decide_delimiter([line for _, line in sample])
    rows = [(number, split_cells(line, delimiter)) for number, line in sample]
    width = _decide_width([row for _, row in rows])
    first = options.first_line or _first_data_line(rows, width)
    header, others = _headers(rows, width, first, options)
    if header is None and options.header_line is None:
        header = _heading_in_comment(numbered[:first], width, delimiter)
    names = _names(header[1] if header else [], width)
    data = tuple((n, row) for n, row in rows if n >= first and len(row) <= width)
    return Table(
        delimiter=delimiter,
        width=width,
        first_line=first,
        header_line=header[0] if header else None,
        names=names,
        other_headers=others,
        rows=data,
        notes=tuple(notes),
    )


def _telling_lines(numbered: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Leave out comments, sections, and lines without digits that repeat, such as headings."""
    telling: list[tuple[int, str]] = []
    wordy: set[str] = set()
    for number, line in numbered:
        if is_comment(line) or is_section(line) or line in wordy or not line.strip(" ,;|\t"):
            continue
        if not any(character.isdigit() for character in line):
            wordy.add(line)
        telling.append((number, line))
    return telling


def _after_data_section(lines: list[tuple[int, str]], notes: list[str]) -> int:
    for place, (number, line) in enumerate(lines):
        found = _SECTION.match(line)
        if found is not None and found[1].lower() == "data":
            notes.append(f"the samples stand in the section [Data] from line {number}")
            return place + 1
    return 0


def _decide_delimiter(lines: list[str]) -> str:
    best, best_score = "", 0.0
    for delimiter in DELIMITERS:
        if not any(delimiter in line for line in lines):
            continue
        rows = [split_cells(line, delimiter) for line in lines]
        width = _decide_width(rows)
        fitting = [row for row in rows if len(row) == width]
        if width < 2 or not fitting:
            continue
        looked_at = fitting[-60:]
        cells = [cell for row in looked_at for cell in row]
        meant = sum(kind_of(cell) in MEANT for cell in cells) / len(cells)
        score = len(fitting) / len(rows) * meant**2
        if score > best_score * 1.0001:
            best, best_score = delimiter, score
    if not best:
        raise ExportRefused(
            "No separator gives columns of times and numbers: tried semicolon, tab, comma and "
            "bar; state it with delimiter=..., or export a table of at least two columns."
        )
    return best


def _decide_width(rows: list[Row]) -> int:
    """Take the usual number of cells; with a time per tag, rows get shorter towards the end."""
    counted = Counter(len(row) for row in rows)
    usual = max(counted, key=lambda width: (counted[width], width))
    paired = [
        len(row) for row in rows[:40] + rows[-40:] if sum(kind_of(c) in TIMES for c in row) >= 2
    ]
    split_stamp = usual >= 2 and all(
        {kind_of(cell) for cell in row} >= {Kind.DATE, Kind.CLOCK}
        for row in rows[-5:]
        if len(row) == usual
    )
    return max([usual, *paired]) if paired and not split_stamp else usual


def _first_data_line(rows: list[tuple[int, Row]], width: int) -> int:
    fitting = [(n, row) for n, row in rows if len(row) == width] or rows
    tail = fitting[len(fitting) // 4 + (1 if 1 < len(fitting) < 8 else 0) :][-KIND_LINES:]
    usual = [
        _usual_kind([kind_of(row[j]) for _, row in tail if j < len(row)]) for j in range(width)
    ]
    anchors = [j for j, kind in enumerate(usual) if kind in TIMES]
    if not anchors:
        anchors = [j for j, kind in enumerate(usual) if kind is Kind.NUMBER]
    if not anchors:
        raise ExportRefused(
            "No column holds times or numbers; is this the export of a historian? Columns of the "
            f"first row: {', '.join(rows[0][1][:20])}."
        )
    for number, row in rows:
        if len(row) > width or len(row) < min(2, width):
            continue
        kinds = [kind_of(row[j]) if j < len(row) else Kind.EMPTY for j in anchors]
        alike = sum(kind is usual[j] for j, kind in zip(anchors, kinds, strict=True))
        if kinds[0] is usual[anchors[0]] and 2 * alike >= len(anchors) - kinds.count(Kind.EMPTY):
            return number
    raise ExportRefused("No row of samples is found; state the first one with first_line=...")


def _usual_kind(kinds: list[Kind]) -> Kind:
    """Take the kind of most cells; a fifth of numbers or times counts for more than any words."""
    counted = Counter(kind for kind in kinds if kind is not Kind.EMPTY)
    measured = Counter({k: n for k, n in counted.items() if k in TIMES or k is Kind.NUMBER})
    if measured.total() * 5 >= counted.total():
        counted = measured
    return counted.most_common(1)[0][0] if counted else Kind.EMPTY


Heading = tuple[int, Row]


def _headers(
    rows: list[tuple[int, Row]], width: int, first: int, options: ReadOptions
) -> tuple[Heading | None, tuple[tuple[str, ...], ...]]:
    """Choose the row that names the columns among the rows of headings before the samples."""
    if options.header_line == 0:
        return None, ()
    candidates = [
        (number, row)
        for number, row in rows
        if number < first and width - 1 <= len(row) <= width + 1 and _reads_as_heading(row)
    ][-4:]
    if options.header_line is not None:
        stated = [heading for heading in rows if heading[0] == options.header_line]
        if not stated:
            raise ExportRefused(
                "There is no heading there; state another header_line.", line=options.header_line
            )
        chosen = stated[0]
    elif candidates:
        chosen = max(candidates, key=_naming_power)
    else:
        return None, ()
    others = tuple(tuple(row) for number, row in candidates if number != chosen[0])
    return chosen, others


def _heading_in_comment(lines: list[tuple[int, str]], width: int, delimiter: str) -> Heading | None:
    """Take the names from the last comment before the samples, if it has as many cells."""
    for number, line in reversed(lines[:-1]):
        row = split_cells(line.lstrip("#*/ "), delimiter)
        if is_comment(line) and len(row) == width and _reads_as_heading(row):
            return number, row
        if line.strip():
            return None
    return None


def _reads_as_heading(row: Row) -> bool:
    filled = [cell for cell in row if cell]
    if not filled or sum("=" in cell for cell in filled) * 2 > len(filled):
        return False
    return sum(kind_of(cell) in {Kind.NUMBER, *TIMES} for cell in filled) * 2 <= len(filled)


def _naming_power(heading: Heading) -> tuple[int, int, int]:
    number, row = heading
    parts = sum(part_of(cell) is not None for cell in row)
    return parts, len({cell for cell in row if cell}), -number


def _names(header: Row, width: int) -> tuple[str, ...]:
    cells = (header + [""] * width)[:width]
    names: list[str] = []
    for place, cell in enumerate(cells, start=1):
        name = cell or f"column {place}"
        names.append(name if name not in names else f"{name} (column {place})")
    return tuple(names)
