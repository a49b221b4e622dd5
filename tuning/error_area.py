"""Area under the error of many loops after a step, from the exact frequency response.

I(t), the running integral of the error, is found on a time grid by the Fourier series of
e^(-sigma t) I(t), whose coefficients are the Laplace transform at sigma + j w: dead time needs no
approximation. IAE is the total variation of I, and IE, its end, is known exactly.
"""

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from loop.process import Process
from loop.signals import Complex, Real

Entry: TypeAlias = Literal["input", "output"]

# Half of a period of the series is used. Repeats are e^-DAMPING of what is left of I after a
# period, when an exponential rise to its known end has been taken off.
DAMPING, RISE = 4.0, 20.0
POINTS = 2048


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shapes:
    """PID controllers with gain 1 as arrays, (1 + 1/(Ti s) + Td s/(1 + Td s/N))/(tauF s + 1).

    Attributes
    ----------
    Ti, Td : ndarray, shape (m,)
        Integral and derivative time. [s]
    N : float
        Derivative filter ratio. [-]
    tauF : float
        Lag in series. [s]
    """

    Ti: Real
    Td: Real
    N: float
    tauF: float = 0.0

    def response(self, s: Complex) -> Complex:
        """Evaluate at points of shape (m, k) or (1, k)."""
        rate, Td = 1 / self.Ti[:, None], self.Td[:, None]
        return np.asarray((1 + rate / s + Td * s / (1 + Td / self.N * s)) / (self.tauF * s + 1))


def process_response(process: Process, s: Complex, hold: float) -> Complex:
    """Evaluate the process with its dead time and half a scan time. [PV/OP]"""
    rational = np.polyval(process.numerator, s) / np.polyval(process.denominator, s)
    return np.asarray(rational * np.exp(-(process.theta + hold) * s))


def error_areas(
    process: Process,
    shapes: Shapes,
    Kc: Real,
    horizon: Real,
    *,
    entry: Entry,
    hold: float = 0.0,
    points: int = POINTS,
) -> Real:
    """IAE after a unit step at the process input or output, for many stable loops.

    Parameters
    ----------
    process : Process
        Process model.
    shapes : Shapes
        Controllers of gain 1, m of them, with integral action.
    Kc : ndarray, shape (m,)
        Their gains, negative for the direct action. [OP/PV]
    horizon : ndarray, shape (m,)
        Time after which the error no longer changes its sign. [s]
    entry : "input" or "output"
        Where the step enters.
    hold : float
        Half the scan time. [s]
    points : int
        Points of the series, twice those in the horizon.

    Returns
    -------
    ndarray, shape (m,)
        Integrals of |e|. [PV s/OP] at the input, [s] at the output
    """
    period = 2 * horizon
    w = 2 * math.pi / period[:, None] * np.arange(points // 2 + 1)
    s = DAMPING / period[:, None] + 1j * w
    G, C = process_response(process, s, hold), shapes.response(s) * Kc[:, None]
    way = G if entry == "input" else 1.0
    end = error_integral(process, shapes, Kc, entry=entry)[:, None]
    rate = RISE / period[:, None]
    transform = way / (1 + G * C) / s**2 - end * rate / (s * (s + rate))
    # Lanczos factors: an average over a step, which takes the ripple of the cut series off.
    transform *= np.sinc(np.linspace(0.0, 1.0, transform.shape[1]))
    step = period / points
    t = step[:, None] * np.arange(points // 2)
    series = np.fft.irfft(transform, n=points, axis=1)[:, : points // 2]
    running = series * np.exp(DAMPING / period[:, None] * t) / step[:, None]
    running -= end * np.expm1(-rate * t)
    running[:, 0] = 0.0
    moves = np.abs(np.diff(running, axis=1)).sum(axis=1)
    return np.asarray(moves + np.abs(end[:, 0] - running[:, -1]))


def error_integral(process: Process, shapes: Shapes, Kc: Real, *, entry: Entry) -> Real:
    """IE: at the input Ti/Kc exactly, at the output that over the steady-state gain.

    Around an integrating process a controller without integral action leaves no offset after a
    step at the output: the area is 1 over the gain of the loop, L s for s -> 0.

    Parameters
    ----------
    process, shapes, Kc, entry
        As in `error_areas`.
    """
    at_input = shapes.Ti / Kc
    if entry == "input":
        return np.asarray(at_input)
    if np.isinf(at_input).all():
        return np.asarray(process.denominator[-2] / process.numerator[-1] / Kc)
    return np.asarray(at_input * process.denominator[-1] / process.numerator[-1])
