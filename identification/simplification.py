"""The process that tuning rules take, from the structure that the record speaks for.

References
----------
.. [1] S. Skogestad, "Simple analytic rules for model reduction and PID controller tuning,"
   J. Process Control, vol. 13, no. 4, pp. 291-309, 2003. doi:10.1016/S0959-1524(02)00062-8
"""

from typing import TypeAlias

from identification.candidates import MATERIAL, Candidate
from identification.structures import (
    INTEGRATOR_WITH_LAG,
    LEAD,
    UNDERDAMPED,
)
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator

SimpleProcess: TypeAlias = FOPDT | SOPDT | IPDT | DoubleIntegrator

# Up to here one lag stands in for a structure without a rule: two lags, the usual simplification,
# miss by as much.
STANDS_IN = 3 * MATERIAL


def simplified(chosen: Candidate, first: Candidate) -> tuple[SimpleProcess | None, str]:
    """Put a structure into the form that tuning rules know.

    An inverse response is as bad as a dead time of the same length, and the lag behind an
    integrator as half its length [1]_; here it counts in full, which is on the safe side. One lag
    stands in for a lead or a swing where it misses PV by under 6 % of the answer.

    Parameters
    ----------
    chosen : Candidate
        Structure that the record speaks for.
    first : Candidate
        First order plus dead time fitted to the same record.

    Returns
    -------
    process : FOPDT, SOPDT, IPDT, DoubleIntegrator or None
        None where no such form is near enough.
    remark : str
        What was simplified; empty where nothing was.
    """
    values = dict(zip(chosen.structure.names, chosen.values.tolist(), strict=True))
    if chosen.structure is LEAD and values["lead"] < 0:
        inverse = -values.pop("lead")
        values["theta"] += inverse
        return SOPDT(**values), (
            f"the inverse response of {inverse:.3g} s counts as so much more dead time for tuning"
        )
    if chosen.structure is INTEGRATOR_WITH_LAG:
        lag = values.pop("tau")
        values["theta"] += lag
        return IPDT(**values), (
            f"the lag of {lag:.3g} s behind the integrator counts as dead time for tuning"
        )
    if chosen.structure in (LEAD, UNDERDAMPED):
        stand_in = first.process
        if first.part > STANDS_IN or not isinstance(stand_in, FOPDT):
            return None, (
                f"no tuning rule takes {chosen.structure.name}, and one lag in its stead misses "
                f"PV by {100 * first.part:.2g} % of the answer, more than {100 * STANDS_IN:g} %"
            )
        return stand_in, f"tuning takes one lag in the stead of {chosen.structure.name}"
    try:
        process = chosen.structure.process(*chosen.values.tolist())
    except ValueError as fact:
        return None, str(fact)
    assert isinstance(process, FOPDT | SOPDT | IPDT | DoubleIntegrator)  # noqa: S101 - all others are above
    return process, ""


def first_order_equivalent(chosen: Candidate) -> tuple[float, float]:
    """Lag and dead time of one lag that takes as long, by the half rule [1]_. [s]

    Parameters
    ----------
    chosen : Candidate
        A structure that settles, of second order.
    """
    values = dict(zip(chosen.structure.names, chosen.values.tolist(), strict=True))
    theta = values["theta"]
    if chosen.structure is UNDERDAMPED:  # the swing dies out with its envelope
        return values["T"] / values["zeta"], theta
    half = values["tau2"] / 2
    return values["tau1"] + half, theta + half + max(-values.get("lead", 0.0), 0.0)
