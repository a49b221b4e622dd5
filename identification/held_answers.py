"""Exact answers of second-order and integrating processes to a held output.

Between two moves of the output the answer is a sum of two exponentials, or a polynomial in the
time since the last move. As for the first-order lag nothing is discretised, whatever the sampling
and whatever fraction of a sample the dead time is.
"""

import cmath
import math

import numpy as np

from identification.held_input import LONGEST, HeldInput, Indices
from loop.signals import Complex, Real

# Two equal lags are the limit of two that differ: so little apart, the answers differ by less than
# a ten-millionth and the two exponentials still keep ten digits.
NOT_EQUAL = 1e-8


def second_order_answer(
    held: HeldInput, t: Real, a1: float, q: float, theta: float
) -> tuple[Real, Real]:
    """Answer a held output with e^(-theta s)/(q a1^2 s^2 + a1 s + 1), and with s times that.

    q = 0 is one lag of a1, q below 1/4 two real lags whose sum is a1, 1/4 two equal ones, and
    above that the answer swings with the damping ratio 1/(2 sqrt(q)).

    Parameters
    ----------
    held : HeldInput
        Output, at rest at its first level before its first move.
    t : ndarray, shape (n,)
        Times, increasing. [s]
    a1 : float
        Coefficient of s, positive: the sum of the lags. [s]
    q : float
        Coefficient of s^2 over a1^2, positive. [-]
    theta : float
        Dead time. [s]

    Returns
    -------
    y, slope : ndarray, shape (n,)
        Deviation from the level before the first move [OP], and its time derivative [OP/s].
    """
    if abs(q - 0.25) < NOT_EQUAL:
        q = 0.25 - NOT_EQUAL
    # Lags that are real are worked in real numbers, at a third of the time.
    root = math.sqrt(1 - 4 * q) if q < 0.25 else cmath.sqrt(1 - 4 * q)
    # The shorter lag by the product of both, which a small q leaves exact.
    longer = a1 * (1 + root) / 2
    shorter = q * a1**2 / longer
    behind, age = _since_arrival(held, t, theta)
    y = (held.levels - held.levels[0])[behind]
    slope = np.zeros(t.size)
    pair = 1 if q > 0.25 else 2
    for tau, other in ((longer, shorter), (shorter, longer))[:pair]:
        # A swinging answer's two terms are conjugates: twice the real part of one.
        share = (3 - pair) * tau / (tau - other)
        left = share * _distances(held, tau)[behind] * _decay(age, tau)
        y += left.real
        slope -= (left / tau).real
    return y, slope


def integral_answer(held: HeldInput, t: Real, theta: float) -> Real:
    """Answer a held output with e^(-theta s)/s: its integral since the first move. [OP s]

    Parameters
    ----------
    held : HeldInput
        Output; the integral counts from its first level.
    t : ndarray, shape (n,)
        Times, increasing. [s]
    theta : float
        Dead time. [s]
    """
    behind, age = _since_arrival(held, t, theta)
    about = held.levels - held.levels[0]
    gaps = np.diff(held.instants, prepend=held.instants[:1])
    reached = np.append(0.0, np.cumsum(about[:-1] * gaps))
    return np.asarray(reached[behind] + about[behind] * age)


def double_integral_answer(held: HeldInput, t: Real, theta: float) -> Real:
    """Answer a held output with e^(-theta s)/s^2: its integral integrated again. [OP s^2]

    Parameters
    ----------
    held : HeldInput
        Output; the integrals count from its first level.
    t : ndarray, shape (n,)
        Times, increasing. [s]
    theta : float
        Dead time. [s]
    """
    behind, age = _since_arrival(held, t, theta)
    about = held.levels - held.levels[0]
    gaps = np.diff(held.instants, prepend=held.instants[:1])
    once = np.append(0.0, np.cumsum(about[:-1] * gaps))
    twice = np.append(0.0, np.cumsum(once[:-1] * gaps + about[:-1] * gaps**2 / 2))
    return np.asarray(twice[behind] + once[behind] * age + about[behind] * age**2 / 2)


def _since_arrival(held: HeldInput, t: Real, theta: float) -> tuple[Indices, Real]:
    """Moves that have arrived at each sample, and the time since the last did."""
    shifted = t - theta
    if not held.moves:
        return np.zeros(t.size, dtype=np.intp), np.zeros(t.size)
    behind = np.searchsorted(held.instants, shifted, side="right")
    return behind, np.where(behind > 0, shifted - held.instants[np.maximum(behind - 1, 0)], 0.0)


def _distances(held: HeldInput, tau: complex) -> Real | Complex:
    """Distance of a lag, perhaps a complex one, from its aim right after each move. [OP]"""
    instants, levels = held.instants.tolist(), held.levels.tolist()
    z: list[complex] = [0.0]
    for j, instant in enumerate(instants):
        rate = (instant - instants[j - 1]) / tau if j else 0.0
        decay = 0.0 if rate.real > LONGEST else np.exp(-rate)
        z.append(z[-1] * decay - (levels[j + 1] - levels[j]))
    return np.array(z)


def _decay(age: Real, tau: complex) -> Real | Complex:
    """e^(-age/tau), without exponents whose exponential is nothing."""
    if not isinstance(tau, complex):
        return np.asarray(np.exp(-np.minimum(age / tau, LONGEST)))
    exponent = age / tau
    return np.asarray(np.exp(-(np.minimum(exponent.real, LONGEST) + 1j * exponent.imag)))
