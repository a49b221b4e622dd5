"""Facts that stop an export from being read, each with the place and what to do about it."""

from loop.errors import LoopError


class ExportRefused(LoopError):
    """The file cannot be read as a historian export.

    Attributes
    ----------
    reason : str
        What is wrong and what to do, as a sentence.
    line : int or None
        Line of the file, counted from 1.
    column : str or None
        Column of the file, by its name in the header or its number.
    """

    def __init__(self, reason: str, *, line: int | None = None, column: str | None = None) -> None:
        place = ", ".join(
            part
            for part in (
                f"line {line}" if line is not None else "",
                f"column {column!r}" if column is not None else "",
            )
            if part
        )
        super().__init__(f"{place[:1].upper()}{place[1:]}: {reason}" if place else reason)
        self.reason = reason
        self.line = line
        self.column = column


class ExportTooLarge(ExportRefused):
    """The file, or what an archive unpacks to, is larger than allowed."""

    def __init__(self, limit: int, *, unpacked: bool) -> None:
        what = "unpacks to" if unpacked else "holds"
        super().__init__(
            f"The file {what} more than the limit of {limit:,} bytes; export a shorter span, "
            "or raise max_bytes."
        )
        self.limit = limit


class AmbiguousTime(ExportRefused):
    """A time stamp has several readings and nothing in the file tells which is meant.

    Attributes
    ----------
    stamp : str
        The stamp as it stands in the file.
    readings : tuple of str
        What it may mean.
    """

    def __init__(
        self,
        stamp: str,
        readings: tuple[str, ...],
        remedy: str,
        *,
        line: int | None = None,
        column: str | None = None,
    ) -> None:
        super().__init__(
            f"The time {stamp!r} may mean {' or '.join(readings)}, and no row of the file tells "
            f"which; {remedy}.",
            line=line,
            column=column,
        )
        self.stamp = stamp
        self.readings = readings


class AmbiguousNumber(ExportRefused):
    """A number has two readings: its comma may mark decimals or thousands."""

    def __init__(
        self, text: str, readings: tuple[str, ...], *, line: int | None, column: str | None
    ) -> None:
        super().__init__(
            f"The number {text!r} may mean {' or '.join(readings)}; state the decimal mark with "
            "decimal=',' or decimal='.'.",
            line=line,
            column=column,
        )
        self.text = text
        self.readings = readings


class ColumnNotFound(ExportRefused):
    """A column that is needed is absent, or not recognised by its name.

    Attributes
    ----------
    role : str
        What the column is needed for: time, pv, op ...
    columns : tuple of str
        The columns or tags the file has.
    """

    def __init__(self, role: str, columns: tuple[str, ...], remedy: str) -> None:
        super().__init__(f"No column is recognised as {role}; {remedy}. {_listed(columns)}")
        self.role = role
        self.columns = columns


class AmbiguousColumns(ExportRefused):
    """Several columns claim the same part in a loop, or several loops are in the file."""

    def __init__(self, role: str, columns: tuple[str, ...], remedy: str) -> None:
        super().__init__(f"Several columns may be {role}; {remedy}. {_listed(columns)}")
        self.role = role
        self.columns = columns


def _listed(columns: tuple[str, ...], most: int = 40) -> str:
    shown = ", ".join(columns[:most])
    more = f" and {len(columns) - most} more" if len(columns) > most else ""
    return f"The choice is: {shown}{more}."
