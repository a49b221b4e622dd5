"""What one benchmark found: a table, the targets beside it and the words that explain both."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Self, TypeAlias

Table: TypeAlias = tuple[tuple[str, ...], ...]
Json: TypeAlias = "bool | int | float | str | list[Json] | dict[str, Json] | None"


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A limit that was set before measuring.

    Attributes
    ----------
    what : str
        What is limited.
    limit, reached : float
        The limit and the measured value, in `unit`.
    unit : str
        Unit of both, as printed behind the number.
    at_least : bool
        The measured value is to reach the limit from above instead of from below.
    """

    what: str
    limit: float
    reached: float
    unit: str
    at_least: bool = False

    @property
    def met(self) -> bool:
        """The measured value keeps the limit."""
        return self.reached >= self.limit if self.at_least else self.reached <= self.limit

    def __str__(self) -> str:
        """Say in one line what was wanted, what was measured and whether that is enough."""
        word = "at least" if self.at_least else "at most"
        verdict = "met" if self.met else "**missed**"
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{self.what}: {self.reached:.3g}{unit} (target {word} {self.limit:g}{unit}): {verdict}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """The result of one benchmark.

    Attributes
    ----------
    title : str
        Heading.
    how : str
        What was measured and how the answers were checked.
    columns : tuple of str
        Heads of the table.
    rows : tuple of tuple of str
        Its cells as printed.
    targets : tuple of Target
        Limits that were set beforehand.
    notes : tuple of str
        Where peers do other work than ours, and where ours falls short.
    """

    title: str
    how: str
    columns: tuple[str, ...]
    rows: Table
    targets: tuple[Target, ...] = ()
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"{len(self.columns)} columns, but the row {row} has {len(row)}")

    def to_json(self) -> dict[str, Json]:
        """Turn into what the json module writes."""
        return asdict(self)

    @classmethod
    def from_json(cls, body: Mapping[str, Json]) -> Self:
        """Read back what `to_json` gave."""
        rows, targets = body["rows"], body["targets"]
        assert isinstance(rows, list)
        assert isinstance(targets, list)
        return cls(
            title=str(body["title"]),
            how=str(body["how"]),
            columns=_words(body["columns"]),
            rows=tuple(_words(row) for row in rows),
            targets=tuple(_target(target) for target in targets),
            notes=_words(body["notes"]),
        )


def _words(cells: Json) -> tuple[str, ...]:
    assert isinstance(cells, list)
    return tuple(str(cell) for cell in cells)


def _target(body: Json) -> Target:
    assert isinstance(body, dict)
    limit, reached = body["limit"], body["reached"]
    assert isinstance(limit, float | int)
    assert isinstance(reached, float | int)
    return Target(
        what=str(body["what"]),
        limit=limit,
        reached=reached,
        unit=str(body["unit"]),
        at_least=bool(body["at_least"]),
    )


def as_markdown(section: Section) -> str:
    """Write the section as Markdown: how, table, targets, notes."""
    lines = [f"## {section.title}", "", section.how, ""]
    lines.append("| " + " | ".join(section.columns) + " |")
    lines.append("|" + "---|" * len(section.columns))
    lines += ["| " + " | ".join(row) + " |" for row in section.rows]
    for entries in (tuple(str(target) for target in section.targets), section.notes):
        if entries:
            lines.append("")
            lines += [f"- {entry}" for entry in entries]
    return "\n".join(lines) + "\n"


def as_text(section: Section) -> str:
    """Write the section for a terminal, its columns aligned."""
    table = (section.columns, *section.rows)
    widths = [max(len(cell) for cell in column) for column in zip(*table, strict=True)]
    lines = [section.title, section.how, ""]
    lines += [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in table
    ]
    lines += [f"* {target}" for target in section.targets]
    lines += [f"- {note}" for note in section.notes]
    return "\n".join(lines) + "\n"
