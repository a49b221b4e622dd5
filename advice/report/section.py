"""A section of the page: figures, tables and sentences under one heading."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from advice.report.drawing import Figure

Section: TypeAlias = dict[str, object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Rows under a head; the first column is text, the others are numbers."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


def section(
    title: str,
    figures: Mapping[str, tuple[Figure, str]],
    *,
    tables: Sequence[Table] = (),
    sentences: Sequence[str] = (),
) -> Section:
    """Put a section together for the template.

    Parameters
    ----------
    title : str
        Heading.
    figures : mapping of str to (Figure, str)
        Drawings and captions by the name that is unique on the page.
    tables : sequence of Table
        Tables below the figures.
    sentences : sequence of str
        Sentences below the tables.
    """
    return {
        "title": title,
        "figures": [
            {"id": name, "figure": figure, "caption": caption}
            for name, (figure, caption) in figures.items()
        ],
        "tables": list(tables),
        "sentences": list(sentences),
    }
