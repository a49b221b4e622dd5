"""SIMC settings for first-order, second-order and integrating processes with dead time.

Source: S. Skogestad, "Simple analytic rules for model reduction and PID controller tuning,"
J. Process Control, vol. 13, no. 4, pp. 291-309, 2003. doi:10.1016/S0959-1524(02)00062-8. The
original was not read; the formulas are as quoted by three public sources, and the margins they are
known for come out of them (first order GM 3.142, PM 61.35°, Ms 1.590).

The PID columns are published in the SERIES form, and are converted here with their derivative
filter, exactly. The filter that will run is part of the settings: 0.05 times the shorter of the
series Ti and Td gives an ISA N of 9 to 19, within the practice of 8 to 20. A double integrator
does not bear it (Ms 2.99 against 1.96 without filter), so there it is 0.01 Td', N 49, Ms 2.115;
with 0.1 Td' Ms would be 5.3.

Range: tau_c >= theta is recommended; nothing faster.
"""

import math
from types import MappingProxyType

from loop.controller import PID, Action
from loop.errors import RuleNotApplicable
from loop.process import (
    FOPDT,
    IPDT,
    SOPDT,
    DoubleIntegrator,
    Process,
    PureDelay,
    TransferFunction,
)
from tuning.rule import Rule, accept, chosen_tau_c, refuse_type
from tuning.series_form import series_to_isa

TITLE = "SIMC"
FILTER, DOUBLE_INTEGRATOR_FILTER = 0.05, 0.01
# Pure integral control in the ISA form: a PI whose Ti is so short that its zero does not matter.
NO_LAG = 1e-3


def default_tau_c(process: Process) -> float:
    """Take tau_c = theta, the fastest that is recommended. [s]"""
    return process.theta


def simc_pi(process: Process, tau_c: float | None = None) -> PID:
    """Tune a PI controller.

    First order: Kc = tau/(K (tau_c + theta)), Ti = min(tau, 4 (tau_c + theta)).
    Integrating: Kc = 1/(K (tau_c + theta)), Ti = 4 (tau_c + theta).
    Pure delay: Kc/Ti = 1/(K (tau_c + theta)), integral control; here with Ti = 0.001 theta.

    Parameters
    ----------
    process : FOPDT, IPDT or PureDelay
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: theta. [s]

    Raises
    ------
    RuleNotApplicable
        There is neither a dead time nor a tau_c, or the process has another type.

    Examples
    --------
    >>> pid = simc_pi(FOPDT(K=2.0, tau=120.0, theta=30.0))
    >>> pid.Kc, pid.Ti
    (1.0, 120.0)
    """
    match process:
        case FOPDT(tau=tau):
            slope, lag = abs(process.K) / tau, tau
        case IPDT():
            slope, lag = abs(process.K), math.inf
        case PureDelay(theta=theta):
            slope, lag = abs(process.K) / (NO_LAG * theta), NO_LAG * theta
        case _:
            raise refuse_type(process, ("FOPDT", "IPDT", "PureDelay"), "SIMC PI")
    wait = chosen_tau_c(tau_c, default_tau_c(process), "SIMC PI") + process.theta
    return PID(
        Kc=1 / (slope * wait),
        Ti=min(lag, 4 * wait),
        action=Action.for_gain(process.K),
    )


def simc_second_order_pid(
    process: Process, tau_c: float | None = None, *, alpha: float = FILTER
) -> PID:
    """Tune a PID controller for two lags.

    Series form: Kc = tau1/(K (tau_c + theta)), Ti = min(tau1, 4 (tau_c + theta)), Td = tau2.

    Parameters
    ----------
    process : SOPDT
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: theta. [s]
    alpha : float
        Time of the derivative filter over the shorter of the series Ti and Td. [-]

    Raises
    ------
    RuleNotApplicable
        There is neither a dead time nor a tau_c, or the process has another type.

    Examples
    --------
    >>> pid = simc_second_order_pid(SOPDT(K=1.0, tau1=20.0, tau2=2.0, theta=1.0), alpha=0.0)
    >>> pid.Kc, pid.Ti, pid.Td  # 10, 8 and 2 in the series form
    (12.5, 10.0, 1.6)
    """
    rule = "SIMC PID"
    model = accept(process, SOPDT, rule)
    wait = chosen_tau_c(tau_c, default_tau_c(model), rule) + model.theta
    return series_to_isa(
        Kc=model.tau1 / (abs(model.K) * wait),
        Ti=min(model.tau1, 4 * wait),
        Td=model.tau2,
        alpha=alpha,
        K=model.K,
    )


