"""Margins of a loop straight from a measured frequency response, without a model.

Between two measured points the logarithm of |L| and the phase are taken as straight lines over the
logarithm of the frequency; beyond the measured frequencies nothing is said. Whether the loop is
stable cannot be seen from points over a part of the axis: the margins are those of a stable one.
"""

from dataclasses import dataclass

import numpy as np

from identification.frequency_response import FrequencyResponse
from loop.controller import PID, controller_response
from loop.signals import Complex, Real

CONFIDENT = 1.96
# Points that are known worse than this part of themselves make no crossing.
KNOWN = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredMargins:
    """Margins that the measured points show, each with the ends of its 95 % interval.

    Attributes
    ----------
    gain : tuple of float or None
        Gain margin, its lowest and its highest; None where the phase does not reach -180° within
        the measured frequencies. [-]
    phase : tuple of float or None
        Phase margin likewise; None where |L| does not pass 1. [deg]
    Ms : tuple of float or None
        Largest |S| at a measured point likewise; None where the points do not reach over both
        crossovers. [-]
    w180, wc : float or None
        Phase and gain crossover. [rad/s]
    remarks : tuple of str
        What the points do not show.
    """

    gain: tuple[float, float, float] | None
    phase: tuple[float, float, float] | None
    Ms: tuple[float, float, float] | None
    w180: float | None
    wc: float | None
    remarks: tuple[str, ...]


def measured_margins(response: FrequencyResponse, controller: PID) -> MeasuredMargins:
    """Read the margins of a controller on a measured process.

    Parameters
    ----------
    response : FrequencyResponse
        Measured points of the process.
    controller : PID
        Controller settings.
    """
    known = response.sd < KNOWN * np.abs(response.G)
    w = response.w[known]
    if w.size < 2:
        return MeasuredMargins(
            gain=None, phase=None, Ms=None, w180=None, wc=None,
            remarks=("fewer than two points stand out of the noise",),
        )  # fmt: skip
    L: Complex = response.G[known] * controller_response(controller, 1j * w)
    # Of the size and of the angle alike, as a part of |L| and in radians.
    part = response.sd[known] / np.abs(response.G[known]) / 2**0.5
    log_w, log_L = np.log(w), np.log(np.abs(L))
    angle = np.unwrap(np.angle(L))
    # The first point is put where a loop is below its crossovers: above -270° and below 90°.
    angle -= 2 * np.pi * np.ceil((angle[0] - np.pi / 2) / (2 * np.pi))
    wc = _crossing(log_w, log_L)
    w180 = _crossing(log_w, angle + np.pi)
    remarks, gain, phase, Ms = [], None, None, None
    if w180 is None:
        remarks.append("the phase does not reach -180° within the measured frequencies")
    else:
        at = float(np.exp(-np.interp(np.log(w180), log_w, log_L)))
        width = CONFIDENT * float(np.interp(np.log(w180), log_w, part))
        gain = (at, at * np.exp(-width).item(), at * np.exp(width).item())
    if wc is None:
        remarks.append("the gain of the loop does not pass 1 within the measured frequencies")
    else:
        middle = 180 + float(np.degrees(np.interp(np.log(wc), log_w, angle)))
        width = float(np.degrees(CONFIDENT * np.interp(np.log(wc), log_w, part)))
        phase = (middle, middle - width, middle + width)
    if gain is not None and phase is not None:
        Ms = _largest(L, part)
    return MeasuredMargins(gain=gain, phase=phase, Ms=Ms, w180=w180, wc=wc, remarks=tuple(remarks))


def _crossing(log_w: Real, values: Real) -> float | None:
    """First frequency at which values pass from above 0 to below. [rad/s]"""
    down = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))
    if not down.size:
        return None
    i = int(down[0])
    part = values[i] / (values[i] - values[i + 1])
    return float(np.exp(log_w[i] + part * (log_w[i + 1] - log_w[i])))


def _largest(L: Complex, part: Real) -> tuple[float, float, float]:
    """Largest |1/(1 + L)| of all points, with the interval of that point."""
    distance = np.abs(1 + L)
    at = int(np.argmin(distance))
    off = CONFIDENT * float(part[at] * np.abs(L[at]))
    near, far = max(float(distance[at]) - off, 1e-9), float(distance[at]) + off
    return 1 / float(distance[at]), 1 / far, 1 / near
