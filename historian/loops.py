"""Put the signals of each loop on the times of its process variable."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from historian.errors import AmbiguousColumns, ColumnNotFound, ExportRefused
from historian.export import TagSignal, Times
from historian.options import ReadOptions
from historian.streams import Values
from historian.tag_map import Part, group_by_loop, split_unit
from loop.record import Mode
from loop.signals import Codes, Real

_OPTION = "name it with columns {part}=..."


@dataclass(frozen=True, slots=True, kw_only=True)
class Membership:
    """Which tag plays which part in a loop.

    Attributes
    ----------
    loop : str
        Name of the loop, possibly empty.
    tags : dict of Part to str
        Tag of every part.
    """

    loop: str
    tags: Mapping[Part, str]


def find_members(
    tags: Iterable[str], columns: Mapping[int, str], options: ReadOptions
) -> tuple[list[Membership], dict[str, ExportRefused]]:
    """Find the loops among the tags.

    Parameters
    ----------
    tags : iterable of str
        Tags of the file.
    columns : mapping of int to str
        Tag of each value column, counted from 1, for parts that are stated by number.
    options : ReadOptions
        Parts as the user states them.

    Returns
    -------
    members : list of Membership
        Loops with PV and OP.
    incomplete : dict of str to ExportRefused
        Why other loops are no records.
    """
    tags = tuple(tags)
    stated = {part: getattr(options.columns, part.value) for part in Part}
    if any(name is not None for name in stated.values()):
        return _stated(tags, columns, stated, options.tag)
    members: list[Membership] = []
    incomplete: dict[str, ExportRefused] = {}
    for name, parts in group_by_loop(tags).items():
        loop = name or options.tag or ""
        refusal = _refusal(loop, parts, tags)
        if refusal is not None:
            incomplete[loop] = refusal
        else:
            found = {part: names[0] for part, names in parts.items()}
            members.append(Membership(loop=loop, tags=found))
    return members, incomplete


def _refusal(
    loop: str, parts: Mapping[Part, list[str]], tags: tuple[str, ...]
) -> ExportRefused | None:
    named = f" of loop {loop!r}" if loop else ""
    for part, found in parts.items():
        if len(found) > 1:
            return AmbiguousColumns(
                f"the {part.value}{named}", tuple(found), _OPTION.format(part=part.value)
            )
    for part in (Part.PV, Part.OP):
        if part not in parts:
            return ColumnNotFound(f"the {part.value}{named}", tags, _OPTION.format(part=part.value))
    return None


def _stated(
    tags: tuple[str, ...],
    columns: Mapping[int, str],
    stated: Mapping[Part, str | int | None],
    name: str | None,
) -> tuple[list[Membership], dict[str, ExportRefused]]:
    """Take the parts as stated, and the others by their names where only one tag claims them."""
    by_name = group_by_loop(tags)
    chosen = {
        part: _tag_named(tags, columns, wanted, part)
        for part, wanted in stated.items()
        if wanted is not None
    }
    for part in Part:
        claims = [tag for parts in by_name.values() for tag in parts.get(part, [])]
        if part not in chosen and len(claims) == 1 and claims[0] not in chosen.values():
            chosen[part] = claims[0]
    loop = name or next(
        (loop for loop, parts in by_name.items() if chosen.get(Part.PV) in parts.get(Part.PV, [])),
        "",
    )
    refusal = _refusal(loop, {part: [tag] for part, tag in chosen.items()}, tags)
    if refusal is not None:
        return [], {loop: refusal}
    return [Membership(loop=loop, tags=chosen)], {}


def _tag_named(
    tags: tuple[str, ...], columns: Mapping[int, str], wanted: str | int, part: Part
) -> str:
    """Find a tag by its name, or by its column counted from 1."""
    name = str(wanted).strip()
    if name in tags:
        return name
    if name.isdecimal() and int(name) in columns:
        return columns[int(name)]
    for fold in (str.casefold, lambda text: split_unit(text)[0].casefold()):
        found = [tag for tag in tags if fold(tag) == fold(name)]
        if len(found) == 1:
            return found[0]
    raise ColumnNotFound(part.value, tags, f"there is no column or tag {wanted!r} with values")


def held_on(signal: TagSignal, time: Times) -> tuple[Values, bool]:
    """Put a signal on other times by holding its last sample, as the historian stored it.

    Returns
    -------
    values : ndarray, shape (n,)
        NaN (or UNKNOWN) before the first sample and through gaps.
    held : bool
        Whether any time is not one of the signal's own.
    """
    if signal.time is time or np.array_equal(signal.time, time):
        return signal.value, False
    if not signal.value.size:
        if signal.is_mode:
            return np.full(time.size, Mode.UNKNOWN, dtype=np.int8), True
        return np.full(time.size, np.nan), True
    place = np.searchsorted(signal.time, time, side="right") - 1
    gap = np.array(Mode.UNKNOWN if signal.is_mode else np.nan, dtype=signal.value.dtype)
    return np.where(place >= 0, signal.value[np.maximum(place, 0)], gap), True


def as_numbers(values: Values) -> Real:
    """Take values as numbers."""
    return values.astype(np.float64, copy=False)


def as_codes(values: Values) -> Codes:
    """Take values as modes; numbers that no map explains are UNKNOWN."""
    if values.dtype == np.int8:
        return values.astype(np.int8, copy=False)
    return np.full(values.size, Mode.UNKNOWN, dtype=np.int8)
