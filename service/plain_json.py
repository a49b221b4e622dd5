"""Python values as JSON that every reader accepts: no NaN, no infinity, no foreign types."""

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from datetime import datetime
from enum import Enum

import numpy as np


def dump_strictly(value: object) -> str:
    """Write a value for a JSON column; NaN and infinity are refused rather than lost."""
    return json.dumps(value, allow_nan=False)


def plain(value: object) -> object:
    """Turn a value into what JSON can say; a number that is not finite becomes null.

    Mappings, sequences, dataclasses, enumerations, instants (ISO 8601) and numpy values are
    understood; anything else is written as its text.
    """
    match value:
        case Enum():
            return plain(value.value)
        case None | bool() | int() | str():
            return value
        case float():
            return value if math.isfinite(value) else None
        case datetime():
            return value.isoformat()
        case np.generic() | np.ndarray():
            return plain(value.tolist())
        case Mapping():
            return {str(key): plain(item) for key, item in value.items()}
        case list() | tuple() | set() | frozenset():
            return [plain(item) for item in value]
        case _ if is_dataclass(value):
            return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
        case _:
            return str(value)
