"""Process structures that a record can be fitted by, each with its exact answer to the output.

Everything a structure answers is linear in its gains once its shape (lags, damping, dead time) is
given, so that a fit moves the shape alone.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from identification.held_answers import (
    double_integral_answer,
    integral_answer,
    second_order_answer,
)
from identification.held_input import HeldInput, lag_response
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, PureDelay, TransferFunction
from loop.signals import Real

Shape: TypeAlias = tuple[float, ...]
Answer: TypeAlias = Callable[[HeldInput, Real, Shape], tuple[Real, ...]]
Parameters: TypeAlias = Callable[[Real, Shape], tuple[float, ...]]

# Coefficient of s^2 over the square of that of s: from one lag nearly alone to two equal ones, and
# on to a damping ratio of 0.05.
ONE_LAG, EQUAL_LAGS, LEAST_DAMPED = 1e-3, 0.25, 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Structure:
    """One kind of process.

    Attributes
    ----------
    name : str
        In words.
    names : tuple of str
        Parameters, the gain first and the dead time last.
    units : tuple of str
        Of the parameters.
    formula : str
        Transfer function.
    shape : tuple of str
        What is fitted beside the gains: `lag` in its logarithm, `q` (the coefficient of s^2 over
        the square of that of s), `theta`.
    swings : bool
        Whether q stands above that of equal lags.
    integrates : bool
        Whether PV drifts on a constant output, so that a slope before the test is part of the fit.
    answer : callable
        Columns whose gains are linear, from output, times and shape.
    parameters : callable
        Parameters from gains and shape.
    process : callable
        Model from the parameters.
    """

    name: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    formula: str
    shape: tuple[str, ...]
    swings: bool = False
    integrates: bool = False
    answer: Answer
    parameters: Parameters
    process: Callable[..., Process]


def _delayed(held: HeldInput, t: Real, shape: Shape) -> tuple[Real, ...]:
    (theta,) = shape
    passed = (held.instants + theta).searchsorted(t, side="right")
    return ((held.levels - held.levels[0])[passed],)


def _lag(held: HeldInput, t: Real, shape: Shape) -> tuple[Real, ...]:
    tau, theta = shape
    return (lag_response(held, t, tau, theta)[0],)


def _second_order(held: HeldInput, t: Real, shape: Shape) -> tuple[Real, ...]:
    return (second_order_answer(held, t, *shape)[0],)


def _second_order_with_lead(held: HeldInput, t: Real, shape: Shape) -> tuple[Real, ...]:
    return second_order_answer(held, t, *shape)


def _integral(held: HeldInput, t: Real, shape: Shape) -> tuple[Real, ...]:
    return (integral_answer(held, t, *shape),)


def _integral_with_lag(held: HeldInput, t: Real, shape: Shape) -> tuple[Real, ...]:
    tau, theta = shape
    return (integral_answer(held, t, theta) - tau * lag_response(held, t, tau, theta)[0],)


def _double_integral(held: HeldInput, t: Real, shape: Shape) -> tuple[Real, ...]:
    return (double_integral_answer(held, t, *shape),)


def _plain(gains: Real, shape: Shape) -> tuple[float, ...]:
    return (float(gains[0]), *shape)


def _lags(a1: float, q: float) -> tuple[float, float]:
    """Both lags, the longer first. [s]"""
    longer = a1 * (1 + math.sqrt(max(1 - 4 * q, 0.0))) / 2
    return longer, q * a1**2 / longer


def _two_lags(gains: Real, shape: Shape) -> tuple[float, ...]:
    return (float(gains[0]), *_lags(*shape[:2]), shape[2])


def _two_lags_and_lead(gains: Real, shape: Shape) -> tuple[float, ...]:
    return (float(gains[0]), *_lags(*shape[:2]), float(gains[1] / gains[0]), shape[2])


def _swinging(gains: Real, shape: Shape) -> tuple[float, ...]:
    a1, q, theta = shape
    return (float(gains[0]), a1 * math.sqrt(q), 1 / (2 * math.sqrt(q)), theta)


def _lead_process(K: float, tau1: float, tau2: float, lead: float, theta: float) -> Process:
    return TransferFunction((K * lead, K), (tau1 * tau2, tau1 + tau2, 1.0), theta)


def _swinging_process(K: float, T: float, zeta: float, theta: float) -> Process:
    return TransferFunction((K,), (T**2, 2 * zeta * T, 1.0), theta)


FIRST_ORDER = Structure(
    name="first order",
    names=("K", "tau", "theta"),
    units=("PV/OP", "s", "s"),
    formula="K e^(-theta s)/(tau s + 1)",
    shape=("lag", "theta"),
    answer=_lag,
    parameters=_plain,
    process=lambda K, tau, theta: FOPDT(K=K, tau=tau, theta=theta),
)
PURE_DELAY = Structure(
    name="gain with dead time",
    names=("K", "theta"),
    units=("PV/OP", "s"),
    formula="K e^(-theta s)",
    shape=("theta",),
    answer=_delayed,
    parameters=_plain,
    process=lambda K, theta: PureDelay(K=K, theta=theta),
)
TWO_LAGS = Structure(
    name="two lags",
    names=("K", "tau1", "tau2", "theta"),
    units=("PV/OP", "s", "s", "s"),
    formula="K e^(-theta s)/((tau1 s + 1)(tau2 s + 1))",
    shape=("lag", "q", "theta"),
    answer=_second_order,
    parameters=_two_lags,
    process=lambda K, tau1, tau2, theta: SOPDT(K=K, tau1=tau1, tau2=tau2, theta=theta),
)
LEAD = Structure(
    name="two lags and a lead",
    names=("K", "tau1", "tau2", "lead", "theta"),
    units=("PV/OP", "s", "s", "s", "s"),
    formula="K (lead s + 1) e^(-theta s)/((tau1 s + 1)(tau2 s + 1))",
    shape=("lag", "q", "theta"),
    answer=_second_order_with_lead,
    parameters=_two_lags_and_lead,
    process=_lead_process,
)
UNDERDAMPED = Structure(
    name="underdamped second order",
    names=("K", "T", "zeta", "theta"),
    units=("PV/OP", "s", "-", "s"),
    formula="K e^(-theta s)/(T^2 s^2 + 2 zeta T s + 1)",
    shape=("lag", "q", "theta"),
    swings=True,
    answer=_second_order,
    parameters=_swinging,
    process=_swinging_process,
)
INTEGRATOR = Structure(
    name="integrator",
    names=("K", "theta"),
    units=("PV/OP/s", "s"),
    formula="K e^(-theta s)/s",
    shape=("theta",),
    integrates=True,
    answer=_integral,
    parameters=_plain,
    process=lambda K, theta: IPDT(K=K, theta=theta),
)
INTEGRATOR_WITH_LAG = Structure(
    name="integrator with lag",
    names=("K", "tau", "theta"),
    units=("PV/OP/s", "s", "s"),
    formula="K e^(-theta s)/(s (tau s + 1))",
    shape=("lag", "theta"),
    integrates=True,
    answer=_integral_with_lag,
    parameters=_plain,
    process=lambda K, tau, theta: TransferFunction((K,), (tau, 1.0, 0.0), theta),
)
DOUBLE_INTEGRATOR = Structure(
    name="double integrator",
    names=("K", "theta"),
    units=("PV/OP/s^2", "s"),
    formula="K e^(-theta s)/s^2",
    shape=("theta",),
    integrates=True,
    answer=_double_integral,
    parameters=_plain,
    process=lambda K, theta: DoubleIntegrator(K=K, theta=theta),
)
STRUCTURES = (
    FIRST_ORDER,
    PURE_DELAY,
    TWO_LAGS,
    LEAD,
    UNDERDAMPED,
    INTEGRATOR,
    INTEGRATOR_WITH_LAG,
    DOUBLE_INTEGRATOR,
)


def design(
    structure: Structure, held: HeldInput, t: Real, shape: Shape, *, drift: bool, start: bool
) -> Real:
    """Columns of everything linear: the answers, rest, and a drift and a dying start if wanted.

    Parameters
    ----------
    structure : Structure
        Kind of process.
    held : HeldInput
        Output.
    t : ndarray, shape (n,)
        Times. [s]
    shape : tuple of float
        What is not linear, in the order of `structure.shape`.
    drift, start : bool
        Whether PV may have a slope of its own, and start off rest.

    Returns
    -------
    ndarray, shape (n, columns)
    """
    since = t - t[0]
    columns = [*structure.answer(held, t, shape), np.ones_like(t)]
    if drift or structure.integrates:
        columns.append(since)
    if start and structure.shape[0] == "lag" and not structure.integrates:
        # What is left of an earlier answer dies out with the slowest lag.
        lag = shape[0] if len(shape) == 2 else _lags(shape[0], min(shape[1], EQUAL_LAGS))[0]
        columns.append(np.exp(-since / lag))
    return np.stack(columns, axis=1)
