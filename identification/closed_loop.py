"""From routine data of a loop in automatic to a process model with its quality.

The recorded output is the input of the model: it is what the process got, at its limits too, and
whatever the mode was. What the data must bring is a cause from outside, found by
`informative_segments`; what makes the fit right although the output answers the disturbances is
the whitening of `prediction_error`. The tests here ask whether that worked.
"""

from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from identification.even_record import EvenRecord, even_record
from identification.identify import Identification
from identification.informative_segments import Excitation, SegmentSearch, find_segments
from identification.innovation_tests import Crossing, output_crossing, set_point_crossing
from identification.prediction_error import PredictionErrorFit, prediction_error_fit
from identification.quality import Colour, fit_percent, residual_colour
from identification.verdict import (
    FAR_OFF,
    TOO_FAR_OFF,
    TOO_WIDE,
    WIDE,
    Finding,
    Verdict,
    graded,
    worst,
)
from loop.errors import LoopError, PoorExcitation
from loop.process import FOPDT
from loop.record import Mode, Record
from loop.signals import Real

# Longest dead time and slowest lag looked for, in the longest segment.
LATEST, SLOWEST = 0.25, 3.0
# Rows of output before a segment that are looked back at.
LEAD = 300
# Correlations beyond so many standard errors are no chance among some dozen of them.
SEEN, CERTAIN = 4.0, 6.0
# Spacing of the samples against tau + theta: the output is only known at samples.
COARSE, TOO_COARSE = 0.1, 0.35
# Stated errors do not cover the error of one lag for several, which in a loop with little noise was
# up to four times as large: a fifth takes the place of the half that tuning is verified for.
UNSURE = 0.1
# What the answer to somebody's moves must be, against what PV does by itself.
WEAK = 3.0


def is_routine(record: Record) -> bool:
    """Whether a record shows a controller at work, so that `identify_routine` may be asked.

    Parameters
    ----------
    record : Record
        One loop over one stretch of time.
    """
    if record.mode is None:
        return record.sp is not None
    return bool(np.any(np.isin(record.mode, (Mode.AUTO, Mode.CAS, Mode.REMOTE))))


def identify_routine(record: Record) -> Identification:
    """Fit first order plus dead time to routine data and judge the model.

    Bad data raise nothing: a refusal is a result with its reasons.

    Parameters
    ----------
    record : Record
        SP, PV, OP and, where there is one, MODE of one loop, evenly sampled.

    Examples
    --------
    >>> from loop.controller import PID
    >>> from loop.experiment import Step
    >>> from loop.simulation import simulate
    >>> run = simulate(
    ...     FOPDT(K=2.0, tau=60.0, theta=10.0), PID(Kc=1.0, Ti=60.0), t_end=1500.0, dt=1.0,
    ...     sp=Step(size=5.0, at=300.0), noise=0.1, rng=np.random.default_rng(1),
    ... )
    >>> found = identify_routine(Record(t=run.t, sp=run.sp, pv=run.pv, op=run.op))
    >>> round(found.process.K, 1), round(found.process.tau), round(found.process.theta)
    (2.0, 60, 10)
    """
    nothing = _data_facts(record)
    try:
        even = even_record(record)
        search = find_segments(even)
        fit = _fitted(even, search)
    except LoopError as fact:
        return replace(nothing, reasons=(_sentence(str(fact)),))
    colour = residual_colour(np.concatenate(fit.innovations))
    intervals, described = _described(nothing, even, search, fit, colour)
    try:
        described = replace(described, fitted=FOPDT(K=fit.K, tau=fit.tau, theta=fit.theta))
    except ValueError as fact:
        return replace(described, reasons=(_sentence(str(fact)),))
    findings = [
        _judge_errors(fit, intervals),
        _judge_dead_time(fit, intervals[2], even.dt),
        _judge_sampling(fit, even.dt),
        _judge_bounds(fit),
        *_judge_rivals(fit),
        _judge_answer(fit, search),
        _judge_set_point(set_point_crossing(fit, even, search)),
        _judge_output(output_crossing(fit)),
        _judge_colour(colour),
    ]
    verdict = worst(findings)
    severity = [Verdict.REFUSED, Verdict.CARE, Verdict.TRUSTED]
    findings.sort(key=lambda finding: severity.index(finding.verdict))
    return replace(
        described,
        process=None if verdict is Verdict.REFUSED else described.fitted,
        verdict=verdict,
        reasons=tuple(map(_sentence, (*(f.reason for f in findings), _used(even, search)))),
    )


