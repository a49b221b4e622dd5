"""Intervals by repeating the test with the model and its own residual, where they are asked for."""

from advice.body import Body, numbers
from advice.display import digits
from identification.identify import Identification
from identification.theta_interval import bootstrap_intervals
from loop.errors import FitNotTrusted

NAMES = ("K", "tau", "theta")


def bootstrap_body(model: Identification) -> Body:
    """95 % intervals of K, tau and theta by bootstrap, or why there are none.

    Parameters
    ----------
    model : Identification
        A model with its data.
    """
    try:
        intervals = bootstrap_intervals(model)
    except FitNotTrusted as fact:
        return {"intervals_95": None, "refusal": str(fact)}
    named = dict(zip(NAMES, map(numbers, intervals), strict=True))
    return {"intervals_95": named, "refusal": None}


def bootstrap_words(model: Identification) -> list[str]:
    """Say the same for people.

    Parameters
    ----------
    model : Identification
        A model with its data.
    """
    try:
        intervals = bootstrap_intervals(model)
    except FitNotTrusted as fact:
        return [str(fact)]
    units = ("", " s", " s")
    return [
        f"{name} {digits(float(low))} to {digits(float(high))}{unit} (95 %)"
        for name, unit, (low, high) in zip(NAMES, units, intervals, strict=True)
    ]
