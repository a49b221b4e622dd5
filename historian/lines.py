"""Sort the lines of a block that is not a clean table: samples, remarks and damaged lines."""

import csv
from dataclasses import dataclass, field

from historian.accounting import Ledger
from historian.encoding import Block, text_of
from historian.options import Layout
from historian.plan import Plan
from historian.table_shape import is_comment, is_section, split_cells


@dataclass(slots=True)
class GoodLines:
    """Lines that have as many cells as the table has columns.

    Attributes
    ----------
    texts : list of bytes
        The lines.
    numbers : list of int
        Their line numbers, counted from 1.
    """

    texts: list[bytes] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)


def clean_lines(block: Block, plan: Plan, ledger: Ledger) -> GoodLines:
    """Keep the lines of samples; count the remarks and reject the damaged lines."""
    good = GoodLines()
    texts = block.data.replace(b"\r\n", b"\n").split(b"\n")
    if block.terminated:
        texts.pop()
    last = block.first_line + len(texts) - 1
    for number, text in enumerate(texts, start=block.first_line):
        remark = _remark_in(text, plan)
        if remark is not None:
            ledger.passed_over[remark] += 1
            continue
        cut_off = number == last and not block.terminated
        reason = _damage_in(text) or (
            "its last number ends in the decimal mark"
            if cut_off and ends_in_a_number(block, plan)
            else None
        )
        if reason is None:
            fitted, reason = _fit(text, plan)
            if fitted is not None:
                good.texts.append(fitted)
                good.numbers.append(number)
                continue
        if cut_off:
            reason = f"the last line is cut off, {reason}"
        ledger.rows_read[""] += 1
        ledger.reject_row(number, text_of(text, plan.encoding), reason)
    return good


def _remark_in(text: bytes, plan: Plan) -> str | None:
    """Say what a line is that is meant for people: empty, a comment, a section, a heading."""
    if not text.strip():
        return "empty lines"
    line = text_of(text, plan.encoding)
    if text[:1] in b"*#/ [" and (is_comment(line) or is_section(line)):
        return "comments" if is_comment(line) else "sections"
    if text.startswith(b'"$RT_'):
        return "footers"
    cells = split_cells(line, plan.table.delimiter)[:2]
    if all(plan.heading_of(column) == cell for column, cell in enumerate(cells)):
        return "repeated headings"
    return None


def _damage_in(text: bytes) -> str | None:
    if b"\0" in text:
        return "it holds NUL bytes"
    if b"\r" in text.rstrip(b"\r"):
        return "it holds a carriage return"
    return "a quotation mark is not closed" if text.count(b'"') % 2 else None


def is_suspect(block: Block, plan: Plan) -> bool:
    """Tell whether a block holds damage that splits into cells without an error.

    A quotation mark that is left open swallows the lines after it, which shows; in the last line
    of a block there is nothing to swallow.
    """
    last_line = block.data[int(block.ends[-2]) if block.ends.size > 1 else 0 :]
    return b"\0" in block.data or last_line.count(b'"') % 2 == 1 or ends_in_a_number(block, plan)


def ends_in_a_number(block: Block, plan: Plan) -> bool:
    """Tell whether a file without a last line end stops in the middle of a number."""
    mark = plan.numbers.decimal
    return (
        not block.terminated and mark != plan.table.delimiter and block.data.endswith(mark.encode())
    )


def _fit(text: bytes, plan: Plan) -> tuple[bytes | None, str]:
    """Return the line with as many cells as the table, or the reason why it has not."""
    delimiter, width = plan.table.delimiter, plan.table.width
    cells = text.split(delimiter.encode())
    quoted = b'"' in text
    if quoted:
        found = _quoted_cells(text, delimiter)
        if found is None:
            return None, "its quotation marks are misplaced"
        cells = found
    if len(cells) == width:
        return text, ""
    if len(cells) > width and not any(cell.strip() for cell in cells[width:]):
        kept = (b'"' + c.replace(b'"', b'""') + b'"' if quoted else c for c in cells[:width])
        return delimiter.encode().join(kept), ""
    if len(cells) < width and plan.assignment.layout is Layout.PAIRS:
        return text.rstrip(b"\r") + delimiter.encode() * (width - len(cells)), ""
    return None, f"it has {len(cells)} columns instead of {width}"


def _quoted_cells(text: bytes, delimiter: str) -> list[bytes] | None:
    line = text.decode("latin-1")  # every byte stays what it is
    try:
        cells = next(csv.reader([line], delimiter=delimiter, strict=True))
    except csv.Error:
        return None
    return [cell.encode("latin-1") for cell in cells]
