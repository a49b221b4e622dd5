"""IMC settings of Rivera, Morari and Skogestad for a first-order model with dead time.

Source: D. E. Rivera, M. Morari and S. Skogestad, "Internal model control. 4. PID controller
design," Ind. Eng. Chem. Process Des. Dev., vol. 25, pp. 252-265, 1986, Table II. The original was
not read; a public source quotes two rows of the table and all four formulas follow from a first
order Padé approximation. The limits on tau_c/theta are from memory.

The two PID columns differ in the denominator: `2 tau_c + theta` stands alone, and
`2 (tau_c + theta)` only together with its lag tauF. Taking the second without the lag is the
common mistake.

Not to be confused with `lambda_pi`, tau/(K (tau_c + theta)).
"""

from types import MappingProxyType

from loop.controller import PID, Action
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, Process
from tuning.rule import Rule, accept, chosen_tau_c

# The limits of the paper's table (from memory), times theta: the fastest it recommends.
PI_SPEED, PID_SPEED = 1.7, 0.8


def default_tau_c_pi(process: Process) -> float:
    """Take the fastest tau_c of the PI columns, 1.7 theta. [s]"""
    return PI_SPEED * accept(process, FOPDT, "IMC PI").theta


def default_tau_c_pid(process: Process) -> float:
    """Take the fastest tau_c of the PID columns, 0.8 theta. [s]"""
    return PID_SPEED * accept(process, FOPDT, "IMC PID").theta


def imc_pi(process: Process, tau_c: float | None = None) -> PID:
    """Tune a PI controller: Kc = tau/(K tau_c), Ti = tau.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: 1.7 theta. [s]

    Raises
    ------
    RuleNotApplicable
        There is neither a dead time nor a tau_c, or the process has another type.

    Examples
    --------
    >>> imc_pi(FOPDT(K=2.0, tau=120.0, theta=30.0), tau_c=60.0).Kc
    1.0
    """
    model = accept(process, FOPDT, "IMC PI")
    speed = chosen_tau_c(tau_c, default_tau_c_pi(model), "IMC PI")
    return PID(Kc=model.tau / (abs(model.K) * speed), Ti=model.tau, action=Action.for_gain(model.K))


def imc_improved_pi(process: Process, tau_c: float | None = None) -> PID:
    """Tune a PI controller: Kc = (2 tau + theta)/(2 K tau_c), Ti = tau + theta/2.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: 1.7 theta. [s]

    Raises
    ------
    RuleNotApplicable
        There is neither a dead time nor a tau_c, or the process has another type.

    Examples
    --------
    >>> pid = imc_improved_pi(FOPDT(K=2.0, tau=120.0, theta=30.0), tau_c=60.0)
    >>> pid.Kc, pid.Ti
    (1.125, 135.0)
    """
    model = accept(process, FOPDT, "IMC improved PI")
    speed = chosen_tau_c(tau_c, default_tau_c_pi(model), "IMC improved PI")
    return PID(
        Kc=(2 * model.tau + model.theta) / (2 * abs(model.K) * speed),
        Ti=model.tau + model.theta / 2,
        action=Action.for_gain(model.K),
    )


def _derivative_time(model: FOPDT, rule: str) -> float:
    if model.theta == 0:
        raise RuleNotApplicable(rule, "without dead time its Td is 0: take IMC PI")
    return model.tau * model.theta / (2 * model.tau + model.theta)


def imc_pid(process: Process, tau_c: float | None = None) -> PID:
    """Tune a PID controller without lag.

    Kc = (2 tau + theta)/(K (2 tau_c + theta)), Ti = tau + theta/2,
    Td = tau theta/(2 tau + theta).

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: 0.8 theta. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = imc_pid(FOPDT(K=2.0, tau=120.0, theta=30.0), tau_c=120.0)
    >>> pid.Kc, pid.Ti, round(pid.Td, 1), pid.tauF
    (0.5, 135.0, 13.3, 0.0)
    """
    model = accept(process, FOPDT, "IMC PID")
    Td = _derivative_time(model, "IMC PID")
    speed = chosen_tau_c(tau_c, default_tau_c_pid(model), "IMC PID")
    return PID(
        Kc=(2 * model.tau + model.theta) / (abs(model.K) * (2 * speed + model.theta)),
        Ti=model.tau + model.theta / 2,
        Td=Td,
        action=Action.for_gain(model.K),
    )


