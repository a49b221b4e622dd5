"""The second-order loop wn^2/(s^2 + 2 zeta wn s + wn^2): from specifications to poles and back.

Rise and settling times are computed on the exact step response: 4/(zeta wn) errs by up to 30 %.
"""

import cmath
import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from loop.signals import Real

SMALLEST_DAMPING, LARGEST_DAMPING = 0.01, 20.0
SETTLED = 0.02


def overshoot(zeta: float) -> float:
    """Overshoot of the step response over its final value, exp(-pi zeta/sqrt(1 - zeta^2)). [-]"""
    _check(zeta)
    return math.exp(-math.pi * zeta / math.sqrt(1 - zeta * zeta)) if zeta < 1 else 0.0


def damping_for_overshoot(ratio: float) -> float:
    """Smallest damping whose overshoot does not pass a ratio. [-]

    zeta = -ln(ratio)/sqrt(pi^2 + ln(ratio)^2)

    Parameters
    ----------
    ratio : float
        Overshoot over the final value, within 0 and 1; 0 asks for none, zeta = 1. [-]
    """
    if not 0 <= ratio < 1:
        raise ValueError(f"the overshoot must lie within 0 and 1 of the step, got {ratio}")
    if ratio == 0:
        return 1.0
    log = math.log(ratio)
    return -log / math.hypot(math.pi, log)


def phase_margin(zeta: float) -> float:
    """Phase margin of wn^2/(s (s + 2 zeta wn)), whose closed loop this is. [°]

    atan(2 zeta / sqrt(sqrt(1 + 4 zeta^4) - 2 zeta^2))
    """
    return math.degrees(math.atan(2 * zeta / crossover(zeta)))


def damping_for_phase_margin(phase: float) -> float:
    """Damping at which the phase margin is `phase`. [-]

    Parameters
    ----------
    phase : float
        Phase margin, within 1.2 and 89.9. [°]
    """
    low, high = phase_margin(SMALLEST_DAMPING), phase_margin(LARGEST_DAMPING)
    if not low < phase < high:
        raise ValueError(
            f"the phase margin must lie within {low:.3g}° and {high:.4g}°, got {phase}"
        )
    return float(brentq(lambda zeta: phase_margin(zeta) - phase, SMALLEST_DAMPING, LARGEST_DAMPING))


def crossover(zeta: float) -> float:
    """Gain crossover over natural frequency, sqrt(sqrt(1 + 4 zeta^4) - 2 zeta^2). [-]"""
    _check(zeta)
    # The difference, written as a quotient, keeps its digits for large damping.
    return math.sqrt(1 / (math.sqrt(1 + 4 * zeta**4) + 2 * zeta * zeta))


def bandwidth(zeta: float) -> float:
    """Frequency at which the gain has fallen to 1/sqrt(2), over natural frequency. [-]

    sqrt(1 - 2 zeta^2 + sqrt((1 - 2 zeta^2)^2 + 1))
    """
    _check(zeta)
    a = 1 - 2 * zeta * zeta
    root = math.hypot(a, 1.0)
    return math.sqrt(a + root) if a > 0 else math.sqrt(1 / (root - a))


def step(zeta: float, t: Real) -> Real:
    """Step response over the final value, with time in units of 1/wn. [-]

    Parameters
    ----------
    zeta : float
        Damping ratio. [-]
    t : ndarray
        Times wn t, from 0 on. [-]
    """
    _check(zeta)
    t = np.asarray(t, dtype=float)
    if zeta < 1:
        wd = math.sqrt(1 - zeta * zeta)
        return np.asarray(1 - np.exp(-zeta * t) * (np.cos(wd * t) + zeta / wd * np.sin(wd * t)))
    if zeta == 1:
        return np.asarray(1 - np.exp(-t) * (1 + t))
    spread = math.sqrt(zeta * zeta - 1)
    fast = zeta + spread
    slow = 1 / fast
    return np.asarray(1 - (fast * np.exp(-slow * t) - slow * np.exp(-fast * t)) / (2 * spread))


def rise_time(zeta: float) -> float:
    """Time from 10 % to 90 % of the step, times wn. [-]"""
    return _first(zeta, 0.9) - _first(zeta, 0.1)


def settling_time(zeta: float, band: float = SETTLED) -> float:
    """Time after which the response stays within a band around its final value, times wn. [-]

    Parameters
    ----------
    zeta : float
        Damping ratio. [-]
    band : float
        Half-width of the band over the final value. [-]
    """
    if not 0 < band < 1:
        raise ValueError(f"the band must lie within 0 and 1 of the step, got {band}")
    peaks = 0
    if 0 < zeta < 1:
        # Peak k misses the final value by exp(-k pi zeta/wd): the last outside the band counts.
        decay = math.pi * zeta / math.sqrt(1 - zeta * zeta)
        peaks = math.ceil(-math.log(band) / decay) - 1
    if peaks <= 0:
        return _first(zeta, 1 - band)
    half = math.pi / math.sqrt(1 - zeta * zeta)
    target = 1 + (band if peaks % 2 else -band)
    return _solve(zeta, target, peaks * half, (peaks + 1) * half)


