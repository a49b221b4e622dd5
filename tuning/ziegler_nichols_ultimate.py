"""Ziegler-Nichols settings from the ultimate gain and period.

Source: J. G. Ziegler and N. B. Nichols, "Optimum settings for automatic controllers,"
Trans. ASME, vol. 64, pp. 759-768, 1942. The original was not read; the formulas are as quoted by
two public sources.

Range: no limit was found in what was read; Ku and Pu must exist.
"""

from types import MappingProxyType

from loop.controller import PID
from tuning.rule import Rule, at_ultimate_point
from tuning.ultimate import UltimatePoint, ultimate_notes

TITLE = "Ziegler-Nichols (ultimate)"


def ultimate_p(point: UltimatePoint) -> PID:
    """Tune a P controller from the ultimate point: Kc = 0.5 Ku.

    Parameters
    ----------
    point : UltimatePoint
        Ultimate gain [OP/PV] and period [s].

    Examples
    --------
    >>> ultimate_p(UltimatePoint(Ku=4.0, Pu=60.0)).Kc
    2.0
    """
    return PID(Kc=0.5 * point.Ku, action=point.action)


def ultimate_pi(point: UltimatePoint) -> PID:
    """Tune a PI controller from the ultimate point: Kc = 0.45 Ku, Ti = Pu/1.2.

    Parameters
    ----------
    point : UltimatePoint
        Ultimate gain [OP/PV] and period [s].

    Examples
    --------
    >>> pid = ultimate_pi(UltimatePoint(Ku=4.0, Pu=60.0))
    >>> pid.Kc, pid.Ti
    (1.8, 50.0)
    """
    return PID(Kc=0.45 * point.Ku, Ti=point.Pu / 1.2, action=point.action)


def ultimate_pid(point: UltimatePoint) -> PID:
    """Tune a PID controller from the ultimate point: Kc = 0.6 Ku, Ti = Pu/2, Td = Pu/8.

    Parameters
    ----------
    point : UltimatePoint
        Ultimate gain [OP/PV] and period [s].

    Examples
    --------
    >>> pid = ultimate_pid(UltimatePoint(Ku=4.0, Pu=60.0))
    >>> round(pid.Kc, 6), pid.Ti, pid.Td
    (2.4, 30.0, 7.5)
    """
    return PID(Kc=0.6 * point.Ku, Ti=point.Pu / 2, Td=point.Pu / 8, action=point.action)


NAME = "ziegler_nichols_ultimate"
_WITH_ULTIMATE_POINT = ("FOPDT", "SOPDT", "IPDT")
RULE = Rule(
    name=NAME,
    title=TITLE,
    source="Ziegler & Nichols 1942, Trans. ASME 64, 759-768",
    status="confirmed",
    aim="quarter decay of a load disturbance",
    form="ISA",
    validity="any process with an ultimate gain; no limit was found in what was read",
    structures=MappingProxyType(
        {
            "P": at_ultimate_point(NAME, TITLE, ultimate_p),
            "PI": at_ultimate_point(NAME, TITLE, ultimate_pi),
            "PID": at_ultimate_point(NAME, TITLE, ultimate_pid),
        }
    ),
    takes=MappingProxyType(dict.fromkeys(("P", "PI", "PID"), _WITH_ULTIMATE_POINT)),
    notes=ultimate_notes,
    from_ultimate=MappingProxyType({"P": ultimate_p, "PI": ultimate_pi, "PID": ultimate_pid}),
)
