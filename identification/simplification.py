"""The process that tuning rules take, from the structure that the record speaks for.

References
----------
.. [1] S. Skogestad, "Simple analytic rules for model reduction and PID controller tuning,"
   J. Process Control, vol. 13, no. 4, pp. 291-309, 2003. doi:10.1016/S0959-1524(02)00062-8
"""

from typing import TypeAlias

from identification.candidate import Candidate
from identification.structures import (
    INTEGRATOR_WITH_LAG,
    LEAD,
    PURE_DELAY,
    UNDERDAMPED,
)
from loop.half_rule import half_rule
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, PureDelay, TransferFunction

SimpleProcess: TypeAlias = FOPDT | SOPDT | IPDT | DoubleIntegrator | PureDelay | TransferFunction
# From here on a swing raises no frequency by more than 4 %, 1/(2 zeta sqrt(1 - zeta^2)), and two
# lags stand in for it.
DAMPED = 0.6
# A lag that no sample shows, where a formula wants one.
NO_LAG = 1e-3


def simplified(chosen: Candidate) -> tuple[SimpleProcess | None, str]:
    """Put a structure into the form that most tuning rules know.

    An inverse response is as bad as a dead time of the same length, and the lag behind an
    integrator as half its length [1]_; here it counts in full, which is on the safe side. A lead
    cancels by the half rule's approximations of a numerator [1]_, and a swing with a damping above
    0.6 becomes two lags with the same sum; one below stays as it is. None of this is proof.

    Parameters
    ----------
    chosen : Candidate
        Structure that the record speaks for.

    Returns
    -------
    process : FOPDT, SOPDT, IPDT, DoubleIntegrator, PureDelay, TransferFunction or None
        None where a parameter is outside what a process may have.
    remark : str
        What was simplified, or why there is no process; empty where the structure is itself simple.
    """
    values = dict(zip(chosen.structure.names, chosen.values.tolist(), strict=True))
    try:
        return _simple(chosen, values)
    except ValueError as fact:
        return None, str(fact)


def _simple(chosen: Candidate, values: dict[str, float]) -> tuple[SimpleProcess, str]:
    if chosen.structure is LEAD and values["lead"] < 0:
        inverse = -values.pop("lead")
        values["theta"] += inverse
        return SOPDT(**values), (
            f"the inverse response of {inverse:.3g} s counts as so much more dead time in the model"
        )
    if chosen.structure is INTEGRATOR_WITH_LAG:
        lag = values.pop("tau")
        values["theta"] += lag
        return IPDT(**values), (
            f"the lag of {lag:.3g} s behind the integrator counts as dead time in the model"
        )
    if chosen.structure is UNDERDAMPED:
        if values["zeta"] < DAMPED:
            swinging = chosen.structure.process(*chosen.values.tolist())
            assert isinstance(swinging, TransferFunction)  # noqa: S101 - as its structure has it
            return swinging, (
                f"no published rule takes a process that swings by itself with a damping of "
                f"{values['zeta']:.2g}, below {DAMPED:g}: settings are computed for it and held to "
                "it with its damping off by ±50 % too"
            )
        lag = values["zeta"] * values["T"]
        return SOPDT(K=values["K"], tau1=lag, tau2=lag, theta=values["theta"]), (
            f"the swing (damping {values['zeta']:.2g}) is left out of the model, two lags "
            "with the same sum stand for it"
        )
    process = chosen.structure.process(*chosen.values.tolist())
    if chosen.structure is LEAD:
        process = half_rule(process).model
        text = f"the lead of {values['lead']:.3g} s is cancelled against a lag in the model"
        assert isinstance(process, FOPDT)  # noqa: S101 - of two lags one is left
        return process, text
    assert isinstance(process, SimpleProcess)  # noqa: S101 - all others are above
    return process, ""


def first_order_equivalent(chosen: Candidate) -> tuple[float, float]:
    """Lag and dead time of one lag that takes as long, by the half rule [1]_. [s]

    Parameters
    ----------
    chosen : Candidate
        A structure that settles, not of first order.
    """
    values = dict(zip(chosen.structure.names, chosen.values.tolist(), strict=True))
    theta = values["theta"]
    if chosen.structure is UNDERDAMPED:  # the swing dies out with its envelope
        return values["T"] / values["zeta"], theta
    if chosen.structure is PURE_DELAY:
        return NO_LAG * theta, theta
    half = values["tau2"] / 2
    return values["tau1"] + half, theta + half + max(-values.get("lead", 0.0), 0.0)
