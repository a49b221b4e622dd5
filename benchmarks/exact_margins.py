"""Margins of a stable loop the slow, sure way: a dense grid, a root search at each crossing.

Shares no code with `loop`: it is what both sides of the margin benchmark are measured against.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from loop.signals import Complex, Real


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """A gain with up to two lags or integrators and a dead time, under a PID.

    Attributes
    ----------
    K, tau1, tau2, theta : float
        Gain [PV/OP], lags [s] and dead time [s].
    integrators : int
        Number of poles at s = 0. [-]
    Kc, Ti, Td, N : float
        Controller in the ISA form. [OP/PV, s, s, -]
    """

    K: float
    tau1: float
    theta: float
    Kc: float
    Ti: float
    Td: float = 0.0
    N: float = 10.0
    tau2: float = 0.0
    integrators: int = 0


def loop_gain(plant: Plant, w: Real) -> Complex:
    """Evaluate L(jw) without its dead time, factor by factor so that nothing cancels."""
    s = 1j * w
    G = plant.K / (s**plant.integrators * (plant.tau1 * s + 1) * (plant.tau2 * s + 1))
    C = plant.Kc * (1 + 1 / (plant.Ti * s) + plant.Td * s / (plant.Td / plant.N * s + 1))
    return np.asarray(G * C)


def _roots(f: Callable[[float], float], w: Real, values: Real) -> list[float]:
    crossed = np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:]))
    return [float(brentq(f, w[i], w[i + 1], xtol=1e-18, rtol=1e-15)) for i in crossed]


def exact_margins(plant: Plant, *, points: int = 20_000) -> tuple[float, ...]:
    """Find the margins of a stable loop with integral action.

    Parameters
    ----------
    plant : Plant
        Loop with a dead time above nothing.
    points : int
        Points of the grid between 1e-4 and 1e3 over the dead time plus Ti. [-]

    Returns
    -------
    tuple of float
        Smallest 1/|L(w180)| above 1 [-], phase margin [°], delay margin [s], Ms [-], Mt [-].
    """
    w = np.geomspace(1e-4, 1e3, points) / (plant.theta + plant.Ti)

    def at(x: float) -> complex:
        return complex(loop_gain(plant, np.array(x)) * np.exp(-1j * x * plant.theta))

    def log_size(x: float) -> float:
        return math.log(abs(at(x)))

    L = loop_gain(plant, w) * np.exp(-1j * w * plant.theta)
    lags = np.unwrap(np.angle(loop_gain(plant, w))) - w * plant.theta
    crossings = _roots(log_size, w, np.log(np.abs(L)))
    phases = [(math.pi + np.angle(at(x))) % math.tau for x in crossings]
    gains = []
    for turn in range(1, 2 * int(-lags[-1] / math.tau) + 2, 2):
        gains += _half_turns(plant, w, lags, turn)
    return (
        min((g for g in gains if g > 1), default=math.inf),
        math.degrees(min(phases)),
        min(p / x for p, x in zip(phases, crossings, strict=True)),
        _peak(lambda x: 1 / abs(1 + at(x)), w, 1 / np.abs(1 + L)),
        # integral action: T(0) = 1, which no point of the grid reaches
        max(1.0, _peak(lambda x: abs(at(x) / (1 + at(x))), w, np.abs(L / (1 + L)))),
    )


def _half_turns(plant: Plant, w: Real, lags: Real, turn: int) -> list[float]:
    """Find 1/|L| wherever the unwrapped phase passes -180° times an odd number."""

    def above(x: float) -> float:
        i = min(max(int(np.searchsorted(w, x)) - 1, 0), w.size - 2)
        estimate = np.interp(x, w[i : i + 2], lags[i : i + 2]) + turn * math.pi
        exact = np.angle(complex(loop_gain(plant, np.array(x)))) - x * plant.theta
        return float(estimate + math.remainder(exact + turn * math.pi - estimate, math.tau))

    sizes = _roots(above, w, lags + turn * math.pi)
    return [1 / abs(complex(loop_gain(plant, np.array(x)))) for x in sizes]


def _peak(f: Callable[[float], float], w: Real, values: Real) -> float:
    i = int(np.argmax(values))
    if i in (0, w.size - 1):
        return float(values[i])
    found = minimize_scalar(
        lambda x: -f(x), bounds=(w[i - 1], w[i + 1]), method="bounded", options={"xatol": 1e-14}
    )
    return max(float(values[i]), float(-found.fun))
