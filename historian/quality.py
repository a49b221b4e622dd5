"""Words and codes that say a value is no value: they become gaps, never numbers."""

import re
from collections.abc import Iterable, Mapping
from enum import Enum
from functools import lru_cache

_BAD_WORDS = (
    # system states of PI, also written without blanks
    "No Data", "Bad", "Bad Input", "I/O Timeout", "Intf Shut", "Pt Created", "Calc Failed",
    "Calc Timeout", "Calc Crash", "Calc Off", "Calc Overflow", "Arc Off-line", "Arc Offline",
    "Configure", "Not Connect", "Not Connected", "Shutdown", "Snapfix", "Bad Quality", "Bad Data",
    "Bad Output", "Bad Total", "Bad_Value", "Comm Fail", "Comm Error", "DCS Failed", "Doubtful",
    "Equip Fail", "Error", "Fail", "Failed", "Inp OutRange", "Invalid Data", "Invalid Float",
    "ISU Saw No Data", "No Lab Data", "Bad Lab Data", "No Result", "No Sample", "No Value",
    "Out of Serv", "Over Range", "Under Range", "Sample Bad", "Scan Off", "Scan Timeout",
    "Set to Bad", "Stale", "Substituted", "Timeout", "Undefined", "Unit Down", "Unknown",
    "Access Denied", "No_Sample", "GreaterMM", "Unsupported", "Digital State",
    # Excel, DataLink, databases
    "#N/A", "#VALUE!", "#REF!", "#NAME?", "#NUM!", "#DIV/0!", "#NULL!", "#GETTING_DATA",
    "Resize to show all values", "NA", "N/A", "n.a.", "NaN", "-NaN", "nan(ind)", "-nan(ind)",
    "1.#QNAN", "-1.#IND", "1.#IND", "NULL", "nil", "None", "missing", "MISSING", "NoValue",
    # screens and SCADA
    "GATED", "-", "--", "---", "----", "?", "??", "???", "****", "*****", "******", ".",
    "Invalid", "Uncertain", "Not Good", "Questionable", "Offline", "Off-line", "Disconnected",
    "No Comm", "Out of Service", "OOS",
)  # fmt: skip
_PI_ERROR = re.compile(r"^\[-?\d+\]")


def plain_word(text: str) -> str:
    """Fold case and drop blanks, so that "Intf Shut" and "INTFSHUT" are one word."""
    return "".join(text.split()).casefold()


_BAD = frozenset(plain_word(word) for word in _BAD_WORDS)


@lru_cache(maxsize=4096)
def is_bad_word(text: str) -> bool:
    """Tell whether a cell states that there is no good value."""
    return plain_word(text) in _BAD or _PI_ERROR.match(text.strip()) is not None


def bad_spellings() -> list[str]:
    """List usual spellings of the bad words, for a reader that compares literally."""
    spellings: dict[str, None] = {}
    for word in _BAD_WORDS:
        for spelling in (word, word.replace(" ", ""), word.upper(), word.lower()):
            spellings[spelling] = None
    return list(spellings)


class Scheme(Enum):
    """What the codes in a quality column mean."""

    WORDS = "words such as Good and Bad"
    OPC = "OPC codes: 192 and above is good"
    VALIDITY = "1 is good, 0 is bad"
    IP21 = "IP.21 status: 0 and 4 are good"
    PERCENT = "percent good: 100 is good"
    STATED = "the good codes stated by the user"


_GOOD_WORDS = frozenset({"good", "ok", "valid", "goodquality", "true", "g", "good-noncascade"})
_DOUBTFUL_WORDS = frozenset(
    {"bad", "suspect", "uncertain", "invalid", "false", "questionable", "b", "s", "u", "?",
     "error", "fail", "failed", "stale", "substituted", "notgood", "badquality", "offline",
     "old", "missing", "gated", "unknown", "nok", "notok"}
)  # fmt: skip


def is_quality_word(text: str) -> bool:
    """Tell whether a cell is a word of a quality column."""
    word = plain_word(text)
    return word in _GOOD_WORDS or word in _DOUBTFUL_WORDS or _opc_words(word) is not None


def is_good_word(text: str) -> bool:
    """Tell whether a cell is a word for good quality."""
    word = plain_word(text)
    return word in _GOOD_WORDS or _opc_words(word) is True


def _opc_words(word: str) -> bool | None:
    """Read compound words such as "Good, Non-Cascade" or "Bad: Comm Failure"."""
    first = re.split(r"[,:;\[(\-/]", word, maxsplit=1)[0]
    if first == word:
        return None
    if first in _GOOD_WORDS:
        return True
    return False if first in _DOUBTFUL_WORDS else None


_NUMERIC: Mapping[Scheme, frozenset[float]] = {
    Scheme.VALIDITY: frozenset({0.0, 1.0}),
    Scheme.IP21: frozenset({0.0, 1.0, 2.0, 4.0, 5.0, 6.0}),
}
_HEADER_SCHEMES = (
    (frozenset({"validity", "valid", "isvalid", "good", "isgood"}), Scheme.VALIDITY),
    (frozenset({"l", "ip_input_quality"}), Scheme.IP21),
    (frozenset({"dataintegrity", "opcquality", "qualitycode", "opcqualitycode"}), Scheme.OPC),
)


def decide_scheme(header: str, cells: Iterable[str]) -> Scheme | None:
    """Decide what the codes of a quality column mean, None where they do not tell.

    Parameters
    ----------
    header : str
        Name of the column, empty where there is none.
    cells : iterable of str
        Cells of the column, as far as they were looked at.
    """
    seen = {cell.strip() for cell in cells} - {""}
    numbers = {_number(cell) for cell in seen} - {None}
    if not numbers:
        return Scheme.WORDS
    name = plain_word(header)
    for names, scheme in _HEADER_SCHEMES:
        if name in names:
            return scheme
    if any(number is not None and number > 100 for number in numbers):
        return Scheme.OPC
    if name == "dataquality" and 100.0 in numbers:
        return Scheme.PERCENT
    return None


def is_good(cell: str, scheme: Scheme, stated: frozenset[str] | None) -> bool | None:
    """Tell whether a cell of a quality column means good, None where it is not known."""
    if stated is not None:
        return cell.strip() in stated
    number = _number(cell)
    if number is None or scheme is Scheme.WORDS:
        return is_good_word(cell) if is_quality_word(cell) else None
    if scheme is Scheme.OPC:
        return number >= 192
    if scheme is Scheme.PERCENT:
        return number >= 100
    if number not in _NUMERIC[scheme]:
        return None
    return number == 1 if scheme is Scheme.VALIDITY else number in (0, 4)


def _number(cell: str) -> float | None:
    try:
        return float(cell.strip().replace(",", "."))
    except ValueError:
        return None
