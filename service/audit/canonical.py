"""One byte sequence for one JSON value, after RFC 8785 (JSON Canonicalization Scheme) [1]_.

A published form lets anybody recompute a hash of an export in any language, without this program.

References
----------
.. [1] A. Rundgren, B. Jordan, S. Erdtman, "JSON Canonicalization Scheme (JCS)", RFC 8785, 2020.
"""

import json
import math
from collections.abc import Mapping, Sequence

# Beyond this, readers that keep numbers as doubles may see another integer; such a one is refused
# unless it is how a double itself is written.
_LARGEST_INTEGER = 2**53 - 1


def canonical(value: object) -> bytes:
    r"""Serialise a JSON value as RFC 8785 does: sorted names, no spaces, shortest numbers.

    Parameters
    ----------
    value : object
        None, bool, int, float, str, and mappings with text keys and sequences of these.

    Returns
    -------
    bytes
        UTF-8 text.

    Raises
    ------
    ValueError
        A number is not finite, or an integer is too large for a double.
    TypeError
        The value is none of JSON's.

    Examples
    --------
    >>> canonical({"b": [1.0, 1e21, True], "a": "é"})
    b'{"a":"\xc3\xa9","b":[1,1e+21,true]}'
    """
    return _text(value).encode()


def _text(value: object) -> str:
    match value:
        case None | bool() | str():
            return json.dumps(value, ensure_ascii=False)
        case int():
            if abs(value) <= _LARGEST_INTEGER or _is_written_by_a_double(value):
                return str(value)
            raise ValueError("an integer is too large for a JSON number")
        case float():
            return _number(value)
        case Mapping():
            # RFC 8785 section 3.2.3: names sort by their UTF-16 code units.
            names = sorted(value, key=lambda name: name.encode("utf-16-be"))
            return "{" + ",".join(f"{_text(name)}:{_text(value[name])}" for name in names) + "}"
        case Sequence():
            return "[" + ",".join(map(_text, value)) + "]"
        case _:
            raise TypeError(f"{type(value).__name__} is not a JSON type")


def _is_written_by_a_double(value: int) -> bool:
    return abs(value) < 10**21 and str(value) == _number(float(value))


def _number(value: float) -> str:
    """Write a number as ECMAScript does (RFC 8785 section 3.2.2.3).

    Python and ECMAScript agree on the shortest digits that read back; they differ in the layout.
    """
    if not math.isfinite(value):
        raise ValueError(f"{value} is not a JSON number")
    if value == 0:
        return "0"
    sign = "-" if value < 0 else ""
    mantissa, _, exponent = f"{abs(value)!r}e0".partition("e")
    whole, _, fraction = mantissa.partition(".")
    digits = (whole + fraction).lstrip("0")
    point = len(whole) + int(exponent.partition("e")[0])  # digits before the decimal point
    point -= len(whole + fraction) - len(digits)
    digits = digits.rstrip("0")
    if len(digits) <= point <= 21:
        return sign + digits.ljust(point, "0")
    if 0 < point <= 21:
        return f"{sign}{digits[:point]}.{digits[point:]}"
    if -6 < point <= 0:
        return f"{sign}0.{'0' * -point}{digits}"
    tail = f".{digits[1:]}" if len(digits) > 1 else ""
    return f"{sign}{digits[0]}{tail}e{point - 1:+d}"
