"""Tyreus-Luyben settings from the ultimate gain and period.

Source: B. D. Tyreus and W. L. Luyben, "Tuning PI controllers for integrator/dead time
processes," Ind. Eng. Chem. Res., vol. 31, pp. 2625-2628, 1992 (PI); M. L. Luyben and
W. L. Luyben, Essentials of Process Control, McGraw-Hill, 1997 (PID). The originals were not read;
the formulas are as quoted by two public sources. Computed here: the PI on an integrator with dead
time has Mt 2.06 dB, GM 3.04, Ms 1.67.

Range: made for an integrator with dead time; no limit was found in what was read.
"""

from types import MappingProxyType

from loop.controller import PID
from loop.process import FOPDT, Process
from tuning.rule import Rule, at_ultimate_point
from tuning.ultimate import UltimatePoint, ultimate_notes

TITLE = "Tyreus-Luyben"


def tyreus_luyben_pi(point: UltimatePoint) -> PID:
    """Tune a PI controller from the ultimate point: Kc = Ku/3.2, Ti = 2.2 Pu.

    Parameters
    ----------
    point : UltimatePoint
        Ultimate gain [OP/PV] and period [s].

    Examples
    --------
    >>> pid = tyreus_luyben_pi(UltimatePoint(Ku=4.0, Pu=60.0))
    >>> pid.Kc, round(pid.Ti, 6)
    (1.25, 132.0)
    """
    return PID(Kc=point.Ku / 3.2, Ti=2.2 * point.Pu, action=point.action)


def tyreus_luyben_pid(point: UltimatePoint) -> PID:
    """Tune a PID controller from the ultimate point: Kc = Ku/2.2, Ti = 2.2 Pu, Td = Pu/6.3.

    Parameters
    ----------
    point : UltimatePoint
        Ultimate gain [OP/PV] and period [s].

    Examples
    --------
    >>> pid = tyreus_luyben_pid(UltimatePoint(Ku=4.0, Pu=60.0))
    >>> round(pid.Kc, 4), round(pid.Ti, 6), round(pid.Td, 4)
    (1.8182, 132.0, 9.5238)
    """
    return PID(Kc=point.Ku / 2.2, Ti=2.2 * point.Pu, Td=point.Pu / 6.3, action=point.action)


def _notes(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:
    slow: tuple[str, ...] = ()
    if isinstance(process, FOPDT) and process.theta > process.tau:
        slow = ("made for an integrator with dead time: expect a slow recovery where theta > tau",)
    return ultimate_notes(structure, process, tau_c) + slow


NAME = "tyreus_luyben"
_WITH_ULTIMATE_POINT = ("FOPDT", "SOPDT", "IPDT")
RULE = Rule(
    name=NAME,
    title=TITLE,
    source="Tyreus & Luyben 1992, Ind. Eng. Chem. Res. 31, 2625-2628; PID: Luyben & Luyben 1997",
    status="confirmed",
    aim="a closed-loop peak Mt of 2 dB on an integrator with dead time",
    form="ISA",
    validity="made for an integrator with dead time; no limit was found in what was read",
    structures=MappingProxyType(
        {
            "PI": at_ultimate_point(NAME, TITLE, tyreus_luyben_pi),
            "PID": at_ultimate_point(NAME, TITLE, tyreus_luyben_pid),
        }
    ),
    takes=MappingProxyType(dict.fromkeys(("PI", "PID"), _WITH_ULTIMATE_POINT)),
    notes=_notes,
    from_ultimate=MappingProxyType({"PI": tyreus_luyben_pi, "PID": tyreus_luyben_pid}),
)
