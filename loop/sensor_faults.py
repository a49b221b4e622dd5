"""What a bad sensor shows: frozen, biased, drifting, with spikes, clipped or too coarse.

A fault turns a true measurement into a shown one, for one loop or for a batch, on a whole signal
or scan by scan inside a simulation, where the controller acts on what it is shown.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from loop.signals import Flags, Real

# From the number of the scan and the measurements, shape () or (m,), to what is shown. [PV]
Reading: TypeAlias = Callable[[int, Real], Real]


def _check_window(start: float, end: float) -> None:
    if not 0 <= start < end:
        raise ValueError(f"a fault must start at 0 or later and end later, got {start} to {end} s")


def _within(t: Real, start: float, end: float) -> Flags:
    return np.asarray((t >= start) & (t < end))


@dataclass(frozen=True, slots=True, kw_only=True)
class Frozen:
    """Show the last value before the fault, whatever the process does.

    Attributes
    ----------
    start, end : float
        First instant of the fault and first instant after it. [s]
    """

    start: float
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_window(self.start, self.end)

    def reading(self, t: Real) -> Reading:
        """Begin to read at the instants t, shape (n,). [s]"""
        frozen = _within(t, self.start, self.end)
        held: Real | None = None

        def shown(k: int, m: Real) -> Real:
            nonlocal held
            if held is None or not frozen[k]:
                held = m
            return held

        return shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Biased:
    """Show too much or too little, and more of it with time.

    Attributes
    ----------
    size : float
        Error at the start. [PV]
    rate : float
        Growth of the error. [PV/s]
    start, end : float
        First instant of the fault and first instant after it. [s]
    """

    size: float = 0.0
    rate: float = 0.0
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_window(self.start, self.end)
        if not (math.isfinite(self.size) and math.isfinite(self.rate)):
            raise ValueError(f"size and rate must be finite, got {self.size} and {self.rate}")

    def reading(self, t: Real) -> Reading:
        """Begin to read at the instants t, shape (n,). [s]"""
        error = np.where(
            _within(t, self.start, self.end), self.size + self.rate * (t - self.start), 0.0
        )
        return lambda k, m: np.asarray(m + error[k])


@dataclass(frozen=True, slots=True, kw_only=True)
class Spiked:
    """Show single wild values, up or down alike.

    Attributes
    ----------
    size : float
        Height of a spike. [PV]
    share : float
        Part of the scans that have one. [-]
    seed : int
        Seed of their places; every loop of a batch has its own places.
    """

    size: float
    share: float
    seed: int = 1

    def __post_init__(self) -> None:
        if not 0 < self.size < math.inf:
            raise ValueError(f"size must be positive, got {self.size}")
        if not 0 <= self.share <= 1:
            raise ValueError(f"share must lie within 0 and 1, got {self.share}")

    def reading(self, t: Real) -> Reading:  # noqa: ARG002  (all faults begin alike)
        """Begin to read at the instants t, shape (n,). [s]"""
        rng = np.random.default_rng(self.seed)

        def shown(k: int, m: Real) -> Real:  # noqa: ARG001
            draw = rng.random(np.shape(m)) / (self.share or 1.0)
            spike = np.where(draw < 0.5, -self.size, self.size)
            return np.asarray(m + np.where((draw < 1) & (self.share > 0), spike, 0.0))

        return shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Clipped:
    """Show nothing beyond the range of the transmitter.

    Attributes
    ----------
    low, high : float
        Ends of the range. [PV]
    """

    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"low must be below high, got {self.low} and {self.high}")

    def reading(self, t: Real) -> Reading:  # noqa: ARG002
        """Begin to read at the instants t, shape (n,). [s]"""
        return lambda k, m: np.asarray(np.clip(m, self.low, self.high))  # noqa: ARG005


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantised:
    """Show multiples of a step.

    Attributes
    ----------
    step : float
        Distance of two values. [PV]
    """

    step: float

    def __post_init__(self) -> None:
        if not 0 < self.step < math.inf:
            raise ValueError(f"step must be positive, got {self.step}")

    def reading(self, t: Real) -> Reading:  # noqa: ARG002
        """Begin to read at the instants t, shape (n,). [s]"""
        return lambda k, m: np.asarray(np.round(m / self.step) * self.step)  # noqa: ARG005


SensorFault: TypeAlias = Frozen | Biased | Spiked | Clipped | Quantised


def shown_values(t: Real, pv: Real, faults: Sequence[SensorFault]) -> Real:
    """Show a whole signal through a bad sensor.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Instants. [s]
    pv : ndarray, shape (n,) or (n, m)
        True measurement. [PV]
    faults : sequence of SensorFault
        Faults, each on top of the one before.

    Returns
    -------
    ndarray, shape (n,) or (n, m)
        What the sensor shows. [PV]

    Raises
    ------
    ValueError
        Instants and measurements do not make pairs.
    """
    t, pv = np.asarray(t, dtype=np.float64), np.asarray(pv, dtype=np.float64)
    if t.ndim != 1 or pv.shape[:1] != t.shape:
        raise ValueError(f"t and pv must be equally long, got shapes {t.shape} and {pv.shape}")
    for fault in faults:
        reading = fault.reading(t)
        pv = np.array([reading(k, m) for k, m in enumerate(pv)]).reshape(pv.shape)
    return pv
