"""Where year, month, day, hour, minute and second stand in a stamp, found once for every shape."""

import re
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from loop.signals import Flags

Span = tuple[int, int]

_DATE = (
    r"(?:(?P<a>\d{4}|\d{1,2})(?P<sep>[-/. ])(?P<b>\d{1,2}|(?P<bword>[A-Za-z]{3,9}))(?P=sep)"
    r"(?P<c>\d{4}|\d{1,2})"
    r"|(?P<word>[A-Za-z]{3,9})\.? (?P<wday>\d{1,2}),? (?P<wyear>\d{4})"
    r"|(?P<cyear>\d{4})(?P<cmonth>\d{2})(?P<cday>\d{2}))"
)
_CLOCK = (
    r"(?:(?P<H>\d{1,2})(?P<csep>[:.])(?P<M>\d{2})(?:(?P=csep)(?P<S>\d{2})"
    r"(?:[.,:](?P<f>\d{1,9}))?)?"
    r"|(?P<cH>\d{2})(?P<cM>\d{2})(?:(?P<cS>\d{2})(?:\.(?P<cf>\d{1,9}))?)?)"
    r"(?: ?(?P<half>[AaPp])[.]?[Mm][.]?)?"
)
_ZONE = r"(?: ?(?P<utc>Z|z|UTC|GMT)| ?(?P<sign>[+-])(?P<zh>\d{2}):?(?P<zm>\d{2})?)?"
_BOTH = re.compile(_DATE + r"(?:[ T_]{1,2}|, ?|(?<=\d{8}))" + _CLOCK + _ZONE + r"\Z")
_ONLY_DATE = re.compile(_DATE + r"\Z")
_ONLY_CLOCK = re.compile(
    r"(?P<H>\d{1,2})(?P<csep>:)(?P<M>\d{2})(?::(?P<S>\d{2})(?:[.,:](?P<f>\d{1,9}))?)?"
    r"(?: ?(?P<half>[AaPp])[.]?[Mm][.]?)?\Z"
)

MONTHS = {
    "jan": 1, "feb": 2, "mar": 3, "apr": 4, "may": 5, "jun": 6, "jul": 7, "aug": 8, "sep": 9,
    "oct": 10, "nov": 11, "dec": 12,
    "mrz": 3, "mai": 5, "okt": 10, "dez": 12,  # German
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Shape:
    """One way in which stamps are written.

    Attributes
    ----------
    width : int
        Characters of a stamp.
    spans : dict
        Where the fields stand: "first", "second", "third" for a date in digits whose order is
        open, or "year", "month", "day", "word"; "hour", "minute", "second_", "fraction", "half",
        "zone_hour", "zone_minute".
    utc_sign : int or None
        0 for UTC itself, 1 or -1 for an offset, None where the stamp states no zone.
    low, high : ndarray of uint8, shape (width,)
        Smallest and largest byte at each place; letters are compared in lower case.
    """

    width: int
    spans: dict[str, Span]
    utc_sign: int | None
    low: np.typing.NDArray[np.uint8] = field(repr=False, compare=False)
    high: np.typing.NDArray[np.uint8] = field(repr=False, compare=False)
    letters: Flags = field(repr=False, compare=False)

    @property
    def has_date(self) -> bool:
        """Whether the stamp states a date."""
        return "first" in self.spans or "day" in self.spans

    @property
    def has_clock(self) -> bool:
        """Whether the stamp states a time of day."""
        return "hour" in self.spans


@lru_cache(maxsize=16_384)
def shape_of(text: str) -> Shape | None:
    """Find the shape of one stamp, None where it is no stamp.

    >>> sorted(shape_of("05-Jan-24 10:00").spans)
    ['day', 'hour', 'minute', 'word', 'year']
    """
    if not text.isascii():
        return None
    found = _BOTH.match(text) or _ONLY_DATE.match(text) or _ONLY_CLOCK.match(text)
    if found is None:
        return None
    named = {name: found.span(name) for name, part in found.groupdict().items() if part is not None}
    spans = _date_spans(named)
    word = spans.get("word")
    if word is not None and text[word[0] : word[0] + 3].lower() not in MONTHS:
        return None
    for name, target in _CLOCK_NAMES.items():
        if name in named:
            spans[target] = named[name]
    sign: int | None = 0 if "utc" in named else None
    if "sign" in named:
        sign = 1 if found["sign"] == "+" else -1
    return _template(text, spans, sign)


def is_compact_stamp(text: str) -> bool:
    """Tell whether digits alone are a date, or a date and a time of day.

    >>> is_compact_stamp("20240205101500"), is_compact_stamp("20241305")
    (True, False)
    """
    if len(text) not in (8, 12, 14) or not text.isdecimal() or not text.isascii():
        return False
    return "19" <= text[:2] <= "20" and "01" <= text[4:6] <= "12" and "01" <= text[6:8] <= "31"


def is_midnight(text: str) -> bool:
    """Tell whether a stamp is a date with all zeros for the time of day.

    >>> is_midnight("2024-05-01 00:00:00")
    True
    """
    shape = shape_of(text)
    if shape is None or not (shape.has_date and shape.has_clock):
        return False
    if "half" in shape.spans:
        hour = text[slice(*shape.spans["hour"])]
        return hour == "12" and text[shape.spans["half"][0]] in "aA" and _is_zero(text, shape, 1)
    return _is_zero(text, shape, 0)


def _is_zero(text: str, shape: Shape, first: int) -> bool:
    names = ("hour", "minute", "second_", "fraction")[first:]
    return all(not text[slice(*shape.spans[n])].strip("0") for n in names if n in shape.spans)


_CLOCK_NAMES = {
    "H": "hour", "cH": "hour", "M": "minute", "cM": "minute", "S": "second_", "cS": "second_",
    "f": "fraction", "cf": "fraction", "half": "half", "zh": "zone_hour", "zm": "zone_minute",
}  # fmt: skip


def _date_spans(named: dict[str, Span]) -> dict[str, Span]:
    if "cyear" in named:
        return {"year": named["cyear"], "month": named["cmonth"], "day": named["cday"]}
    if "word" in named:
        return {"word": named["word"], "day": named["wday"], "year": named["wyear"]}
    if "a" not in named:
        return {}
    a, b, c = named["a"], named["b"], named["c"]
    year_first = a[1] - a[0] == 4
    if "bword" in named:
        day, year = (c, a) if year_first else (a, c)
        return {"word": b, "day": day, "year": year}
    if year_first:
        return {"year": a, "month": b, "day": c}
    return {"first": a, "second": b, "third": c}


def _template(text: str, spans: dict[str, Span], sign: int | None) -> Shape:
    low = np.frombuffer(text.encode("ascii"), dtype=np.uint8).copy()
    high = low.copy()
    letters = np.zeros(len(text), dtype=np.bool_)
    for name, (start, stop) in spans.items():
        if name in {"word", "half"}:
            low[start:stop], high[start:stop] = ord("a"), ord("z")
            letters[start:stop] = True
        else:
            low[start:stop], high[start:stop] = ord("0"), ord("9")
    return Shape(width=len(text), spans=spans, utc_sign=sign, low=low, high=high, letters=letters)
