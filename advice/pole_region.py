"""A second-order specification as a region for the poles, and poles back as a step response.

The command line, the REST service and a notebook all call this:

    from advice.pole_region import Specification, region_case
    case = region_case(Specification(overshoot=0.1, settling=5.0), poles=[-1 + 2j])
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from advice.body import Body, number, numbers
from advice.display import digits
from loop.second_order import (
    SETTLED,
    PoleRegion,
    SecondOrder,
    of_pole,
    phase_margin,
    pole_region,
)

MOST_OVERSHOOT = 0.999


@dataclass(frozen=True, slots=True, kw_only=True)
class Specification:
    """What a step response has to be; what is left out is not asked.

    Attributes
    ----------
    overshoot : float or None
        Largest overshoot over the step. [-]
    phase : float or None
        Smallest phase margin of the loop behind it. [°]
    settling, rise : float or None
        Longest time to settle within the band, and from 10 to 90 %. [s]
    band : float
        Half-width of the settling band over the step. [-]
    """

    overshoot: float | None = None
    phase: float | None = None
    settling: float | None = None
    rise: float | None = None
    band: float = SETTLED

    def __post_init__(self) -> None:
        wishes = (self.overshoot, self.phase, self.settling, self.rise)
        if all(wish is None for wish in wishes):
            raise ValueError("state an overshoot, a phase margin, a settling or a rise time")


@dataclass(frozen=True, slots=True, kw_only=True)
class PoleReading:
    """One pole, or pair, read back.

    Attributes
    ----------
    pole : complex
        The pole with an imaginary part of 0 or more. [rad/s]
    response : SecondOrder
        What it does.
    holds : bool
        Whether it lies in the region.
    """

    pole: complex
    response: SecondOrder
    holds: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RegionCase:
    """A specification with its region, and poles held to it.

    Attributes
    ----------
    wanted : Specification
        The specification.
    region : PoleRegion
        Where a dominant pole pair may lie.
    poles : tuple of PoleReading
        Poles that were asked about.
    """

    wanted: Specification
    region: PoleRegion
    poles: tuple[PoleReading, ...]


def region_case(wanted: Specification, poles: Sequence[complex] = ()) -> RegionCase:
    """Turn a specification into a region for the poles, and read poles back.

    Parameters
    ----------
    wanted : Specification
        What the step response has to be.
    poles : sequence of complex
        Stable poles to hold to it; of a pair either one, and a real one counts twice. [rad/s]

    Raises
    ------
    ValueError
        A number lies outside what a step response can do, or a pole is not stable.
    """
    allowed = MOST_OVERSHOOT if wanted.overshoot is None else wanted.overshoot
    region = pole_region(
        overshoot=allowed,
        phase=wanted.phase,
        settling=wanted.settling,
        rise=wanted.rise,
        band=wanted.band,
    )
    readings = []
    for pole in poles:
        upper = complex(pole.real, abs(pole.imag))
        response = of_pole(upper)
        holds = region.holds(response.zeta, response.wn)
        readings.append(PoleReading(pole=upper, response=response, holds=holds))
    return RegionCase(wanted=wanted, region=region, poles=tuple(readings))


def region_body(case: RegionCase) -> Body:
    """A region as the JSON document of command line and API.

    The edge of the region is a list of points: at each damping the slowest pole that will do.
    """
    zeta, wn = case.region.zeta, case.region.wn_min
    return {
        "wanted": {name: number(value) for name, value in asdict(case.wanted).items()},
        "zeta_min": case.region.zeta_min,
        "phase_margin_min": phase_margin(case.region.zeta_min),
        "edge": {
            "zeta": numbers(zeta),
            "wn": numbers(wn),
            "real": numbers(-zeta * wn),
            "imag": numbers(wn * np.sqrt(np.maximum(1 - zeta**2, 0.0))),
        },
        "poles": [
            {
                "real": reading.pole.real,
                "imag": reading.pole.imag,
                **{name: number(value) for name, value in asdict(reading.response).items()},
                "holds": reading.holds,
            }
            for reading in case.poles
        ],
        "sentences": list(region_sentences(case)),
    }


def region_sentences(case: RegionCase) -> list[str]:
    """A region in words."""
    least = case.region.zeta_min
    sentences = [
        f"Damping of {digits(least, 3)} or more: poles within {_angle(least):.3g}° of the negative "
        f"real axis, a phase margin of {digits(phase_margin(least), 3)}°."
    ]
    wn = case.region.wn_min
    if np.any(wn > 0):
        at = int(np.argmin(wn))
        sentences.append(
            f"Natural frequency of {digits(float(wn[0]), 3)} rad/s or more at that damping, of "
            f"{digits(float(wn[at]), 3)} at {digits(float(case.region.zeta[at]), 3)}, where the "
            "slowest will do."
        )
    for reading in case.poles:
        r = reading.response
        verdict = "meets the specification" if reading.holds else "does not meet it"
        imaginary = f" ± {reading.pole.imag:.4g}j" if reading.pole.imag else ", twice,"
        sentences.append(
            f"{reading.pole.real:.4g}{imaginary} rad/s {verdict}: damping "
            f"{digits(r.zeta, 3)}, {digits(r.wn, 3)} rad/s, overshoot "
            f"{digits(100 * r.overshoot, 3)} %, rise {digits(r.rise, 3)} s, settling "
            f"{digits(r.settling, 3)} s, phase margin {digits(r.phase, 3)}°."
        )
    return sentences


def _angle(zeta: float) -> float:
    """Angle from the negative real axis. [°]"""
    return math.degrees(math.acos(min(zeta, 1.0)))
