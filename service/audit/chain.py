"""The hash chain: how a line's hash is made, and how a chain is proved intact, also offline."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

from service.audit.canonical import canonical

GENESIS = "0" * 64


def line_hash(line: Mapping[str, object]) -> str:
    """Hash one line of the trail: SHA-256 of its canonical JSON without the member `hash`.

    The member `previous` carries the hash of the line before, so each hash stands for all lines
    up to its own.
    """
    return hashlib.sha256(
        canonical({name: value for name, value in line.items() if name != "hash"})
    ).hexdigest()


def instant_text(at: datetime) -> str:
    """Write a moment as the chain hashes it: UTC, always with six decimals, ending in Z."""
    return at.astimezone(UTC).replace(tzinfo=None).isoformat(timespec="microseconds") + "Z"


@dataclass(frozen=True, slots=True, kw_only=True)
class Break:
    """The first place where a chain does not hold.

    Attributes
    ----------
    row : int
        Number of the line.
    reason : str
        What is wrong with it.
    """

    row: int
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Whether a chain is intact.

    Attributes
    ----------
    intact : bool
        Every line holds.
    rows : int
        Lines read, up to the first break.
    head : str
        Hash of the last line that holds; 64 zeros for an empty trail.
    first_broken : Break or None
        Where the chain breaks.
    known_head_row : int or None
        Line of the head hash that was asked about.
    """

    intact: bool
    rows: int
    head: str
    first_broken: Break | None = None
    known_head_row: int | None = None


def verify_chain(
    lines: Iterable[Mapping[str, object]],
    *,
    known_head: str | None = None,
    stated_rows: int | None = None,
    stated_head: str | None = None,
) -> Verdict:
    """Prove a chain intact or name its first broken line.

    Parameters
    ----------
    lines : iterable of mapping
        The lines in order, with the members `id`, `previous`, `hash` and everything hashed.
    known_head : str, optional
        A head hash kept elsewhere. Only this shows that lines were removed at the end, or that
        the whole chain was written anew.
    stated_rows, stated_head : int and str, optional
        What the database itself, or the export's first line, says about the end of the chain.
    """
    previous, rows = GENESIS, 0
    known_row = 0 if known_head == GENESIS else None
    for line in lines:
        fault = _fault(line, rows + 1, previous)
        if fault is not None:
            return _broken(rows, previous, Break(row=rows + 1, reason=fault))
        previous, rows = str(line["hash"]), rows + 1
        if previous == known_head:
            known_row = rows
    if stated_rows is not None and (rows, previous) != (stated_rows, stated_head):
        return _broken(
            rows,
            previous,
            Break(
                row=min(rows, stated_rows) + 1,
                reason=f"The trail ends after {rows} lines, its head states {stated_rows}.",
            ),
        )
    if known_head is not None and known_row is None:
        return _broken(
            rows,
            previous,
            Break(
                row=rows + 1,
                reason="The known head is not in the chain: lines were removed or rewritten.",
            ),
        )
    return Verdict(intact=True, rows=rows, head=previous, known_head_row=known_row)


def verify_export(lines: Iterable[str], *, known_head: str | None = None) -> Verdict:
    """Prove an export (JSON Lines, as GET /v1/audit/export gives it) intact, offline.

    Raises
    ------
    ValueError
        The text is not an export of an audit trail.
    """
    texts = iter(lines)
    try:
        header = json.loads(next(texts, ""))
        rows, head = int(header["rows"]), str(header["head"])
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError("the first line of an audit export states its rows and head") from error
    return verify_chain(
        (json.loads(text) for text in texts if text.strip()),
        known_head=known_head,
        stated_rows=rows,
        stated_head=head,
    )


def _fault(line: Mapping[str, object], expected: int, previous: str) -> str | None:
    if line.get("id") != expected:
        return f"Line {expected} is missing; the next one is {line.get('id')}."
    if line.get("previous") != previous:
        return "It does not follow from the line before it."
    try:
        matches = line.get("hash") == line_hash(line)
    except (ValueError, TypeError):
        return "Its content is not JSON."
    return None if matches else "Its content does not match its hash."


def _broken(rows: int, head: str, first: Break) -> Verdict:
    return Verdict(intact=False, rows=rows, head=head, first_broken=first)