def simc_integrating_lag_pid(
    process: Process, tau_c: float | None = None, *, alpha: float = FILTER
) -> PID:
    """Tune a PID controller for an integrator with a lag, K e^(-theta s)/(s (tau2 s + 1)).

    Series form: Kc = 1/(K (tau_c + theta)), Ti = 4 (tau_c + theta), Td = tau2.

    Parameters
    ----------
    process : TransferFunction
        Process model, of exactly that shape. [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: theta. [s]
    alpha : float
        Time of the derivative filter over the shorter of the series Ti and Td. [-]

    Raises
    ------
    RuleNotApplicable
        There is neither a dead time nor a tau_c, or the process has another shape.

    Examples
    --------
    >>> pid = simc_integrating_lag_pid(TransferFunction((1.0,), (2.0, 1.0, 0.0), 0.5), alpha=0.0)
    >>> pid.Kc, pid.Ti, round(pid.Td, 4)  # 1, 4 and 2 in the series form
    (1.5, 6.0, 1.3333)
    """
    rule = "SIMC PID"
    K, tau2 = integrator_with_lag(process, rule)
    wait = chosen_tau_c(tau_c, default_tau_c(process), rule) + process.theta
    return series_to_isa(
        Kc=1 / (abs(K) * wait),
        Ti=4 * wait,
        Td=tau2,
        alpha=alpha,
        K=K,
    )


def integrator_with_lag(process: Process, rule: str) -> tuple[float, float]:
    """Read K [PV/OP/s] and tau2 [s] off a transfer function K/(s (tau2 s + 1)).

    Raises
    ------
    RuleNotApplicable
        The transfer function has another shape.
    """
    match process:
        case TransferFunction(numerator=(n,), denominator=(d2, d1, 0.0)) if d1 and d2 / d1 > 0:
            return n / d1, d2 / d1
        case _:
            raise RuleNotApplicable(rule, "the transfer function is not K/(s (tau2 s + 1))")


def simc_double_integrating_pid(
    process: Process, tau_c: float | None = None, *, alpha: float = DOUBLE_INTEGRATOR_FILTER
) -> PID:
    """Tune a PID controller for two integrators.

    Series form: Kc = 1/(4 K (tau_c + theta)^2), Ti = 4 (tau_c + theta), Td = 4 (tau_c + theta).

    Parameters
    ----------
    process : DoubleIntegrator
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: theta. [s]
    alpha : float
        Time of the derivative filter over the shorter of the series Ti and Td. [-]

    Raises
    ------
    RuleNotApplicable
        There is neither a dead time nor a tau_c, or the process has another type.

    Examples
    --------
    >>> pid = simc_double_integrating_pid(DoubleIntegrator(K=1.0, theta=1.0), alpha=0.0)
    >>> pid.Kc, pid.Ti, pid.Td  # 1/16, 8 and 8 in the series form
    (0.125, 16.0, 4.0)
    """
    rule = "SIMC PID"
    model = accept(process, DoubleIntegrator, rule)
    wait = chosen_tau_c(tau_c, default_tau_c(model), rule) + model.theta
    return series_to_isa(
        Kc=1 / (4 * abs(model.K) * wait**2),
        Ti=4 * wait,
        Td=4 * wait,
        alpha=alpha,
        K=model.K,
    )


def simc_pid(process: Process, tau_c: float | None = None) -> PID:
    """Tune a PID controller by the formula for the type of the process.

    Parameters
    ----------
    process : SOPDT, DoubleIntegrator or TransferFunction
        Process model; a transfer function must be K/(s (tau2 s + 1)). [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: theta. [s]

    Raises
    ------
    RuleNotApplicable
        There is neither a dead time nor a tau_c, or the process has another type; a first-order
        model has no second lag to set Td by.
    """
    match process:
        case SOPDT():
            return simc_second_order_pid(process, tau_c)
        case DoubleIntegrator():
            return simc_double_integrating_pid(process, tau_c)
        case TransferFunction():
            return simc_integrating_lag_pid(process, tau_c)
        case _:
            raise RuleNotApplicable(
                "SIMC PID", f"Td is the second lag and {type(process).__name__} has none"
            )


def notes(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:
    """Say what is outside the recommendation and how the series form was converted."""
    said = []
    if tau_c is not None and tau_c < process.theta * (1 - 1e-9):
        said.append(
            f"faster than recommended: tau_c/theta is {tau_c / process.theta:.3g}, "
            "the recommendation is 1 or more"
        )
    if isinstance(process, PureDelay):
        said.append(
            f"published as pure integral control, Kc/Ti alone; Ti is {NO_LAG:g} theta because the "
            "ISA form has no other way to write it"
        )
    if structure == "PID":
        alpha = DOUBLE_INTEGRATOR_FILTER if isinstance(process, DoubleIntegrator) else FILTER
        said.append(
            f"published in series form, converted exactly with a filter of {alpha:g} times its "
            "shorter time: the margins hold for the N given here"
        )
    return tuple(said)


RULE = Rule(
    name="simc",
    title=TITLE,
    source="Skogestad 2003, J. Process Control 13, 291-309, doi:10.1016/S0959-1524(02)00062-8",
    status="confirmed",
    aim="a first-order response with time constant tau_c, and fast rejection of loads",
    form="series",
    validity="tau_c >= theta",
    structures=MappingProxyType({"PI": simc_pi, "PID": simc_pid}),
    takes=MappingProxyType(
        {
            "PI": ("FOPDT", "IPDT", "PureDelay"),
            "PID": ("SOPDT", "DoubleIntegrator", "TransferFunction"),
        }
    ),
    notes=notes,
    tau_c_text="theta",
    default_tau_c=default_tau_c,
)
