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

from identification.held_input import HeldInput
from identification.identify import Identification
from identification.least_squares import LeastSquaresFit, fopdt_least_squares
from identification.plausibility import answer_swing
from identification.quality import fit_percent, residual_colour, worst_misfit
from identification.relay import RelayResult, read_relay
from identification.relay_cycle import invert_biased
from identification.relay_reading import RelayCycles, folded, read_cycles
from identification.relay_ultimate import UltimateEstimate, fitted_ultimate
from identification.spikes import find_spikes
from identification.verdict import (
    Finding,
    Verdict,
    graded,
    judge_dead_time,
    judge_errors,
    judge_misfit,
    worst,
)
from loop.errors import NoLimitCycle
from loop.process import FOPDT
from loop.record import Record
from loop.signals import Flags, Real

# A load between rest and test shows when rest and test disagree so much by chance only once in a
# million tests; with five parameters that either can move.
BY_CHANCE, FREE = 1e-6, 5
# Parts of the mean cycle that are looked at for what the model misses.
PARTS = 20
MOST_MOVES = 2000
# Six parameters and some freedom to see whether they fit.
FEWEST_SAMPLES = 12
# Cycles that differ by more than this are not all of one process and one load.
UNLIKE = 0.05
# With fewer settled cycles their spread says little.
FEW_CYCLES = 3
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
    alone = _with_drift(replace(wave, t=t[inside], pv=pv[inside]), start=True)
    if not shows_rest:
        note = "PV at rest is fitted to the cycles alone: the record does not show the rest before"
        return alone, None, [note, *_drift_note(alone)]
    together = _with_drift(wave, start=False)
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


def _with_drift(wave: _Waveform, *, start: bool) -> LeastSquaresFit:
    """Fit with a drift where one shows."""
    t, pv, held, latest = wave.t, wave.pv, wave.held, wave.latest
    plain = fopdt_least_squares(t, pv, held, start=start, latest=latest)
    drifting = fopdt_least_squares(t, pv, held, start=start, drift=True, latest=latest)
    colour = residual_colour(pv - drifting.predict(t))
    change = abs(drifting.drift) * float(t[-1] - t[0])
    seen = abs(drifting.drift) > SEEN * drifting.drift_error * colour.inflation**0.5
    return drifting if seen and change > SMALLEST * float(np.ptp(pv)) else plain


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
    errors = fit.standard_errors[:3] * colour.inflation**0.5
    width = float(student.ppf(0.975, fit.freedom)) * errors
    estimates = np.array([fit.K, fit.tau, fit.theta])
    intervals = np.stack((estimates - width, estimates + width), axis=1)
    intervals[1:] = np.maximum(intervals[1:], 0.0)
    sizes = fit.standard_errors[:3]
    sizes = np.where(sizes > 0, sizes, 1.0)
    findings = [
        *_judge_sign(fit, relay),
        judge_errors(fit, intervals),
        _judge_wave(cycles, fit, relay),
        _judge_cycles(relay),
        judge_dead_time(fit, intervals[2], record.sample_time),
    ]
    fitted: FOPDT | None = None
    try:
        fitted = FOPDT(K=fit.K, tau=fit.tau, theta=fit.theta)
    except ValueError as fact:
        findings.insert(0, Finding(verdict=Verdict.REFUSED, reason=str(fact)))
    verdict = worst(findings)
    severity = [Verdict.REFUSED, Verdict.CARE, Verdict.TRUSTED]
    findings.sort(key=lambda finding: severity.index(finding.verdict))
    return Identification(
        process=None if verdict is Verdict.REFUSED else fitted,
        verdict=verdict,
        reasons=tuple(map(_sentence, (*(f.reason for f in findings), *notes))),
        rows=len(record),
        samples=t.size,
        spikes=spikes,
        span=record.span,
        longest_gap=float(np.max(np.diff(cycles.t), initial=0.0)),
        fitted=fitted,
        standard_errors=errors,
        correlation=fit.covariance[:3, :3] / np.outer(sizes, sizes),
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


def _judge_sign(fit: LeastSquaresFit, relay: RelayResult) -> list[Finding]:
    """Compare the sign of the gain with the direction in which the relay acts."""
    if math.copysign(1.0, fit.K) == relay.gain_sign:
        return []
    reason = (
        f"OP goes up where PV is {'low' if relay.gain_sign > 0 else 'high'}, as a relay around a "
        f"process of {'positive' if relay.gain_sign > 0 else 'negative'} gain does, but the wave "
        f"fits a gain of {fit.K:.3g}: OP was not switched by a relay on this PV"
    )
    return [Finding(verdict=Verdict.REFUSED, reason=reason)]


def _judge_wave(cycles: RelayCycles, fit: LeastSquaresFit, relay: RelayResult) -> Finding:
    """Look at what the model misses of the mean cycle."""
    phase, inside = folded(cycles)
    order = np.argsort(phase, kind="stable")
    residual = cycles.pv[inside] - fit.predict(cycles.t[inside])
    misfit = worst_misfit(
        phase[order] * relay.Pu,
        residual[order],
        noise_sd=fit.noise_sd,
        width=relay.Pu / PARTS,
    )
    swing = answer_swing(fit, cycles.t[inside])
    return judge_misfit(misfit, max(swing, 1e-300), -math.inf)


def _judge_cycles(relay: RelayResult) -> Finding:
    """Say how much the settled cycles differ."""
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


def _inversion_note(inverted: FOPDT | None) -> list[str]:
    if inverted is None:
        return []
    return [
        "the closed form of the limit cycle gives from the half periods alone "
        f"K {inverted.K:.4g}, tau {inverted.tau:.4g} s, theta {inverted.theta:.4g} s"
    ]


def _sentence(reason: str) -> str:
    return reason[:1].upper() + reason[1:] + ("" if reason.endswith(".") else ".")
