"""Find the set point, process variable, output and mode of every loop by the names of the tags."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache


class Part(StrEnum):
    """Part that a signal plays in a loop."""

    PV = "pv"
    SP = "sp"
    OP = "op"
    MODE = "mode"


_SUFFIXES = {
    "PV": Part.PV,
    "SP": Part.SP,
    "SV": Part.SP,
    "SPT": Part.SP,
    "SETPOINT": Part.SP,
    "OP": Part.OP,
    "MV": Part.OP,
    "CO": Part.OP,
    "OUT": Part.OP,
    "OUTPUT": Part.OP,
    "MODE": Part.MODE,
}
# Fieldbus-style paths name the member of the parameter after it: PID1/PV.CV, PID1/MODE.ACTUAL
_MEMBER = re.compile(r"(?<=.)\.(?:CV|ACTUAL|VALUE|F_CV|A_CV)\Z", re.IGNORECASE)
_UNIT = re.compile(r"\s*(?:\((?P<round>[^()]*)\)|\[(?P<square>[^\[\]]*)\])\Z")


@dataclass(frozen=True, slots=True)
class TagPart:
    """What a tag is by its name.

    Attributes
    ----------
    loop : str
        Name of the loop, empty where the tag is only "PV" or "SP".
    part : Part
        Its part in the loop.
    """

    loop: str
    part: Part


def split_unit(header: str) -> tuple[str, str]:
    """Split "FIC101.PV (m3/h)" into the tag and its unit.

    >>> split_unit("TIC7.PV [degC]")
    ('TIC7.PV', 'degC')
    """
    header = header.strip()
    found = _UNIT.search(header)
    if found is None or found.start() == 0:
        return header, ""
    return header[: found.start()], (found["round"] or found["square"] or "").strip()


@lru_cache(maxsize=65_536)
def part_of(tag: str) -> TagPart | None:
    """Read the part of a tag from its name, None where the name does not tell.

    >>> part_of("FIC101.MV")
    TagPart(loop='FIC101', part=<Part.OP: 'op'>)
    """
    name = _MEMBER.sub("", split_unit(tag)[0])
    upper = name.upper()
    for suffix, part in _SUFFIXES.items():
        if upper == suffix:
            return TagPart("", part)
        if upper.endswith(suffix) and name[-len(suffix) - 1] in " ._/\\:|-":
            loop = name[: -len(suffix) - 1].rstrip(" ._/\\:|-")
            if loop:
                return TagPart(loop, part)
    return None


def same_tag(stated: str | int, tag: str) -> bool:
    """Tell whether a user means a tag, whatever its case and with or without its unit."""
    wanted = str(stated).strip().casefold()
    return wanted in {tag.casefold(), split_unit(tag)[0].casefold()}


def group_by_loop(tags: Iterable[str]) -> dict[str, dict[Part, list[str]]]:
    """Group tags by loop and part, in the order of the file; unknown names are left out."""
    loops: dict[str, dict[Part, list[str]]] = {}
    for tag in tags:
        found = part_of(tag)
        if found is not None:
            loops.setdefault(found.loop, {}).setdefault(found.part, []).append(tag)
    return loops