def _data_facts(record: Record) -> Identification:
    known = record.t[np.isfinite(record.pv) & np.isfinite(record.op)]
    return Identification(
        process=None,
        verdict=Verdict.REFUSED,
        reasons=(),
        rows=len(record),
        samples=0,
        spikes=0,
        span=record.span,
        longest_gap=float(np.max(np.diff(known), initial=0.0)),
    )


def _fitted(even: EvenRecord, search: SegmentSearch) -> PredictionErrorFit:
    stretches = tuple(even.stretch(s.first, s.last, LEAD) for s in search.segments)
    if all(np.ptp(s.pv) == 0 for s in stretches):
        raise PoorExcitation(f"PV stands at {stretches[0].pv[0]:.4g} in every segment.")
    if all(np.ptp(s.op) == 0 for s in stretches):
        raise PoorExcitation(f"OP stands at {stretches[0].op[0]:.4g} in every segment.")
    longest = max(s.pv.size for s in stretches) * even.dt
    return prediction_error_fit(
        stretches, even.dt, slowest=SLOWEST * longest, latest=LATEST * longest
    )


def _described(
    nothing: Identification,
    even: EvenRecord,
    search: SegmentSearch,
    fit: PredictionErrorFit,
    colour: Colour,
) -> tuple[Real, Identification]:
    """Confidence intervals and all numbers of the fit, without a verdict."""
    covariance = fit.covariance * colour.inflation
    errors = np.sqrt(np.diag(covariance))
    width = float(student.ppf(0.975, fit.freedom)) * errors
    estimates = np.array([fit.K, fit.tau, fit.theta])
    intervals = np.stack((estimates - width, estimates + width), axis=1)
    intervals[1:] = np.maximum(intervals[1:], 0.0)
    sizes = np.where(errors > 0, errors, 1.0)
    pv = np.concatenate([s.pv for s in fit.stretches])
    predicted = np.concatenate(fit.predicted)
    middle = (fit.by - 1) / 2 * even.dt
    t = np.concatenate(
        [
            even.time(segment.first) + middle + fit.dt * np.arange(s.pv.size)
            for segment, s in zip(search.segments, fit.stretches, strict=True)
        ]
    )
    return intervals, replace(
        nothing,
        samples=fit.by * pv.size,
        standard_errors=errors,
        correlation=covariance / np.outer(sizes, sizes),
        intervals=intervals,
        fit_percent=fit_percent(pv, pv - predicted),
        noise_sd=fit.innovation_sd,
        colour=colour,
        t=t,
        pv=pv,
        predicted=predicted,
        residual=pv - predicted,
    )


def _judge_errors(fit: PredictionErrorFit, intervals: Real) -> Finding:
    """Hold the 95 % intervals against a part of the ±50 % that tuning is verified for."""
    half = np.diff(intervals, axis=1)[:, 0] / 2
    estimates = np.array([fit.K, fit.tau, fit.theta])
    upper = intervals[:, 1] - estimates
    sizes = np.array([abs(fit.K), fit.tau, fit.theta + fit.tau])
    relative = np.maximum(half, upper) / sizes
    verdict = graded(float(relative.max()), UNSURE, WIDE)
    if relative.max() > 1:
        text = "K, tau and theta are not determined by the record, their errors exceed themselves"
        return Finding(verdict=verdict, reason=text)
    text = (
        f"K is known within ±{relative[0]:.0%}, tau within ±{relative[1]:.0%} and theta within "
        f"±{upper[2]:.2g} s (95 %)"
    )
    if verdict is Verdict.REFUSED:
        text += (
            f"; beyond ±{WIDE:.0%} routine data are no longer trusted, since the errors do not "
            "cover what one lag leaves out. More or larger set-point moves, or an output step in "
            "manual, would narrow that"
        )
    return Finding(verdict=verdict, reason=text)


def _judge_dead_time(fit: PredictionErrorFit, interval: Real, dt: float) -> Finding:
    upper = float(interval[1])
    text = f"the dead time of {fit.theta:.3g} s is no longer than {upper:.3g} s (95 %)"
    if fit.theta < dt or upper - fit.theta > TOO_WIDE * fit.theta:
        return Finding(
            verdict=Verdict.CARE,
            reason=f"{text}, more than +50 % or one sample, so choose tau_c no smaller than that",
        )
    return Finding(verdict=Verdict.TRUSTED, reason=text)


