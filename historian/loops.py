"""Put the signals of each loop on the times of its process variable."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from historian.errors import AmbiguousColumns, ColumnNotFound, ExportRefused
from historian.export import TagSignal
from historian.options import ReadOptions
from historian.tag_map import Part, group_by_loop
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
    signals: Mapping[str, TagSignal], names: tuple[str, ...], options: ReadOptions
) -> tuple[list[Membership], dict[str, ExportRefused]]:
    """Find the loops among the tags.

    Parameters
    ----------
    signals : mapping
        Signals by tag.
    names : tuple of str
        Columns of the file, for parts that are stated by number.
    options : ReadOptions
        Parts as the user states them.

    Returns
    -------
    members : list of Membership
        Loops with PV and OP.
    incomplete : dict of str to ExportRefused
        Why other loops are no records.
    """
    stated = {part: getattr(options.columns, part.value) for part in Part}
    if stated[Part.PV] is not None or stated[Part.OP] is not None:
        return _stated(signals, names, stated, options)
    members: list[Membership] = []
    incomplete: dict[str, ExportRefused] = {}
    for name, parts in group_by_loop(signals).items():
        tag = name or options.tag or ""
        twice = next(((part, found) for part, found in parts.items() if len(found) > 1), None)
        missing = [part for part in (Part.PV, Part.OP) if part not in parts]
        if twice is not None:
            part, found = twice
            incomplete[tag] = AmbiguousColumns(
                f"the {part.value} of loop {tag!r}", tuple(found), _OPTION.format(part=part.value)
            )
        elif missing:
            incomplete[tag] = ColumnNotFound(
                f"the {missing[0].value} of loop {tag!r}",
                tuple(signals),
                _OPTION.format(part=missing[0].value),
            )
        else:
            members.append(
                Membership(loop=tag, tags={part: found[0] for part, found in parts.items()})
            )
    return members, incomplete


def _stated(
    signals: Mapping[str, TagSignal],
    names: tuple[str, ...],
    stated: Mapping[Part, str | int | None],
    options: ReadOptions,
) -> tuple[list[Membership], dict[str, ExportRefused]]:
    """Take the parts as stated, and the others by their names where only one loop claims them."""
    by_name = group_by_loop(signals)
    tags = {
        part: resolve_tag(signals, names, name, part)
        for part, name in stated.items()
        if name is not None
    }
    for part in Part:
        found = [tag for parts in by_name.values() for tag in parts.get(part, [])]
        if part not in tags and len(found) == 1 and found[0] not in tags.values():
            tags[part] = found[0]
    loop = options.tag or next(
        (name for name, parts in by_name.items() if tags.get(Part.PV) in parts.get(Part.PV, [])),
        "",
    )
    missing = [part for part in (Part.PV, Part.OP) if part not in tags]
    if missing:
        refusal = ColumnNotFound(
            f"the {missing[0].value}", tuple(signals), _OPTION.format(part=missing[0].value)
        )
        return [], {loop: refusal}
    return [Membership(loop=loop, tags=tags)], {}


def resolve_tag(
    signals: Mapping[str, TagSignal], names: tuple[str, ...], name: str | int, part: Part
) -> str:
    """Find a signal by its tag, or by its column counted from 1."""
    if isinstance(name, str) and name in signals:
        return name
    if isinstance(name, int) or name.isdigit():
        number = int(name)
        if 1 <= number <= len(names):
            for tag in signals:
                if tag == names[number - 1] or names[number - 1].startswith(tag):
                    return tag
            if len(signals) == 1:
                return next(iter(signals))
        raise ColumnNotFound(part.value, tuple(signals), f"column {number} holds no values")
    folded = [tag for tag in signals if tag.casefold() == name.strip().casefold()]
    if len(folded) == 1:
        return folded[0]
    raise ColumnNotFound(part.value, tuple(signals), f"there is no column or tag named {name!r}")


def held_on(signal: TagSignal, time: np.typing.NDArray[np.generic]) -> tuple[Real, bool]:
    """Put a signal on other times by holding its last sample, as the historian stored it.

    Returns
    -------
    values : ndarray, shape (n,)
        NaN before the first sample and through gaps.
    held : bool
        Whether any time is not one of the signal's own.
    """
    if signal.time is time or np.array_equal(signal.time, time):
        return signal.value, False
    place = np.searchsorted(signal.time, time, side="right") - 1
    values = np.where(place >= 0, signal.value[np.maximum(place, 0)], np.nan)
    return values, True


def as_modes(values: Real) -> Codes:
    """Turn held numbers of modes into codes; before the first sample the mode is unknown."""
    return np.where(np.isnan(values), float(Mode.UNKNOWN), values).astype(np.int8)
