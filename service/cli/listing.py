"""Lists on a terminal: aligned columns that a narrow window does not cut."""

from collections.abc import Sequence
from datetime import datetime

import typer


def print_columns(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows in columns as wide as they need to be."""
    lines = [headings, *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        cells = (cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        typer.echo("  ".join(cells).rstrip())


def moment(at: datetime | None) -> str:
    """Write a time to the second in UTC, a dash for none."""
    return "-" if at is None else at.strftime("%Y-%m-%d %H:%M:%SZ")
