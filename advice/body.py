"""What every JSON document is made of: numbers, processes, margins, settings.

Numbers keep full precision. null stands for an infinite margin, for Ti without integral action,
and for a number that does not exist; NaN and infinity never appear.
"""

import math
from dataclasses import asdict
from typing import TypeAlias

import numpy as np

from loop.controller import PID
from loop.margins import Margins
from loop.process import Process
from loop.signals import Real
from tuning.profiles import Profile

Json: TypeAlias = "bool | int | float | str | list[Json] | dict[str, Json] | None"
Body: TypeAlias = dict[str, Json]


def number(value: float | None) -> float | None:
    """A JSON number, null for infinity and for what does not exist."""
    return None if value is None or not math.isfinite(value) else float(value)


def numbers(values: Real) -> Json:
    """An array of any shape as nested JSON lists."""
    finite = np.isfinite(values)
    if finite.all():  # nearly always, and ten times faster
        listed: Json = values.tolist()
        return listed
    held = values.astype(object)
    held[~finite] = None
    with_nulls: Json = held.tolist()
    return with_nulls


def process_body(process: Process) -> Body:
    """A process with its kind and its parameters."""
    return {"kind": type(process).__name__, **process_parameters(process)}


def process_parameters(process: Process) -> Body:
    """The parameters of a model by name."""
    return {
        name: [number(c) for c in value] if isinstance(value, tuple) else number(value)
        for name, value in asdict(process).items()
    }


def margins_body(margins: Margins) -> Body:
    """The six margins of one loop."""
    # By name: `asdict` copies deeply, and an answer holds more than fifty of them.
    return {
        "gain": number(margins.gain),
        "gain_reduction": number(margins.gain_reduction),
        "phase": number(margins.phase),
        "delay": number(margins.delay),
        "Ms": number(margins.Ms),
        "Mt": number(margins.Mt),
    }


def profile_body(profile: Profile) -> Body:
    """The limits a verdict rests on."""
    return {**asdict(profile), "gain_dB": 20 * math.log10(profile.gain)}


def settings_body(pid: PID) -> Body:
    """Controller settings in the ISA form."""
    return {
        "form": "ISA",
        "action": pid.action.value,
        "Kc": pid.Kc,
        "Ti": number(pid.Ti),
        "Td": pid.Td,
        "N": number(pid.N),
        "b": pid.b,
        "c": pid.c,
        "tauF": pid.tauF,
    }
