"""The slowest settings that still hold PV within what is allowed: smooth and averaging tuning.

Source: S. Skogestad, "Tuning for smooth PID control with acceptable disturbance rejection," Ind.
Eng. Chem. Res., vol. 45, pp. 7817-7822, 2006. The original was not read; the condition
Kc >= |u0|/|ymax| is as a public copy of the tuning files has it. The averaging level controller is
derived here: without dead time the lambda settings of an integrator are critically damped, and a
load step d then moves PV by K d tau_c/e at most.
"""

import math
from dataclasses import dataclass

from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, IPDT, LARGEST, SMALLEST, SOPDT, Process
from tuning.lambda_pi import lambda_integrating_pi
from tuning.rule import refuse_type
from tuning.simc import integrator_with_lag, simc_pi, simc_pid

SMOOTH_TITLE, AVERAGING_TITLE = "SIMC smooth tuning", "Averaging level tuning"
# Below so many dead times the averaging controller overshoots what was allowed.
SLOWEST_DEAD_TIME = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowestSettings:
    """Settings no faster than a load asks for.

    Attributes
    ----------
    pid : PID
        Settings.
    tau_c : float
        Desired closed-loop time constant that they have. [s]
    sentence : str
        What decided the speed, with its numbers.
    """

    pid: PID
    tau_c: float
    sentence: str


def smooth_simc(process: Process, *, load: float, allowed: float) -> SlowestSettings:
    """Tune by SIMC as slowly as a load permits: Kc = |u0|/|ymax| [1]_.

    tau_c follows from SIMC's own gain, tau_c = tau1/(K Kc) - theta (integrating: 1/(K Kc) - theta).

    Parameters
    ----------
    process : FOPDT, SOPDT, IPDT or TransferFunction
        Process model; a transfer function must be K/(s (tau2 s + 1)). [s]
    load : float
        Largest move of the output that is needed to reject a load, |u0|. [OP]
    allowed : float
        Largest deviation of PV that is allowed, |ymax|. [PV]

    Raises
    ------
    RuleNotApplicable
        It would have to be faster than tau_c = theta, or the process has another type.
    ValueError
        The load or the deviation is not a positive number.

    References
    ----------
    .. [1] S. Skogestad, Ind. Eng. Chem. Res. 45 (2006) 7817-7822.

    Examples
    --------
    >>> found = smooth_simc(FOPDT(K=2.0, tau=120.0, theta=30.0), load=5.0, allowed=20.0)
    >>> found.pid.Kc, found.tau_c
    (0.25, 210.0)
    """
    _check(load=load, allowed=allowed)
    match process:
        case FOPDT(tau=lag) | SOPDT(tau1=lag):
            slope = abs(process.K) / lag
        case IPDT():
            slope = abs(process.K)
        case _:
            slope = abs(integrator_with_lag(process, SMOOTH_TITLE)[0])
    Kc = load / allowed
    tau_c = 1 / (slope * Kc) - process.theta
    if tau_c < process.theta or tau_c < SMALLEST:
        fastest = "tau_c = theta" if process.theta else "any tau_c"
        best = load * slope * 2 * process.theta
        raise RuleNotApplicable(
            SMOOTH_TITLE,
            f"Kc = {Kc:.4g} would take tau_c = {tau_c:.4g} s; at {fastest}, the fastest that is "
            f"recommended, a load of {load:g} needs a deviation of {best:.4g} to be allowed",
        )
    tune = simc_pi if isinstance(process, FOPDT | IPDT) else simc_pid
    return SlowestSettings(
        pid=tune(process, tau_c),
        tau_c=tau_c,
        sentence=f"Kc = |u0|/|ymax| = {load:g}/{allowed:g}: as slow as a load of {load:g} permits "
        f"with PV off by {allowed:g} at most",
    )


def averaging_level(process: Process, *, load: float, allowed: float) -> SlowestSettings:
    """Tune an averaging level controller: as little movement of the outflow as the tank permits.

    tau_c = e (allowed/(K load) - theta), with the lambda settings Kc = (2 tau_c + theta)/(K
    (tau_c + theta)^2), Ti = 2 tau_c + theta. Derived here: before the controller acts PV moves by
    K load theta, and from then on by K load tau_c/e at most. Simulated, that holds for tau_c of 3
    dead times and more.

    Parameters
    ----------
    process : IPDT
        Level of a tank or another integrator. [s]
    load : float
        Largest step of the inflow, as the output it takes to balance it. [OP]
    allowed : float
        Largest deviation of the level. [PV]

    Raises
    ------
    RuleNotApplicable
        The dead time takes so much of what is allowed that tau_c would be below 3 theta, or the
        process has another type.
    ValueError
        The load or the deviation is not a positive number.

    Examples
    --------
    >>> found = averaging_level(IPDT(K=0.01, theta=0.0), load=10.0, allowed=20.0)
    >>> round(found.tau_c, 1), round(found.pid.Kc, 4), round(found.pid.Ti, 1)
    (543.7, 0.3679, 1087.3)
    """
    _check(load=load, allowed=allowed)
    if not isinstance(process, IPDT):
        raise refuse_type(process, ("IPDT",), AVERAGING_TITLE)
    room = allowed / (abs(process.K) * load) - process.theta
    if math.e * room < max(SLOWEST_DEAD_TIME * process.theta, SMALLEST):
        raise RuleNotApplicable(
            AVERAGING_TITLE,
            f"within the dead time of {process.theta:g} s a load of {load:g} moves PV by "
            f"{abs(process.K) * load * process.theta:.4g} already, of {allowed:g} allowed; tau_c "
            f"must be left with {SLOWEST_DEAD_TIME:g} dead times",
        )
    tau_c = math.e * room
    return SlowestSettings(
        pid=lambda_integrating_pi(process, tau_c),
        tau_c=tau_c,
        sentence=f"a load step of {load:g} moves the level by {allowed:g} at most; no slower "
        "settings of this kind keep that",
    )


def _check(**values: float) -> None:
    for name, value in values.items():
        if not SMALLEST <= value <= LARGEST:
            raise ValueError(f"{name} must lie within {SMALLEST:g} and {LARGEST:g}, got {value}")
