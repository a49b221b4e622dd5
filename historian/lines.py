"""Sort the lines of a block that is not a clean table: samples, remarks and damaged lines."""

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
        if not text.strip():
            ledger.passed_over["empty lines"] += 1
            continue
        reason = None
        if b"\0" in text:
            reason = "it holds NUL bytes"
        elif b"\r" in text.rstrip(b"\r"):
            reason = "it holds a carriage return"
        elif text.count(b'"') % 2:
            reason = "a quotation mark is not closed"
        elif number == last and ends_in_a_number(block, plan):
            reason = "its last number ends in the decimal mark"
        if reason is None:
            fitted, reason = _fit(text, plan, ledger)
            if fitted is not None:
                good.texts.append(fitted)
                good.numbers.append(number)
                continue
        if reason:
            if number == last and not block.terminated:
                reason = f"the last line is cut off, {reason}"
            ledger.rows_read[""] += 1
            ledger.reject_row(number, text_of(text, plan.encoding), reason)
    return good


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


def _fit(text: bytes, plan: Plan, ledger: Ledger) -> tuple[bytes | None, str | None]:
    """Return the line with as many cells as the table, or the reason why it has not."""
    delimiter, width = plan.table.delimiter, plan.table.width
    if b'"' in text:
        cells = split_cells(text_of(text, plan.encoding), delimiter)
        found = len(cells)
    else:
        found = text.count(delimiter.encode()) + 1
        cells = []
    if found == width and not text.startswith((b"*", b"#", b"/")):
        return text, None
    shown = text_of(text, plan.encoding)
    for what, fits in (
        ("comments", is_comment(shown)),
        ("sections", is_section(shown)),
        ("footers", shown.startswith('"$RT_')),
    ):
        if fits:
            ledger.passed_over[what] += 1
            return None, None
    if found == width:
        return text, None
    cells = cells or split_cells(shown, delimiter)
    if found > width and not any(cells[width:]):
        return _rebuilt(text, cells, width, delimiter), None
    if found < width and plan.assignment.layout is Layout.PAIRS:
        return text + delimiter.encode() * (width - found), None
    if all(plan.heading_of(column) == cell for column, cell in enumerate(cells[:2])):
        ledger.passed_over["repeated headings"] += 1
        return None, None
    return None, f"it has {found} columns instead of {width}"


def _rebuilt(text: bytes, cells: list[str], width: int, delimiter: str) -> bytes:
    if b'"' in text:
        quoted = ('"' + cell.replace('"', '""') + '"' for cell in cells[:width])
        return delimiter.join(quoted).encode()
    return delimiter.encode().join(text.split(delimiter.encode())[:width])
