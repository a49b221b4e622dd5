"""Disturbances that wander, jump and swing, for simulated plants."""

import math

import numpy as np
from scipy.signal import lfilter

from loop.signals import Real


def _sample_time(t: Real) -> float:
    if t.ndim != 1 or t.size < 2 or not t[1] > t[0]:
        raise ValueError("t must be at least two evenly spaced instants")
    return float(t[1] - t[0])


def _check_positive(**values: float) -> None:
    for name, value in values.items():
        if not 0 < value < math.inf:
            raise ValueError(f"{name} must be positive, got {value}")


def sudden_moves(t: Real, *, every: float, size: float, rng: np.random.Generator) -> Real:
    """Give a level that jumps at random instants; it starts at 0.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Evenly spaced instants. [s]
    every : float
        Mean time between two jumps. [s]
    size : float
        Levels lie evenly between -size and size.
    rng : numpy.random.Generator
        Source of randomness.
    """
    _check_positive(every=every)
    jumps = rng.random(t.size) < _sample_time(t) / every
    levels = np.concatenate([[0.0], rng.uniform(-size, size, np.count_nonzero(jumps))])
    return np.asarray(levels[np.cumsum(jumps)])


def coloured_noise(
    t: Real, *, memory: float, size: float, rng: np.random.Generator, settled: bool = False
) -> Real:
    """Give white noise behind a first-order lag: its autocorrelation is e^(-|lag|/memory).

    Parameters
    ----------
    t : ndarray, shape (n,)
        Evenly spaced instants. [s]
    memory : float
        Time constant. [s]
    size : float
        Standard deviation once settled.
    rng : numpy.random.Generator
        Source of randomness.
    settled : bool
        Start anywhere in its distribution, not at 0.
    """
    _check_positive(memory=memory)
    keep = math.exp(-_sample_time(t) / memory)
    pushes = rng.normal(0.0, size * math.sqrt(1 - keep**2), t.size)
    first = float(rng.normal(0.0, size)) if settled else 0.0
    steps = np.concatenate([[first], pushes[:-1]])
    return np.asarray(lfilter([1.0], [1.0, -keep], steps))


def random_walk(t: Real, *, spread: float, rng: np.random.Generator) -> Real:
    """Give a walk that knows no rest: after T seconds its standard deviation is spread sqrt(T).

    Parameters
    ----------
    t : ndarray, shape (n,)
        Evenly spaced instants; the walk starts at 0. [s]
    spread : float
        Standard deviation after one second.
    rng : numpy.random.Generator
        Source of randomness.
    """
    steps = rng.normal(0.0, spread * math.sqrt(_sample_time(t)), t.size - 1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def swing(
    t: Real,
    *,
    period: float,
    amplitude: float,
    start: float = -math.inf,
    end: float = math.inf,
    phase: float = 0.0,
) -> Real:
    """Give a sine that lasts from one instant to another, 0 elsewhere.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Instants. [s]
    period : float
        Period. [s]
    amplitude : float
        Amplitude.
    start, end : float
        First instant of the swing and first instant after it. [s]
    phase : float
        Phase at t = 0. [rad]
    """
    _check_positive(period=period)
    wave = amplitude * np.sin(2 * np.pi * t / period + phase)
    return np.where((t >= start) & (t < end), wave, 0.0)
