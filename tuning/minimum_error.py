"""Minimum-error settings of Lopez (load) and Rovira (set point) for a first-order model.

Source: A. M. Lopez, J. A. Miller, C. L. Smith and P. W. Murrill, "Tuning controllers with
error-integral criteria," Instrum. Technol., vol. 14, pp. 57-62, 1967 (load), and A. A. Rovira,
P. W. Murrill and C. L. Smith, "Tuning controllers for setpoint changes," Instrum. Control Syst.,
vol. 42, pp. 67-69, 1969 (set point). The originals were not read; the constants are as quoted by
two public sources (a third misprints two of them). Re-optimised settings agree within what a
power law can hold, and Rovira's PID only with the derivative on PV (c = 0).

Range: theta/tau from 0.1 to 1, from which the constants were fitted.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, TypeAlias

from loop.controller import PID, Action
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, Process
from tuning.rule import Rule, accept, dead_time_ratio, one_of, without_speed

Criterion: TypeAlias = Literal["ISE", "IAE", "ITAE"]
LOAD_TITLE, SETPOINT_TITLE = "Lopez", "Rovira"
SHORTEST, LONGEST = 0.1, 1.0

# A, B, C, D and for the PID also E, F.
LOAD_PI: Mapping[Criterion, tuple[float, ...]] = {
    "ISE": (1.305, -0.959, 0.492, 0.739),
    "IAE": (0.984, -0.986, 0.608, 0.707),
    "ITAE": (0.859, -0.977, 0.674, 0.68),
}
LOAD_PID: Mapping[Criterion, tuple[float, ...]] = {
    "ISE": (1.495, -0.945, 1.101, 0.771, 0.56, 1.006),
    "IAE": (1.435, -0.921, 0.878, 0.749, 0.482, 1.137),
    "ITAE": (1.357, -0.947, 0.842, 0.738, 0.381, 0.995),
}
SETPOINT_PI: Mapping[Criterion, tuple[float, ...]] = {
    "IAE": (0.758, -0.861, 1.02, -0.323),
    "ITAE": (0.586, -0.916, 1.03, -0.165),
}
SETPOINT_PID: Mapping[Criterion, tuple[float, ...]] = {
    "IAE": (1.086, -0.869, 0.74, -0.13, 0.348, 0.914),
    "ITAE": (0.965, -0.85, 0.796, -0.1465, 0.308, 0.929),
}


def _settings(model: FOPDT, r: float, constants: tuple[float, ...], Ti: float) -> PID:
    A, B = constants[:2]
    Td = 0.0
    if len(constants) > 4:
        E, F = constants[4:]
        Td = model.tau * E * r**F
    return PID(Kc=A * r**B / abs(model.K), Ti=Ti, Td=Td, action=Action.for_gain(model.K))


def _load_settings(process: Process, constants: tuple[float, ...]) -> PID:
    model, r = dead_time_ratio(process, LOAD_TITLE)
    C, D = constants[2:4]
    return _settings(model, r, constants, model.tau / C * r**D)


def _setpoint_settings(process: Process, constants: tuple[float, ...]) -> PID:
    model, r = dead_time_ratio(process, SETPOINT_TITLE)
    C, D = constants[2:4]
    if C + D * r <= 0:
        raise RuleNotApplicable(
            SETPOINT_TITLE,
            f"its Ti is positive for theta/tau below {-C / D:.3g} only, here it is {r:.3g}",
        )
    return _settings(model, r, constants, model.tau / (C + D * r))


def lopez_pi(process: Process, criterion: Criterion) -> PID:
    """Tune a PI controller for loads: Kc = (A/K) r^B, Ti = (tau/C) r^D, r = theta/tau.

    ISE: 1.305, -0.959, 0.492, 0.739; IAE: 0.984, -0.986, 0.608, 0.707;
    ITAE: 0.859, -0.977, 0.674, 0.68.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    criterion : str
        "ISE", "IAE" or "ITAE" of the response to a load step at the process input.

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = lopez_pi(FOPDT(K=1.0, tau=1.0, theta=1.0), "ITAE")
    >>> pid.Kc, round(pid.Ti, 4)
    (0.859, 1.4837)
    """
    return _load_settings(process, LOAD_PI[criterion])


def lopez_pid(process: Process, criterion: Criterion) -> PID:
    """Tune a PID controller for loads: as PI, with Td = tau E r^F.

    ISE: 1.495, -0.945, 1.101, 0.771, 0.56, 1.006; IAE: 1.435, -0.921, 0.878, 0.749, 0.482, 1.137;
    ITAE: 1.357, -0.947, 0.842, 0.738, 0.381, 0.995.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    criterion : str
        "ISE", "IAE" or "ITAE" of the response to a load step at the process input.

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = lopez_pid(FOPDT(K=1.0, tau=1.0, theta=1.0), "ITAE")
    >>> pid.Kc, round(pid.Ti, 4), pid.Td
    (1.357, 1.1876, 0.381)
    """
    return _load_settings(process, LOAD_PID[criterion])


def rovira_pi(process: Process, criterion: Criterion) -> PID:
    """Tune a PI controller for set points: Kc = (A/K) r^B, Ti = tau/(C + D r), r = theta/tau.

    IAE: 0.758, -0.861, 1.02, -0.323; ITAE: 0.586, -0.916, 1.03, -0.165.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    criterion : str
        "IAE" or "ITAE" of the response to a set-point step.

    Raises
    ------
    RuleNotApplicable
        There is no dead time, theta/tau is so large that Ti would not be positive, or the process
        has another type.

    Examples
    --------
    >>> pid = rovira_pi(FOPDT(K=1.0, tau=1.0, theta=1.0), "ITAE")
    >>> pid.Kc, round(pid.Ti, 4)
    (0.586, 1.1561)
    """
    return _setpoint_settings(process, SETPOINT_PI[criterion])


def rovira_pid(process: Process, criterion: Criterion) -> PID:
    """Tune a PID controller for set points: as PI, with Td = tau E r^F and the derivative on PV.

    IAE: 1.086, -0.869, 0.74, -0.13, 0.348, 0.914; ITAE: 0.965, -0.85, 0.796, -0.1465, 0.308, 0.929.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    criterion : str
        "IAE" or "ITAE" of the response to a set-point step.

    Raises
    ------
    RuleNotApplicable
        There is no dead time, theta/tau is so large that Ti would not be positive, or the process
        has another type.

    Examples
    --------
    >>> pid = rovira_pid(FOPDT(K=1.0, tau=1.0, theta=1.0), "ITAE")
    >>> pid.Kc, round(pid.Ti, 4), pid.Td, pid.c
    (0.965, 1.5396, 0.308, 0.0)
    """
    return _setpoint_settings(process, SETPOINT_PID[criterion])


def _notes(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:  # noqa: ARG001
    model = accept(process, FOPDT, "The minimum-error rule")
    ratio = model.theta / model.tau
    if SHORTEST * (1 - 1e-9) <= ratio <= LONGEST * (1 + 1e-9):
        return ()
    return (
        f"outside the range: theta/tau is {ratio:.3g}, the constants were fitted for "
        f"{SHORTEST:g} to {LONGEST:g}",
    )


def _lopez(criterion: Criterion) -> Rule:
    name = f"lopez_{criterion.lower()}"
    return Rule(
        name=name,
        title=f"{LOAD_TITLE} {criterion}",
        source="Lopez, Miller, Smith & Murrill 1967, Instrum. Technol. 14, 57-62",
        status="confirmed",
        aim=f"the least {criterion} after a load step at the process input",
        form="ISA",
        validity="theta/tau from 0.1 to 1",
        structures=MappingProxyType(
            {
                "PI": without_speed(name, one_of(lopez_pi, criterion)),
                "PID": without_speed(name, one_of(lopez_pid, criterion)),
            }
        ),
        takes=MappingProxyType(dict.fromkeys(("PI", "PID"), ("FOPDT",))),
        notes=_notes,
    )


def _rovira(criterion: Criterion) -> Rule:
    name = f"rovira_{criterion.lower()}"
    return Rule(
        name=name,
        title=f"{SETPOINT_TITLE} {criterion}",
        source="Rovira, Murrill & Smith 1969, Instrum. Control Syst. 42, 67-69",
        status="confirmed",
        aim=f"the least {criterion} after a set-point step",
        form="ISA",
        validity="theta/tau from 0.1 to 1; derivative on PV",
        structures=MappingProxyType(
            {
                "PI": without_speed(name, one_of(rovira_pi, criterion)),
                "PID": without_speed(name, one_of(rovira_pid, criterion)),
            }
        ),
        takes=MappingProxyType(dict.fromkeys(("PI", "PID"), ("FOPDT",))),
        notes=_notes,
    )


LOPEZ_RULES = tuple(_lopez(criterion) for criterion in LOAD_PI)
ROVIRA_RULES = tuple(_rovira(criterion) for criterion in SETPOINT_PI)
