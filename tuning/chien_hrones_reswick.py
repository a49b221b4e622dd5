"""Chien-Hrones-Reswick settings from a first-order model with dead time.

Source: K. L. Chien, J. A. Hrones and J. B. Reswick, "On the automatic control of generalized
passive systems," Trans. ASME, vol. 74, pp. 175-185, 1952, from memory. The original was not read;
one public excerpt has the two set-point PID columns, with 1.357 tau and .473 theta where the table
from memory rounds to 1.4 and .47. Whether the aimed-at response is that of the very model used
here was not found: computed here on FOPDT, the set-point columns overshoot by less than they aim.

Range: none was found in what was read.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias

from loop.controller import PID, Action
from loop.process import FOPDT, Process
from tuning.rule import Rule, dead_time_ratio, no_notes, one_of, without_speed

TITLE = "CHR"
Unit: TypeAlias = Literal["tau", "theta"]


@dataclass(frozen=True, slots=True)
class Columns:
    """The constants of one aim, in units of tau/(K theta) for Kc and of `unit` for Ti.

    Attributes
    ----------
    p, pi, pid : float
        Kc of each structure. [-]
    pi_Ti, pid_Ti : float
        Ti of PI and PID. [-]
    unit : str
        What Ti is counted in, "tau" or "theta".
    Td : float
        Td of the PID, in dead times. [-]
    """

    p: float
    pi: float
    pi_Ti: float
    pid: float
    pid_Ti: float
    unit: Unit
    Td: float


SETPOINT_0 = Columns(0.3, 0.35, 1.2, 0.6, 1.0, "tau", 0.5)
SETPOINT_20 = Columns(0.7, 0.6, 1.0, 0.95, 1.4, "tau", 0.47)
LOAD_0 = Columns(0.3, 0.6, 4.0, 0.95, 2.4, "theta", 0.42)
LOAD_20 = Columns(0.7, 0.7, 2.3, 1.2, 2.0, "theta", 0.42)


def _unit(model: FOPDT, columns: Columns) -> float:
    return model.tau if columns.unit == "tau" else model.theta


def chr_p(process: Process, columns: Columns) -> PID:
    """Tune a P controller: Kc = p tau/(K theta).

    p is 0.3 for no overshoot and 0.7 for 20 %, for set point and load alike.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    columns : Columns
        Constants of the aim.

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> round(chr_p(FOPDT(K=1.0, tau=2.0, theta=1.0), LOAD_20).Kc, 5)
    1.4
    """
    model, r = dead_time_ratio(process, TITLE)
    return PID(Kc=columns.p / (abs(model.K) * r), action=Action.for_gain(model.K))


def chr_pi(process: Process, columns: Columns) -> PID:
    """Tune a PI controller: Kc = p tau/(K theta), Ti = q tau (set point) or q theta (load).

    Set point 0 %: p 0.35, q 1.2; 20 %: 0.6, 1. Load 0 %: 0.6, 4; 20 %: 0.7, 2.3.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    columns : Columns
        Constants of the aim.

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = chr_pi(FOPDT(K=1.0, tau=2.0, theta=1.0), LOAD_0)
    >>> round(pid.Kc, 5), pid.Ti
    (1.2, 4.0)
    """
    model, r = dead_time_ratio(process, TITLE)
    return PID(
        Kc=columns.pi / (abs(model.K) * r),
        Ti=columns.pi_Ti * _unit(model, columns),
        action=Action.for_gain(model.K),
    )


def chr_pid(process: Process, columns: Columns) -> PID:
    """Tune a PID controller: Kc = p tau/(K theta), Ti = q tau or q theta, Td = d theta.

    Set point 0 %: p 0.6, q 1, d 0.5; 20 %: 0.95, 1.4, 0.47.
    Load 0 %: 0.95, 2.4, 0.42; 20 %: 1.2, 2, 0.42.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    columns : Columns
        Constants of the aim.

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = chr_pid(FOPDT(K=1.0, tau=2.0, theta=1.0), SETPOINT_0)
    >>> round(pid.Kc, 5), pid.Ti, pid.Td
    (1.2, 2.0, 0.5)
    """
    model, r = dead_time_ratio(process, TITLE)
    return PID(
        Kc=columns.pid / (abs(model.K) * r),
        Ti=columns.pid_Ti * _unit(model, columns),
        Td=columns.Td * model.theta,
        action=Action.for_gain(model.K),
    )


def _rule(name: str, title: str, aim: str, columns: Columns) -> Rule:
    return Rule(
        name=name,
        title=title,
        source="Chien, Hrones & Reswick 1952, Trans. ASME 74, 175-185, from memory",
        status="memory",
        aim=aim,
        form="ISA",
        validity="no range was found in what was read",
        structures=MappingProxyType(
            {
                "P": without_speed(name, one_of(chr_p, columns)),
                "PI": without_speed(name, one_of(chr_pi, columns)),
                "PID": without_speed(name, one_of(chr_pid, columns)),
            }
        ),
        takes=MappingProxyType(dict.fromkeys(("P", "PI", "PID"), ("FOPDT",))),
        notes=no_notes,
    )


_AIMS: Mapping[str, tuple[str, str, Columns]] = {
    "chr_setpoint_0": (
        "CHR (set point, 0 %)",
        "the fastest set-point response without overshoot",
        SETPOINT_0,
    ),
    "chr_setpoint_20": (
        "CHR (set point, 20 %)",
        "the fastest set-point response with 20 % overshoot",
        SETPOINT_20,
    ),
    "chr_load_0": (
        "CHR (load, 0 %)",
        "the fastest recovery from a load without overshoot",
        LOAD_0,
    ),
    "chr_load_20": (
        "CHR (load, 20 %)",
        "the fastest recovery from a load with 20 % overshoot",
        LOAD_20,
    ),
}
CHR_RULES: tuple[Rule, ...] = tuple(_rule(name, *row) for name, row in _AIMS.items())
