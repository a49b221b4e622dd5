"""Whether the model of a relay test is fit for tuning, and what it is where K and tau trade off."""

import math
from dataclasses import replace

import numpy as np

from identification.candidate import Candidate
from identification.least_squares import LeastSquaresFit
from identification.quality import Misfit, worst_misfit
from identification.relay import RelayResult
from identification.relay_reading import RelayCycles, folded
from identification.structures import INTEGRATOR
from identification.verdict import WIDE, Finding, Verdict, graded

# Parts of the mean cycle that are looked at for what the model misses.
PARTS = 20
# Cycles that differ by more than this are not all of one process and one load.
UNLIKE = 0.05
# With fewer settled cycles their spread says little.
FEW_CYCLES = 3
CONFIDENT = 1.96


def wave_misfit(cycles: RelayCycles, fit: LeastSquaresFit, relay: RelayResult) -> Misfit:
    """Find what the model misses of the mean cycle.

    Parameters
    ----------
    cycles : RelayCycles
        Cycles of the test.
    fit : LeastSquaresFit
        Fit to the wave.
    relay : RelayResult
        Cycles in numbers.
    """
    phase, inside = folded(cycles)
    order = np.argsort(phase, kind="stable")
    residual = cycles.pv[inside] - fit.predict(cycles.t[inside])
    return worst_misfit(
        phase[order] * relay.Pu,
        residual[order],
        noise_sd=fit.noise_sd,
        width=relay.Pu / PARTS,
    )


def as_integrator(lag: Candidate) -> tuple[Candidate, Finding | None]:
    """Read a slow lag as an integrator where the cycles tell its K/tau and not K and tau.

    Parameters
    ----------
    lag : Candidate
        One lag with dead time, its covariance widened.

    Returns
    -------
    integrator : Candidate
        K/tau and theta with their errors.
    finding : Finding or None
        What that means; None where K/tau is not known within 20 % either.
    """
    K, tau, theta = lag.values.tolist()
    slope = K / tau
    turn = np.array([[1 / tau, -slope / tau, 0.0], [0.0, 0.0, 1.0]])
    covariance = turn @ lag.covariance @ turn.T
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    integrator = replace(
        lag,
        structure=INTEGRATOR,
        values=np.array([slope, theta]),
        standard_errors=errors,
        covariance=covariance,
        free=lag.free - 1,
    )
    width = CONFIDENT * errors
    if width[0] > WIDE * abs(slope):
        return integrator, None
    return integrator, Finding(
        verdict=Verdict.CARE,
        reason=f"the cycles are too short to tell K and tau apart; their ratio K/tau = {slope:.4g} "
        f"is known within ±{100 * width[0] / abs(slope):.2g} % and theta within ±{width[1]:.2g} s "
        "(95 %), so the process is taken for an integrator",
    )


def judge_sign(fit: LeastSquaresFit, relay: RelayResult) -> list[Finding]:
    """Compare the sign of the gain with the direction in which the relay acts.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit to the wave.
    relay : RelayResult
        Cycles.
    """
    if math.copysign(1.0, fit.K) == relay.gain_sign:
        return []
    reason = (
        f"OP goes up where PV is {'low' if relay.gain_sign > 0 else 'high'}, as a relay around a "
        f"process of {'positive' if relay.gain_sign > 0 else 'negative'} gain does, but the wave "
        f"fits a gain of {fit.K:.3g}: OP was not switched by a relay on this PV"
    )
    return [Finding(verdict=Verdict.REFUSED, reason=reason)]


def judge_cycles(relay: RelayResult) -> Finding:
    """Say how much the settled cycles differ.

    Parameters
    ----------
    relay : RelayResult
        Cycles.
    """
    spread = max(relay.period_spread, relay.amplitude_spread)
    verdict = graded(spread, UNLIKE, math.inf)
    text = (
        f"{relay.cycles} settled cycles agree within {100 * relay.period_spread:.2g} % in period "
        f"and {100 * relay.amplitude_spread:.2g} % in swing (standard deviation)"
    )
    if relay.cycles < FEW_CYCLES:
        text += f"; from fewer than {FEW_CYCLES} nobody can tell whether they have settled"
        verdict = Verdict.CARE
    return Finding(verdict=verdict, reason=text)