def _judge_sampling(fit: PredictionErrorFit, dt: float) -> Finding:
    part = dt / (fit.tau + fit.theta)
    text = (
        f"samples every {dt:.3g} s, between which the output is not known, stand against "
        f"tau + theta = {fit.tau + fit.theta:.3g} s"
    )
    return Finding(verdict=graded(part, COARSE, TOO_COARSE), reason=text)


def _judge_bounds(fit: PredictionErrorFit) -> Finding:
    longest = max(s.pv.size for s in fit.stretches) * fit.dt
    if fit.theta > 0.98 * LATEST * longest:
        text = f"the best dead time, {fit.theta:.3g} s, is the longest that was looked for"
        return Finding(verdict=Verdict.REFUSED, reason=text)
    part = fit.tau / longest
    text = f"tau = {fit.tau:.3g} s stands against {longest:.3g} s of the longest segment"
    return Finding(verdict=graded(part, 0.5, 2.0), reason=text)


def _judge_rivals(fit: PredictionErrorFit) -> list[Finding]:
    """Name other processes that the record hardly tells from the best one."""
    if not fit.rivals:
        return []
    rival = min(fit.rivals, key=lambda r: r.worse)
    text = (
        f"the record does not tell K {fit.K:.3g}, tau {fit.tau:.3g} s, theta {fit.theta:.3g} s "
        f"from K {rival.K:.3g}, tau {rival.tau:.3g} s, theta {rival.theta:.3g} s; one more "
        "set-point move, or an output step in manual, would"
    )
    return [Finding(verdict=Verdict.REFUSED, reason=text)]


def _judge_answer(fit: PredictionErrorFit, search: SegmentSearch) -> Finding:
    """Compare what the model explains with what it leaves."""
    largest = max(
        (abs(m.size) for m in search.moves if m.kind is not Excitation.OUTPUT), default=0.0
    )
    left = float(np.std(np.concatenate(fit.innovations)))
    explained = float(np.std(np.concatenate(fit.predicted)))
    ratio = explained / left if left > 0 else np.inf
    text = (
        f"the model's answer has {ratio:.3g} times the standard deviation of what nothing foretells"
    )
    if largest:
        text += f"; the largest move is {largest / max(search.wander, 1e-300):.3g} times the wander"
    return Finding(verdict=Verdict.CARE if ratio < WEAK else Verdict.TRUSTED, reason=text)


def _judge_set_point(crossing: Crossing) -> Finding:
    """Ask whether the model answers the set point's moves as PV did, beyond chance and in size."""
    if abs(crossing.worst) <= SEEN:
        return Finding(
            verdict=Verdict.TRUSTED,
            reason="what nothing foretells does not follow the set point's moves (at most "
            f"{abs(crossing.worst):.2g} standard errors over {crossing.lags} lags)",
        )
    text = (
        f"what nothing foretells follows the set point's moves ({crossing.worst:+.2g} standard "
        f"errors at {crossing.lag:.3g} s), and the model is off by {crossing.part:.1%} of a move "
        "after it; the process is not quite first order"
    )
    return Finding(verdict=graded(crossing.part, FAR_OFF, TOO_FAR_OFF), reason=text)


def _judge_output(crossing: Crossing) -> Finding:
    text = (
        "what nothing foretells follows the output's earlier moves by "
        f"{abs(crossing.worst):.2g} standard errors at most over {crossing.lags} lags"
    )
    seen = abs(crossing.worst) > CERTAIN
    return Finding(verdict=Verdict.CARE if seen else Verdict.TRUSTED, reason=text)


def _judge_colour(colour: Colour) -> Finding:
    if colour.white:
        text = "what the model and its noise model leave is white as far as can be seen"
        return Finding(verdict=Verdict.TRUSTED, reason=text)
    return Finding(
        verdict=Verdict.CARE if abs(colour.lag1) > 0.1 else Verdict.TRUSTED,
        reason=f"what the noise model leaves is not white (neighbours correlate by "
        f"{colour.lag1:.2f}), errors are widened {colour.inflation**0.5:.2g} times",
    )


def _used(even: EvenRecord, search: SegmentSearch) -> str:
    rows = sum(s.last - s.first for s in search.segments)
    kinds = {kind: sum(m.kind is kind for m in search.moves) for kind in Excitation}
    moves = ", ".join(f"{count} {kind.value}" for kind, count in kinds.items() if count)
    return (
        f"fitted in closed loop, the recorded output as input, to {rows} of {even.rows} rows in "
        f"{len(search.segments)} segments ({moves}; {search.small} smaller ones left out)"
    )


def _sentence(reason: str) -> str:
    return reason[:1].upper() + reason[1:] + ("" if reason.endswith(".") else ".")
