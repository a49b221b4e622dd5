"""First order plus dead time from the recorded waveform of a relay test.

Noise makes a relay switch early and quantisation late, so that no half period is the one of the
closed form. The switching that was recorded is known exactly all the same: it is taken as the
input, and PV over all settled cycles is fitted by least squares of the simulation error. Half
periods, put through the closed form, are a check on it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from identification.candidate import Candidate, Choice
from identification.held_input import HeldInput
from identification.identify import Identification
from identification.least_squares import LeastSquaresFit, fopdt_least_squares
from identification.plausibility import answer_swing
from identification.quality import Colour, Misfit, fit_percent, residual_colour
from identification.relay import RelayResult, read_relay
from identification.relay_cycle import invert_biased
from identification.relay_reading import RelayCycles, read_cycles
from identification.relay_ultimate import UltimateEstimate, fitted_ultimate
from identification.relay_verdict import as_integrator, judge_cycles, judge_sign, wave_misfit
from identification.spikes import find_spikes
from identification.structures import FIRST_ORDER
from identification.verdict import (
    Finding,
    Verdict,
    judge_dead_time,
    judge_errors,
    judge_misfit,
    worst,
)
from loop.errors import NoLimitCycle
from loop.process import FOPDT, IPDT
from loop.record import Record
from loop.signals import Flags, Real

# A load between rest and test shows when rest and test disagree so much by chance only once in a
# million tests; with five parameters that either can move.
BY_CHANCE, FREE = 1e-6, 5
MOST_MOVES = 2000
SMALLEST_SWING = 1e-300
# Six parameters and some freedom to see whether they fit.
FEWEST_SAMPLES = 12
# A drift shows from three standard errors and this part of the swing on.
SEEN, SMALLEST = 3.0, 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelayModel:
    """What a relay test says of the process.

    Attributes
    ----------
    relay : RelayResult
        Ultimate point by describing function, and the cycles.
    model : Identification
        Model fitted to the waveform, with errors and verdict.
    load : float or None
        Load during the test as a change of OP, where the record shows the rest before it. [OP]
    ultimate : UltimateEstimate or None
        Exact ultimate point of the model, where there is one.
    inverted : FOPDT or None
        Model by the closed form from the half periods, where the relay is biased.
    """

    relay: RelayResult
    model: Identification
    load: float | None
    ultimate: UltimateEstimate | None
    inverted: FOPDT | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Waveform:
    """Samples at rest and in the settled cycles, and the output that led to them."""

    t: Real
    pv: Real
    settled: Flags
    held: HeldInput
    latest: float


def relay_model(record: Record, *, hysteresis: float = 0.0) -> RelayModel:
    """Fit first order plus dead time to the settled cycles of a relay test and judge the model.

    pv(t) = pv0 + start e^(-(t - t0)/tau) + K x(t; tau, theta), with x the exact answer of the lag
    to the switching as it was recorded. Where the record shows the rest before the test, pv0 is
    the PV at rest, which with a biased relay gives K; where a load has come since, and where the
    rest is not shown, pv0 is fitted to the cycles alone and K comes from the shape of the wave.

    Parameters
    ----------
    record : Record
        Relay test: OP switches between two levels.
    hysteresis : float
        Half-width of the relay's hysteresis; the model does not rest on it. [PV]

    Raises
    ------
    NoLimitCycle
        OP does not switch between two levels, chatters, or the cycles have not settled or hold
        too few samples.
    """
    cycles = read_cycles(record)
    relay = read_relay(cycles, hysteresis=hysteresis)
    inverted = _inverted(relay)
    # PV answers a switch before the relay can see it and switch again; a whole period more would
    # fit as well.
    latest = max(relay.high_time, relay.low_time)
    wave = _waveform(cycles, latest)
    shows_rest = bool(cycles.t[cycles.rest].size)
    fit, load, notes = _fitted(wave, shows_rest=shows_rest)
    kept, spikes = _without_spikes(wave, fit)
    if spikes:
        wave = kept
        fit, load, notes = _fitted(wave, shows_rest=shows_rest)
        notes.append(f"{spikes} single readings far off their neighbours are left out")
    notes += [*_inversion_note(inverted), *relay.remarks]
    model = _judged(record, cycles, relay, wave, fit, notes, spikes)
    return RelayModel(
        relay=relay, model=model, load=load, ultimate=_ultimate(model), inverted=inverted
    )


def _ultimate(model: Identification) -> UltimateEstimate | None:
    """Exact ultimate point of a model that may be used, with its errors."""
    process, errors, correlation = model.process, model.standard_errors, model.correlation
    if not isinstance(process, FOPDT) or errors is None or correlation is None:
        return None
    return fitted_ultimate(process, correlation * np.outer(errors, errors))


def _inverted(relay: RelayResult) -> FOPDT | None:
    """Put the half periods through the closed form, where they and K are known."""
    if relay.K is None or relay.bias is None:
        return None
    try:
        return invert_biased(
            K=relay.K,
            amplitude=relay.relay_amplitude,
            bias=relay.bias,
            hysteresis=relay.hysteresis,
            high_time=relay.high_time,
            low_time=relay.low_time,
        )
    except (NoLimitCycle, ValueError):
        return None


def _waveform(cycles: RelayCycles, latest: float) -> _Waveform:
    """Leave out the transient cycles and single wild readings; keep all that OP did."""
    first, last = int(cycles.used[0]), int(cycles.used[-1])
    start = 0 if cycles.rest.stop else cycles.first_switch
    t, op = cycles.t[start : last + 1], cycles.op[start : last + 1]
    moves = np.flatnonzero(np.diff(op)) + 1
    if moves.size <= MOST_MOVES:
        held = HeldInput.from_samples(t, op)
    else:
        edges = np.unique(np.append(cycles.first_switch, cycles.switches)) - start
        held = HeldInput.from_holds(t, op, edges[(edges > 0) & (edges < t.size)])
    index = np.arange(cycles.t.size)
    settled = (index >= first) & (index <= last)
    used = settled.copy()
    used[cycles.rest] = True
    if np.count_nonzero(settled) < FEWEST_SAMPLES:
        raise NoLimitCycle(
            f"Only {np.count_nonzero(settled)} samples lie in the settled cycles; a model with its "
            f"errors needs at least {FEWEST_SAMPLES}."
        )
    return _Waveform(
        t=cycles.t[used], pv=cycles.pv[used], settled=settled[used], held=held, latest=latest
    )


def _without_spikes(wave: _Waveform, fit: LeastSquaresFit) -> tuple[_Waveform, int]:
    """Leave out single readings far off their neighbours."""
    spikes = find_spikes(wave.pv - fit.predict(wave.t), wave.pv)
    good = ~spikes
    kept = replace(wave, t=wave.t[good], pv=wave.pv[good], settled=wave.settled[good])
    return kept, int(np.count_nonzero(spikes))


def _fitted(
    wave: _Waveform, *, shows_rest: bool
) -> tuple[LeastSquaresFit, float | None, list[str]]:
    """Fit rest and cycles together, or the cycles alone where a load came in between."""
    t, pv, inside = wave.t, wave.pv, wave.settled
    alone, begin = _with_drift(replace(wave, t=t[inside], pv=pv[inside]), start=True)
    if not shows_rest:
        note = "PV at rest is fitted to the cycles alone: the record does not show the rest before"
        return alone, None, [note, *_drift_note(alone)]
    together, _ = _with_drift(wave, start=False, begin=begin)
    residual = pv[inside] - together.predict(t[inside])
    colour = residual_colour(pv[inside] - alone.predict(t[inside]))
    excess = float(residual @ residual) - alone.sse
    if excess <= chi2.isf(BY_CHANCE, FREE) * alone.noise_sd**2 * colour.inflation:
        return together, 0.0, _drift_note(together)
    load = (alone.pv0 - together.pv0) / alone.K if alone.K else 0.0
    return (
        alone,
        load,
        [
            f"a load like {load:+.3g} of OP came between the rest and the settled cycles; PV at "
            "rest is therefore fitted to the cycles alone, and K rests on the shape of the wave",
            *_drift_note(alone),
        ],
    )


def _with_drift(
    wave: _Waveform, *, start: bool, begin: tuple[float, float] | None = None
) -> tuple[LeastSquaresFit, tuple[float, float]]:
    """Fit with a drift where one shows; also tau and theta, from which a like fit may begin.

    The drift is fitted first: where there is none the fit without begins well from there, and
    where there is one nothing depends on the fit without.
    """
    t, pv, held, latest = wave.t, wave.pv, wave.held, wave.latest
    drifting = fopdt_least_squares(t, pv, held, start=start, drift=True, latest=latest, begin=begin)
    reached = drifting.tau, drifting.theta
    plain = fopdt_least_squares(t, pv, held, start=start, latest=latest, begin=begin or reached)
    colour = residual_colour(pv - drifting.predict(t))
    change = abs(drifting.drift) * float(t[-1] - t[0])
    seen = abs(drifting.drift) > SEEN * drifting.drift_error * colour.inflation**0.5
    chosen = drifting if seen and change > SMALLEST * float(np.ptp(pv)) else plain
    return chosen, reached


def _drift_note(fit: LeastSquaresFit) -> list[str]:
    return [f"a drift of {fit.drift:.3g} per s is fitted"] if fit.drift_fitted else []


def _judged(
    record: Record,
    cycles: RelayCycles,
    relay: RelayResult,
    wave: _Waveform,
    fit: LeastSquaresFit,
    notes: list[str],
    spikes: int,
) -> Identification:
    t, pv = wave.t, wave.pv
    predicted = fit.predict(t)
    residual = pv - predicted
    colour = residual_colour(residual[wave.settled])
    misfit = wave_misfit(cycles, fit, relay)
    swing = max(answer_swing(fit, t[wave.settled]), SMALLEST_SWING)
    lag = _candidate(fit, colour, misfit, swing)
    chosen = lag
    errors = judge_errors(fit, _intervals(lag, fit.freedom))
    if errors.verdict is Verdict.REFUSED:
        integrator, in_its_stead = as_integrator(lag)
        if in_its_stead is not None:
            chosen, errors = integrator, in_its_stead
    intervals = _intervals(chosen, fit.freedom)
    findings = [
        *judge_sign(fit, relay),
        errors,
        judge_misfit(misfit, swing, -math.inf),
        judge_cycles(relay),
        judge_dead_time(fit, intervals[-1], record.sample_time),
    ]
    fitted = chosen.process
    if not isinstance(fitted, FOPDT | IPDT):
        fitted = None
        reason = (
            f"the fit is no process: K {fit.K:.3g}, tau {fit.tau:.3g} s, theta {fit.theta:.3g} s"
        )
        findings.insert(0, Finding(verdict=Verdict.REFUSED, reason=reason))
    verdict = worst(findings)
    severity = [Verdict.REFUSED, Verdict.CARE, Verdict.TRUSTED]
    findings.sort(key=lambda finding: severity.index(finding.verdict))
    sizes = np.where(chosen.standard_errors > 0, chosen.standard_errors, 1.0)
    return Identification(
        kind="FOPDT" if fitted is None else type(fitted).__name__,
        process=None if verdict is Verdict.REFUSED else fitted,
        verdict=verdict,
        reasons=tuple(map(_sentence, (*(f.reason for f in findings), *notes))),
        rows=len(record),
        samples=t.size,
        spikes=spikes,
        span=record.span,
        longest_gap=float(np.max(np.diff(cycles.t), initial=0.0)),
        fitted=fitted,
        choice=Choice(chosen=chosen, candidates=(chosen,), reason="the wave of a relay test"),
        standard_errors=chosen.standard_errors,
        correlation=chosen.covariance / np.outer(sizes, sizes),
        intervals=intervals,
        pv0=fit.pv0,
        drift=fit.drift,
        drift_error=fit.drift_error * colour.inflation**0.5,
        start=fit.start,
        fit_percent=fit_percent(pv, residual),
        noise_sd=fit.noise_sd,
        colour=colour,
        t=t,
        pv=pv,
        predicted=predicted,
        residual=residual,
    )


def _candidate(fit: LeastSquaresFit, colour: Colour, misfit: Misfit, swing: float) -> Candidate:
    """The one lag that was fitted, with errors widened by the residual's colour."""
    covariance = fit.covariance[:3, :3] * colour.inflation
    return Candidate(
        structure=FIRST_ORDER,
        fit=fit,
        values=np.array([fit.K, fit.tau, fit.theta]),
        standard_errors=np.sqrt(np.maximum(np.diag(covariance), 0.0)),
        covariance=covariance,
        free=4 + fit.drift_fitted + fit.start_fitted,
        bic=0.0,
        misfit=misfit,
        part=misfit.size / swing,
        swing=swing,
        colour=colour,
    )


def _intervals(candidate: Candidate, freedom: int) -> Real:
    """95 % confidence intervals; what is no gain stays positive."""
    width = float(student.ppf(0.975, freedom)) * candidate.standard_errors
    intervals = np.stack((candidate.values - width, candidate.values + width), axis=1)
    intervals[1:] = np.maximum(intervals[1:], 0.0)
    return intervals


def _inversion_note(inverted: FOPDT | None) -> list[str]:
    if inverted is None:
        return []
    return [
        "the closed form of the limit cycle gives from the half periods alone "
        f"K {inverted.K:.4g}, tau {inverted.tau:.4g} s, theta {inverted.theta:.4g} s"
    ]


def _sentence(reason: str) -> str:
    return reason[:1].upper() + reason[1:] + ("" if reason.endswith(".") else ".")
