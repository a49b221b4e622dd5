"""Roots of many bracketed equations at once."""

from collections.abc import Callable

import numpy as np

from loop.signals import Real

# Accuracy of ln w: crossovers to the last digits; at an extreme, where values hardly change, less.
FINEST, EXTREME = 4e-16, 1e-10
# Halving now and then bounds the number of steps where secants creep along a bend.
HALVE_EVERY = 5


def solve_brackets(
    f: Callable[[Real], Real], left: Real, right: Real, *, resolution: float = FINEST
) -> Real:
    """Solve f(w) = 0 in many brackets at once, by Anderson and Björck's method in ln w [1]_.

    Parameters
    ----------
    f : callable
        Continuous function of an array of frequencies of shape (n,).
    left, right : ndarray, shape (n,)
        Brackets; f changes its sign within each. [rad/s]
    resolution : float
        Accuracy of ln w, relative where that is above 1. [-]

    Returns
    -------
    ndarray, shape (n,)
        Roots. [rad/s]

    References
    ----------
    .. [1] N. Anderson, Å. Björck, "A new high order method of regula falsi type for computing a
       root of an equation", BIT 13 (1973) 253-264.
    """
    a, b = np.log(left), np.log(right)
    fa, fb = f(left), f(right)
    finest = resolution * np.maximum(np.maximum(np.abs(a), np.abs(b)), 1.0)
    ends_at_a = np.abs(fa) < np.abs(fb)
    a, b = np.where(ends_at_a, b, a), np.where(ends_at_a, a, b)
    fa, fb = np.where(ends_at_a, fb, fa), np.where(ends_at_a, fa, fb)
    steps = 0
    while True:
        width = np.abs(b - a)
        unfinished = (width > 2 * finest) & (fb != 0)
        if not np.any(unfinished):
            return np.asarray(np.exp(b))
        steps += 1
        part = fa / (fa - fb) if steps % HALVE_EVERY else 0.5
        least = finest / np.maximum(width, 2 * finest)
        c = a + np.minimum(np.maximum(part, least), 1 - least) * (b - a)
        c = np.where(unfinished, c, b)
        fc = np.where(unfinished, f(np.exp(c)), fb)
        # An end that stays is made to count less, by how far the other end's value has fallen.
        weight = 1 - fc / np.where(fb != 0, fb, 1.0)
        weight = np.where(weight > 0, weight, 0.5)
        crossed = (fc > 0) != (fb > 0)
        a, fa = np.where(crossed, b, a), np.where(crossed, fb, fa * weight)
        b, fb = c, fc
