"""Numbers and words as the API accepts them, with their limits."""

import re
from typing import Annotated, TypeAlias

from pydantic import AfterValidator, AwareDatetime, BeforeValidator, Field, StringConstraints


def _one_line(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must be one line of printable characters")
    return text


def _several_lines(text: str) -> str:
    if not all(character.isprintable() or character in "\n\t" for character in text):
        raise ValueError("must hold printable characters, tabs and line ends only")
    return text


Word: TypeAlias = Annotated[
    str,
    StringConstraints(min_length=1, max_length=100, strip_whitespace=True),
    AfterValidator(_one_line),
]
Unit: TypeAlias = Annotated[
    str, StringConstraints(max_length=30, strip_whitespace=True), AfterValidator(_one_line)
]
Line: TypeAlias = Annotated[
    str, StringConstraints(max_length=300, strip_whitespace=True), AfterValidator(_one_line)
]
Reason: TypeAlias = Annotated[
    str,
    StringConstraints(min_length=3, max_length=2000, strip_whitespace=True),
    AfterValidator(_several_lines),
]


def _written_out(value: object) -> object:
    """Refuse a bare number, which pydantic would read as seconds since 1970."""
    if isinstance(value, str) and not re.match(r"\d{4}-\d{2}-\d{2}[T ]", value):
        raise ValueError("must be a date and a time with its zone, such as 2026-01-31T08:00:00Z")
    return value


Moment: TypeAlias = Annotated[AwareDatetime, Field(strict=False), BeforeValidator(_written_out)]

# The limits of loop.process and loop.controller; they also catch milliseconds sent as seconds.
Seconds: TypeAlias = Annotated[float, Field(ge=1e-9, le=1e9, allow_inf_nan=False)]
SecondsOrNone: TypeAlias = Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)]
Quantity: TypeAlias = Annotated[float, Field(ge=-1e12, le=1e12, allow_inf_nan=False)]
Positive: TypeAlias = Annotated[float, Field(gt=0, le=1e12, allow_inf_nan=False)]
VersionNumber: TypeAlias = Annotated[int, Field(ge=1, le=2**31 - 1)]
