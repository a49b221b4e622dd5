"""AMIGO settings from a step response: first order or integrator with dead time.

Source: K. J. Åström and T. Hägglund, "Revisiting the Ziegler-Nichols step response method for PID
control," J. Process Control, vol. 14, pp. 635-650, 2004, and Advanced PID Control, ISA, 2006. The
originals were not read; the formulas are as quoted by two public sources. An older Ti with 6.7, 2
and 10 (2002, from memory) is in circulation; the constants of 2004 are 13, 12 and 7, and give Ms
1.21 to 1.49 on first-order models.

The set-point weight of the PID (b = 0 for theta/(theta + tau) up to 0.5, else 1) is from memory.

Range: one public source warns of the PID below theta/(theta + tau) = 0.3.
"""

from types import MappingProxyType

from loop.controller import PID, Action
from loop.process import FOPDT, IPDT, Process
from tuning.rule import Rule, refuse_type, require_dead_time, without_speed

TITLE = "AMIGO"


def amigo_pi(process: Process) -> PID:
    """Tune a PI controller.

    First order: Kc = 0.15/K + (0.35 - theta tau/(theta + tau)^2) tau/(K theta),
    Ti = 0.35 theta + 13 theta tau^2/(tau^2 + 12 theta tau + 7 theta^2).
    Integrating: Kc = 0.35/(K theta), Ti = 13.4 theta.

    Parameters
    ----------
    process : FOPDT or IPDT
        Process model. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = amigo_pi(FOPDT(K=1.0, tau=1.0, theta=0.5))
    >>> round(pid.Kc, 5), round(pid.Ti, 5)
    (0.40556, 0.91786)
    """
    match process:
        case FOPDT(tau=tau):
            theta = require_dead_time(process, TITLE)
            r = theta / tau
            KKc = 0.15 + (0.35 - r / (1 + r) ** 2) / r
            Ti = theta * (0.35 + 13 / (1 + 12 * r + 7 * r**2))
        case IPDT():
            theta = require_dead_time(process, TITLE)
            KKc, Ti = 0.35 / theta, 13.4 * theta
        case _:
            raise refuse_type(process, ("FOPDT", "IPDT"), TITLE)
    return PID(Kc=KKc / abs(process.K), Ti=Ti, action=Action.for_gain(process.K))


def amigo_pid(process: Process) -> PID:
    """Tune a PID controller.

    First order: Kc = (0.2 + 0.45 tau/theta)/K, Ti = theta (0.4 theta + 0.8 tau)/(theta + 0.1 tau),
    Td = 0.5 theta tau/(0.3 theta + tau), b = 0 for theta/(theta + tau) <= 0.5, else 1.
    Integrating: Kc = 0.45/(K theta), Ti = 8 theta, Td = 0.5 theta, b = 0.

    Parameters
    ----------
    process : FOPDT or IPDT
        Process model. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = amigo_pid(FOPDT(K=1.0, tau=1.0, theta=0.5))
    >>> round(pid.Kc, 5), round(pid.Ti, 5), round(pid.Td, 5), pid.b
    (1.1, 0.83333, 0.21739, 0.0)
    """
    match process:
        case FOPDT(tau=tau):
            theta = require_dead_time(process, TITLE)
            r = theta / tau
            KKc, Ti = 0.2 + 0.45 / r, theta * (0.4 * r + 0.8) / (r + 0.1)
            Td, b = 0.5 * theta / (0.3 * r + 1), float(r > 1)
        case IPDT():
            theta = require_dead_time(process, TITLE)
            KKc, Ti, Td, b = 0.45 / theta, 8 * theta, 0.5 * theta, 0.0
        case _:
            raise refuse_type(process, ("FOPDT", "IPDT"), TITLE)
    return PID(Kc=KKc / abs(process.K), Ti=Ti, Td=Td, b=b, action=Action.for_gain(process.K))


def _notes(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:  # noqa: ARG001
    if structure != "PID":
        return ()
    said = ["the set-point weight b is from memory"]
    tau = process.tau if isinstance(process, FOPDT) else float("inf")
    relative = process.theta / (process.theta + tau)
    if relative < 0.3:
        said.append(f"theta/(theta + tau) is {relative:.3g}: one source warns of the PID below 0.3")
    return tuple(said)


NAME = "amigo"
RULE = Rule(
    name=NAME,
    title=TITLE,
    source="Åström & Hägglund 2004, J. Process Control 14, 635-650; 2006, Advanced PID Control",
    status="confirmed",
    aim="the largest integral gain with Ms and Mt within 1.4",
    form="ISA",
    validity="PID: one source warns below theta/(theta + tau) = 0.3",
    structures=MappingProxyType(
        {"PI": without_speed(NAME, amigo_pi), "PID": without_speed(NAME, amigo_pid)}
    ),
    takes=MappingProxyType(dict.fromkeys(("PI", "PID"), ("FOPDT", "IPDT"))),
    notes=_notes,
)