def imc_pid_with_lag(process: Process, tau_c: float | None = None) -> PID:
    """Tune a PID controller that works with a lag in series.

    Kc = (2 tau + theta)/(2 K (tau_c + theta)), Ti = tau + theta/2,
    Td = tau theta/(2 tau + theta), tauF = tau_c theta/(2 (tau_c + theta)).

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: 0.8 theta. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = imc_pid_with_lag(FOPDT(K=2.0, tau=120.0, theta=30.0), tau_c=120.0)
    >>> pid.Kc, pid.Ti, round(pid.Td, 1), pid.tauF
    (0.45, 135.0, 13.3, 12.0)
    """
    rule = "IMC PID with lag"
    model = accept(process, FOPDT, rule)
    Td = _derivative_time(model, rule)
    speed = chosen_tau_c(tau_c, default_tau_c_pid(model), rule)
    return PID(
        Kc=(2 * model.tau + model.theta) / (2 * abs(model.K) * (speed + model.theta)),
        Ti=model.tau + model.theta / 2,
        Td=Td,
        tauF=speed * model.theta / (2 * (speed + model.theta)),
        action=Action.for_gain(model.K),
    )


def _faster_than(limit: float, process: Process, tau_c: float | None) -> tuple[str, ...]:
    model = accept(process, FOPDT, "IMC")
    if tau_c is not None and tau_c < limit * model.theta * (1 - 1e-9):
        return (
            f"outside the range: tau_c/theta is {tau_c / model.theta:.3g}, "
            f"the table asks for more than {limit} (from memory)",
        )
    return ()


def _notes_pi(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:  # noqa: ARG001
    return _faster_than(PI_SPEED, process, tau_c)


def _notes_pid(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:  # noqa: ARG001
    return _faster_than(PID_SPEED, process, tau_c)


def _notes_lag(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:
    lag = "the lag tauF belongs to these settings: without it they are not this rule"
    return (lag, *_notes_pid(structure, process, tau_c))


_SOURCE = "Rivera, Morari & Skogestad 1986, Ind. Eng. Chem. Process Des. Dev. 25, 252-265, Table II"
_AIM = "the closed-loop response of a first-order filter with time constant tau_c"
_PI_RANGE = "tau_c > 1.7 theta (from memory)"
_PID_RANGE = "tau_c > 0.8 theta (from memory)"
_TAKES_PI = MappingProxyType({"PI": ("FOPDT",)})
_TAKES_PID = MappingProxyType({"PID": ("FOPDT",)})

PI_RULE = Rule(
    name="imc_pi",
    title="IMC PI",
    source=_SOURCE,
    status="confirmed",
    aim=_AIM,
    form="ISA",
    validity=_PI_RANGE,
    structures=MappingProxyType({"PI": imc_pi}),
    takes=_TAKES_PI,
    notes=_notes_pi,
    tau_c_text="1.7 theta",
    default_tau_c=default_tau_c_pi,
)
IMPROVED_PI_RULE = Rule(
    name="imc_improved_pi",
    title="IMC improved PI",
    source=_SOURCE,
    status="confirmed",
    aim=_AIM,
    form="ISA",
    validity=_PI_RANGE,
    structures=MappingProxyType({"PI": imc_improved_pi}),
    takes=_TAKES_PI,
    notes=_notes_pi,
    tau_c_text="1.7 theta",
    default_tau_c=default_tau_c_pi,
)
PID_RULE = Rule(
    name="imc_pid",
    title="IMC PID",
    source=_SOURCE,
    status="confirmed",
    aim=_AIM,
    form="ISA",
    validity=_PID_RANGE,
    structures=MappingProxyType({"PID": imc_pid}),
    takes=_TAKES_PID,
    notes=_notes_pid,
    tau_c_text="0.8 theta",
    default_tau_c=default_tau_c_pid,
)
PID_WITH_LAG_RULE = Rule(
    name="imc_pid_with_lag",
    title="IMC PID with lag",
    source=_SOURCE,
    status="confirmed",
    aim=_AIM,
    form="ISA",
    validity=_PID_RANGE,
    structures=MappingProxyType({"PID": imc_pid_with_lag}),
    takes=_TAKES_PID,
    notes=_notes_lag,
    tau_c_text="0.8 theta",
    default_tau_c=default_tau_c_pid,
)