def _first(zeta: float, level: float) -> float:
    """First time at which the response reaches a level below 1."""
    _check(zeta)
    high = math.pi / math.sqrt(1 - zeta * zeta) if zeta < 1 else 1.0
    while zeta >= 1 and step(zeta, np.array(high)) < level:
        high *= 2
    return _solve(zeta, level, 0.0, high)


def _solve(zeta: float, level: float, low: float, high: float) -> float:
    return float(brentq(lambda t: float(step(zeta, np.array(t))) - level, low, high, xtol=1e-13))


def _check(zeta: float) -> None:
    if not SMALLEST_DAMPING <= zeta <= LARGEST_DAMPING:
        raise ValueError(
            f"the damping ratio must lie within {SMALLEST_DAMPING} and {LARGEST_DAMPING:g}, "
            f"got {zeta}"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoleRegion:
    """Where a dominant pole pair may lie to meet a specification.

    Attributes
    ----------
    zeta_min : float
        Least damping ratio. [-]
    zeta : ndarray, shape (n,)
        Damping ratios, from `zeta_min` up. [-]
    wn_min : ndarray, shape (n,)
        Least natural frequency at each; 0 where nothing asks for speed. [rad/s]
    """

    zeta_min: float
    zeta: Real
    wn_min: Real

    def holds(self, zeta: float, wn: float) -> bool:
        """Tell whether a pole pair lies within, between two listed dampings by interpolation."""
        inside = self.zeta_min <= zeta <= self.zeta[-1]
        return bool(inside and wn >= np.interp(zeta, self.zeta, self.wn_min))


def pole_region(
    *,
    overshoot: float = 0.3,
    phase: float | None = None,
    settling: float | None = None,
    rise: float | None = None,
    band: float = SETTLED,
) -> PoleRegion:
    """Turn a specification of the step response into a region for the pole pair.

    Parameters
    ----------
    overshoot : float
        Largest overshoot over the step. [-]
    phase : float, optional
        Smallest phase margin of the loop behind it. [°]
    settling : float, optional
        Longest time to settle. [s]
    rise : float, optional
        Longest 10-90 % rise time. [s]
    band : float
        Half-width of the settling band over the step. [-]

    Raises
    ------
    ValueError
        A number lies outside what a step response can do.
    """
    least = max(damping_for_overshoot(overshoot), SMALLEST_DAMPING)
    if phase is not None:
        least = max(least, damping_for_phase_margin(phase))
    for name, value in (("settling", settling), ("rise", rise)):
        if value is not None and not (value > 0 and math.isfinite(value)):
            raise ValueError(f"the {name} time must be positive, got {value}")
    zeta = np.unique(
        np.concatenate([np.linspace(least, max(1.5, 1.5 * least), 107), [max(least, 1.0)]])
    )
    wn = np.zeros(zeta.size)
    for i, z in enumerate(zeta):
        if settling is not None:
            wn[i] = settling_time(float(z), band) / settling
        if rise is not None:
            wn[i] = max(wn[i], rise_time(float(z)) / rise)
    return PoleRegion(zeta_min=least, zeta=zeta, wn_min=wn)


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondOrder:
    """What a pole pair does.

    Attributes
    ----------
    zeta : float
        Damping ratio. [-]
    wn : float
        Natural frequency. [rad/s]
    overshoot : float
        Overshoot over the step. [-]
    rise, settling : float
        10-90 % rise time and 2 % settling time. [s]
    phase : float
        Phase margin of the loop behind it. [°]
    """

    zeta: float
    wn: float
    overshoot: float
    rise: float
    settling: float
    phase: float


def second_order(zeta: float, wn: float) -> SecondOrder:
    """Read a pole pair back as overshoot, rise, settling and phase margin.

    Parameters
    ----------
    zeta : float
        Damping ratio. [-]
    wn : float
        Natural frequency. [rad/s]
    """
    if not (wn > 0 and math.isfinite(wn)):
        raise ValueError(f"the natural frequency must be positive, got {wn}")
    return SecondOrder(
        zeta=zeta,
        wn=wn,
        overshoot=overshoot(zeta),
        rise=rise_time(zeta) / wn,
        settling=settling_time(zeta) / wn,
        phase=phase_margin(zeta),
    )


def of_pole(pole: complex) -> SecondOrder:
    """Read one of a stable pair of complex poles back as a step response.

    Parameters
    ----------
    pole : complex
        Pole with a negative real part. [rad/s]
    """
    wn = abs(pole)
    if not pole.real < 0 or not cmath.isfinite(pole):
        raise ValueError(f"a stable pole is needed, got {pole}")
    return second_order(-pole.real / wn, wn)
