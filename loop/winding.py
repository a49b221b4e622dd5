"""How often a function turns around the origin along a path: the principle of the argument."""

import math
from collections.abc import Callable

import numpy as np

from loop.signals import Complex

# Steps of the phase above this are halved; one of a whole turn cannot hide in an eighth of it.
LARGEST_STEP = math.pi / 4
MOST_HALVINGS = 40
MOST_POINTS = 400_000


def turning(f: Callable[[Complex], Complex], path: Complex) -> float:
    """Follow the phase of f along a path, halving steps until the phase cannot slip. [rad]

    Parameters
    ----------
    f : callable
        Function of complex points of shape (n,). Only its direction counts.
    path : ndarray of complex, shape (n,)
        Corners of the path, dense enough that f does not wind between two of them unseen.

    Returns
    -------
    float
        Total change of the phase of f from the first corner to the last. [rad]

    Raises
    ------
    ValueError
        The function passes through zero on the path, so that its phase there is undefined.
    """
    points, values = path, f(path)
    for _ in range(MOST_HALVINGS):
        steps = np.angle(values[1:] / values[:-1])
        wide = np.flatnonzero(~(np.abs(steps) <= LARGEST_STEP))
        if not wide.size:
            return float(np.sum(steps))
        if points.size + wide.size > MOST_POINTS:
            break
        middle = 0.5 * (points[wide] + points[wide + 1])
        points = np.insert(points, wide + 1, middle)
        values = np.insert(values, wide + 1, f(middle))
    raise ValueError("the function is zero, or all but zero, on the path")
