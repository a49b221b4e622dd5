"""Ziegler-Nichols settings from the reaction curve (open-loop step).

Source: J. G. Ziegler and N. B. Nichols, "Optimum settings for automatic controllers,"
Trans. ASME, vol. 64, pp. 759-768, 1942. The original was not read; the formulas are as quoted by
two public sources, and a third prints 3.3 L for L/0.3.

Range: O'Dwyer's handbook, as quoted by one public source, gives theta/tau <= 1; the usual
0.1 to 1 is from memory. The rule knows only the slope K/tau and the dead time, so it takes an
integrating process as it is.
"""

from types import MappingProxyType

from loop.controller import PID, Action
from loop.process import FOPDT, IPDT, Process
from tuning.rule import Rule, refuse_type, require_dead_time, without_speed

TITLE = "Ziegler-Nichols (reaction curve)"


def _slope_dead_time_and_action(process: Process) -> tuple[float, float, Action]:
    match process:
        case FOPDT(tau=tau):
            slope = process.K / tau
        case IPDT():
            slope = process.K
        case _:
            raise refuse_type(process, ("FOPDT", "IPDT"), TITLE)
    return abs(slope), require_dead_time(process, TITLE), Action.for_gain(slope)


def reaction_curve_p(process: Process) -> PID:
    """Tune a P controller from the reaction curve: Kc = tau/(K theta).

    Parameters
    ----------
    process : FOPDT or IPDT
        Process model; for IPDT K stands for K/tau. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> round(reaction_curve_p(FOPDT(K=2.0, tau=120.0, theta=30.0)).Kc, 6)
    2.0
    """
    slope, theta, action = _slope_dead_time_and_action(process)
    return PID(Kc=1 / (slope * theta), action=action)


def reaction_curve_pi(process: Process) -> PID:
    """Tune a PI controller from the reaction curve: Kc = 0.9 tau/(K theta), Ti = theta/0.3.

    Parameters
    ----------
    process : FOPDT or IPDT
        Process model; for IPDT K stands for K/tau. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = reaction_curve_pi(FOPDT(K=2.0, tau=120.0, theta=30.0))
    >>> round(pid.Kc, 6), round(pid.Ti, 6)
    (1.8, 100.0)
    """
    slope, theta, action = _slope_dead_time_and_action(process)
    return PID(Kc=0.9 / (slope * theta), Ti=theta / 0.3, action=action)


def reaction_curve_pid(process: Process) -> PID:
    """Tune a PID controller from the reaction curve.

    Kc = 1.2 tau/(K theta), Ti = 2 theta, Td = 0.5 theta.

    Parameters
    ----------
    process : FOPDT or IPDT
        Process model; for IPDT K stands for K/tau. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = reaction_curve_pid(FOPDT(K=2.0, tau=120.0, theta=30.0))
    >>> round(pid.Kc, 6), pid.Ti, pid.Td
    (2.4, 60.0, 15.0)
    """
    slope, theta, action = _slope_dead_time_and_action(process)
    return PID(Kc=1.2 / (slope * theta), Ti=2 * theta, Td=0.5 * theta, action=action)


def _notes(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:  # noqa: ARG001
    if isinstance(process, FOPDT):
        ratio = process.theta / process.tau
        if ratio > 1:
            return (f"outside the range: theta/tau is {ratio:.3g}, the rule is for up to 1",)
        if ratio < 0.1:
            return (f"theta/tau is {ratio:.3g}, below the usual 0.1 to 1 (from memory)",)
    return ()


NAME = "ziegler_nichols_reaction_curve"
_BOTH = ("FOPDT", "IPDT")
RULE = Rule(
    name=NAME,
    title=TITLE,
    source="Ziegler & Nichols 1942, Trans. ASME 64, 759-768",
    status="confirmed",
    aim="quarter decay of a load disturbance",
    form="ISA",
    validity="theta/tau up to 1; the usual 0.1 to 1 is from memory",
    structures=MappingProxyType(
        {
            "P": without_speed(NAME, reaction_curve_p),
            "PI": without_speed(NAME, reaction_curve_pi),
            "PID": without_speed(NAME, reaction_curve_pid),
        }
    ),
    takes=MappingProxyType({"P": _BOTH, "PI": _BOTH, "PID": _BOTH}),
    notes=_notes,
)
