"""Random disturbances of many loops at once, for simulated windows: arrays of shape (n, m)."""

import numpy as np
from scipy.signal import lfilter

from loop.signals import Real


def log_uniform(rng: np.random.Generator, low: float, high: float, m: int) -> Real:
    """Draw evenly over the logarithm."""
    return np.exp(rng.uniform(np.log(low), np.log(high), m))


def for_some(rng: np.random.Generator, share: float, values: Real) -> Real:
    """Keep a value for a share of the loops, 0 for the others."""
    return np.where(rng.random(values.size) < share, values, 0.0)


def wandering(n: int, dt: float, size: Real, memory: Real, rng: np.random.Generator) -> Real:
    """First-order coloured noise of given sd and time constant, shape (n, m)."""
    keep = np.exp(-dt / memory)
    out = np.empty((n, size.size))
    for j, (s, k) in enumerate(zip(size, keep, strict=True)):
        pushes = rng.normal(0.0, s * np.sqrt(1 - k * k), n)
        pushes[0] = rng.normal(0.0, s)
        out[:, j] = lfilter([1.0], [1.0, -k], pushes)
    return out


def jumps(n: int, size: Real, most: int, rng: np.random.Generator) -> Real:
    """One to `most` jumps at random instants; none where the size is 0."""
    out = np.zeros((n, size.size))
    for j in np.flatnonzero(size):
        for _ in range(rng.integers(1, most + 1)):
            out[rng.integers(0, n) :, j] += size[j] * rng.normal()
    return out


def ramps(n: int, size: Real, rng: np.random.Generator) -> Real:
    """Straight stretches between a few random levels."""
    out = np.zeros((n, size.size))
    for j in np.flatnonzero(size):
        knots = np.r_[0, np.sort(rng.uniform(0, n, rng.integers(1, 5))), n]
        out[:, j] = np.interp(np.arange(n), knots, size[j] * rng.normal(size=knots.size))
    return out


def waves(n: int, dt: float, size: Real, rng: np.random.Generator) -> Real:
    """Sines, triangles and squares behind a lag, of one minute to an hour."""
    t = dt * np.arange(n)
    out = np.zeros((n, size.size))
    for j in np.flatnonzero(size):
        period = float(log_uniform(rng, max(60.0, 16 * dt), max(n * dt / 4, 120.0), 1)[0])
        wave = np.sin(2 * np.pi * (t / period + rng.random()))
        shape = rng.random()
        if shape > 0.5:
            wave = np.sign(wave) if shape > 0.75 else 2 / np.pi * np.arcsin(wave)
            keep = np.exp(-dt / (period * rng.uniform(0.02, 0.3)))
            wave = lfilter([1 - keep], [1.0, -keep], wave)
        out[:, j] = size[j] * wave
    return out
