"""Skogestad's half rule: any stable or integrating process as one of the low-order models.

Source: S. Skogestad, "Simple analytic rules for model reduction and PID controller tuning,"
J. Process Control, vol. 13, no. 4, pp. 291-309, 2003. doi:10.1016/S0959-1524(02)00062-8. The
original was not read. The half rule itself is as in a public implementation; the rules T1 to T3 for
numerator time constants are from memory, and the worked examples E2, E3, E12 and E13 agree with
them.

The largest lag that is neglected is split: half to the smallest lag that is kept, half to the dead
time. Smaller lags and the time constants of zeros in the right half-plane go to the dead time. The
rules T1 to T3 first cancel each positive numerator time constant T0 against a lag tau0. They rest
on tau_c, which is taken equal to the dead time that comes out.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from loop.errors import RuleNotApplicable
from loop.lag_chain import LagChain, lag_chain
from loop.process import (
    FOPDT,
    IPDT,
    LARGEST,
    SOPDT,
    DoubleIntegrator,
    Process,
    PureDelay,
    TransferFunction,
)

TITLE = "The half rule"
LowOrder: TypeAlias = FOPDT | SOPDT | IPDT | DoubleIntegrator | PureDelay | TransferFunction
# A smaller lag is close to T0 within this factor; 0.1 % of it is left to rounding.
CLOSE = 1.6 * (1 - 1e-3)
FAR = 5.0
MOST_ROUNDS = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduction:
    """A process and the low-order model that stands for it.

    Attributes
    ----------
    process : Process
        What was reduced.
    model : FOPDT, SOPDT, IPDT, DoubleIntegrator, PureDelay or TransferFunction
        Model; a transfer function is K/(s (tau2 s + 1)).
    steps : tuple of str
        What was neglected and where it went, one sentence each; empty where the model is exact.
    """

    process: Process
    model: LowOrder
    steps: tuple[str, ...]

    @property
    def exact(self) -> bool:
        """Whether nothing was neglected."""
        return not self.steps


def half_rule(
    process: Process,
    *,
    order: Literal[1, 2] = 1,
    tau_c: float | None = None,
    sample_time: float = 0.0,
) -> Reduction:
    """Reduce a process to one or two lags or integrators with dead time.

    Parameters
    ----------
    process : Process
        Process with real lags, real zeros and at most two integrators. [s]
    order : int
        Poles of the model, its integrators included: 1 for FOPDT or IPDT, 2 for SOPDT,
        K/(s (tau2 s + 1)) or two integrators.
    tau_c : float, optional
        Desired closed-loop time constant, for numerator time constants alone. Default: the dead
        time of the model, found by repetition from the dead time that no lag adds to. [s]
    sample_time : float
        Scan time; half of it is added to the dead time. [s]

    Raises
    ------
    RuleNotApplicable
        The process is unstable, oscillates, has complex zeros or fewer poles than the model.
    ValueError
        The sample time or a parameter of the model is out of its range.

    Examples
    --------
    >>> found = half_rule(TransferFunction((1.0,), (1.0, 2.0, 1.0), 1.0))
    >>> found.model
    FOPDT(K=1.0, tau=1.5, theta=1.5)
    >>> found.steps
    ('the lag of 1 s: half to the lag that is kept, half to the dead time',)
    """
    return reduce_chain(
        process, lag_chain(process), order=order, tau_c=tau_c, sample_time=sample_time
    )


def reduce_chain(
    process: Process,
    chain: LagChain,
    *,
    order: Literal[1, 2] = 1,
    tau_c: float | None = None,
    sample_time: float = 0.0,
) -> Reduction:
    """Reduce a process whose factors are known, as `half_rule` does.

    Parameters
    ----------
    process : Process
        The process, for the result.
    chain : LagChain
        Its factors. [s]
    order : int
        Poles of the model.
    tau_c : float, optional
        Desired closed-loop time constant. [s]
    sample_time : float
        Scan time. [s]

    Raises
    ------
    RuleNotApplicable
        The process has fewer poles than the model, or more integrators.
    ValueError
        The sample time or a parameter of the model is out of its range.
    """
    if chain.integrators > order:
        raise RuleNotApplicable(
            TITLE, f"a model of order {order} cannot hold {chain.integrators} integrators"
        )
    hold = sample_time / 2
    if not 0 <= hold <= LARGEST / 2:
        raise ValueError(f"sample_time must lie within 0 and {LARGEST:g} s, got {sample_time}")
    if tau_c is not None or not chain.leads:
        model, steps = _reduced(chain, order, tau_c or 0.0, hold)
        return Reduction(process=process, model=model, steps=(*chain.remarks, *steps))
    # Self-consistent by repetition. Several answers can exist: the dead time that is there already
    # leads to the fastest; without one, the lags as if there were no numerator are the start.
    least = chain.theta + sum(-T for T in chain.inverse)
    guess = least or _without_leads(chain, order).theta
    for _ in range(MOST_ROUNDS):
        model, steps = _reduced(chain, order, guess, hold)
        if abs(model.theta - guess) <= 1e-9 * guess:
            break
        guess = model.theta
    else:
        steps = (*steps, "tau_c and the dead time did not agree: the last round stands")
    return Reduction(process=process, model=model, steps=(*chain.remarks, *steps))


def _without_leads(chain: LagChain, order: int) -> LowOrder:
    plain = LagChain(
        K=chain.K,
        lags=chain.lags,
        leads=(),
        inverse=chain.inverse,
        integrators=chain.integrators,
        theta=chain.theta,
    )
    return _reduced(plain, order, 0.0, 0.0)[0]


def _reduced(
    chain: LagChain, order: int, tau_c: float, hold: float
) -> tuple[LowOrder, tuple[str, ...]]:
    K, lags, steps = _without_numerator(chain, tau_c)
    kept, theta = order - chain.integrators, chain.theta + hold
    held, rest = lags[:kept], lags[kept:]
    for T in chain.inverse:
        theta -= T
        steps.append(f"the zero ({T:g} s + 1) to the dead time, {-T:g} s")
    if rest:
        theta += 0.5 * rest[0] + sum(rest[1:])
        if held:
            held = sorted([*held[:-1], held[-1] + 0.5 * rest[0]], reverse=True)
            steps.append(
                f"the lag of {rest[0]:g} s: half to the lag that is kept, half to the dead time"
            )
        else:
            steps.append(f"the lag of {rest[0]:g} s: half of it to the dead time")
    if rest[1:]:
        steps.append("to the dead time: lags of " + ", ".join(f"{T:g}" for T in rest[1:]) + " s")
    if hold:
        steps.append(f"half of the scan time to the dead time, {hold:g} s")
    return _model(K, held, chain.integrators, theta, order), tuple(steps)


def _model(K: float, lags: list[float], integrators: int, theta: float, order: int) -> LowOrder:
    match integrators, lags:
        case 0, [tau]:
            if order == 1:
                return FOPDT(K=K, tau=tau, theta=theta)
        case 0, [tau1, tau2]:
            return SOPDT(K=K, tau1=tau1, tau2=tau2, theta=theta)
        case 0, []:
            if order == 1 and theta > 0:
                return PureDelay(K=K, theta=theta)
        case 1, []:
            if order == 1:
                return IPDT(K=K, theta=theta)
        case 1, [tau]:
            return TransferFunction((K,), (tau, 1.0, 0.0), theta)
        case _:
            return DoubleIntegrator(K=K, theta=theta)
    missing = "second lag" if order == 2 else "lag and no dead time"
    raise RuleNotApplicable(TITLE, f"the process has no {missing}")


def _without_numerator(chain: LagChain, tau_c: float) -> tuple[float, list[float], list[str]]:
    """Cancel numerator time constants by T1 to T3, the longest first: K, lags and what was done."""
    K, lags = chain.K, sorted(chain.lags, reverse=True)
    steps: list[str] = []
    for lead in sorted(chain.leads, reverse=True):
        tau0 = _partner(lead, lags)
        lags.remove(tau0)
        if lead == tau0:
            continue
        factor, left = _cancelled(lead, tau0, tau_c)
        K *= factor
        if left:
            lags = sorted([*lags, left], reverse=True)
        taken = f"{factor:.4g}" + (f"/({left:.4g} s + 1)" if left else "")
        steps.append(f"({lead:g} s + 1)/({tau0:g} s + 1) taken as {taken}")
    return K, lags, steps


def _partner(lead: float, lags: list[float]) -> float:
    """The lag to cancel a lead against: the next longer, or a shorter one that is close."""
    longer = min((lag for lag in lags if lag >= lead), default=None)
    shorter = max((lag for lag in lags if lag < lead), default=None)
    if longer is None and shorter is None:
        raise RuleNotApplicable(
            TITLE, f"no lag is left to cancel the numerator time constant of {lead:g} s against"
        )
    if longer is None:
        assert shorter is not None  # noqa: S101 - one of them is there
        return shorter
    if shorter is not None and lead / shorter < min(CLOSE, longer / lead):
        return shorter
    return longer


def _cancelled(lead: float, tau0: float, tau_c: float) -> tuple[float, float]:
    """(lead s + 1)/(tau0 s + 1) as a factor and the lag that is left, by T1, T1a, T1b, T2 or T3."""
    if lead >= tau0:
        if tau0 >= tau_c:
            return lead / tau0, 0.0  # T1
        return (lead / tau_c, 0.0) if lead >= tau_c else (1.0, 0.0)  # T1a, T1b
    if lead >= FAR * tau_c:
        return lead / tau0, 0.0  # T2
    reach = min(tau0, FAR * tau_c)
    return reach / tau0, reach - lead  # T3
