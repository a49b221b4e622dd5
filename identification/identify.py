"""From a record to a process model with its quality: one straight walk, never an exception."""

from dataclasses import dataclass, replace

import numpy as np

from identification.candidate import Candidate, Choice
from identification.condense import Samples, condense
from identification.data_honesty import judge_data, judge_unit, require_one_unit
from identification.dead_band import DeadBandFit, judge_dead_band
from identification.dead_band_choice import read_process
from identification.disturbances import NEARLY_WHITE, Explanation
from identification.experiment import Experiment, read_experiment
from identification.gains import StepGains, require_one_sign, step_gains
from identification.least_squares import fopdt_least_squares
from identification.parameter_intervals import parameter_intervals
from identification.plausibility import (
    answer_swing,
    require_answer,
    require_cause_first,
    require_unsaturated,
)
from identification.quality import Colour, fit_percent, worst_misfit
from identification.simplification import SimpleProcess, simplified
from identification.spikes import find_spikes
from identification.step_reading import StepReading, read_steps
from identification.structure_verdict import judge_structure
from identification.structures import FIRST_ORDER, LEAD
from identification.timing import judge_timing
from identification.verdict import (
    Finding,
    Verdict,
    judge_dead_time,
    judge_errors,
    judge_gains,
    judge_length,
    judge_misfit,
    judge_rival,
    judge_two_point,
    worst,
)
from loop.errors import LoopError
from loop.process import Process
from loop.record import Record
from loop.signals import Flags, Real

# Longer records are averaged to about as many values, which costs no estimate a digit that its
# error leaves.
MOST_SAMPLES = 20_000
# A residual of a millionth of the answer is arithmetic, and neither white nor coloured.
NO_NOISE = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Identification:
    """What a record says about the process, and how far to believe it.

    Attributes
    ----------
    kind : str
        Type of the model to use, as the name of its class.
    process : FOPDT, SOPDT, IPDT, DoubleIntegrator, PureDelay or None
        Model to use; none where it is refused. Where the record speaks for a structure that no
        tuning rule takes, it is that structure's simplification.
    verdict : Verdict
        What it may be used for.
    reasons : tuple of str
        Why, in words with numbers, the gravest first; never empty.
    rows : int
        Rows of the record.
    samples : int
        Rows used in the fit.
    spikes : int
        Rows left out as single readings far off their neighbours.
    span : float
        Time from the first to the last row. [s]
    longest_gap : float
        Longest time between two rows with both PV and OP, 0 with fewer than two. [s]
    steps : tuple of StepReading
        Moves of the output, each with what PV says about it alone.
    gains : StepGains or None
        Gain of each step; none with a single step or very many.
    fitted : FOPDT, SOPDT, IPDT, DoubleIntegrator, PureDelay or None
        What least squares gave, also where it is refused and must not be used.
    choice : Choice or None
        Structure that the record speaks for, the others that were fitted, and why this one.
    standard_errors : ndarray, shape (p,), or None
        Of the structure's parameters (`choice.chosen.structure.names`), K, tau, theta for one lag,
        widened where the residual is not white.
    correlation : ndarray, shape (p, p), or None
        Of the structure's parameters. [-]
    intervals : ndarray, shape (p, 2), or None
        95 % confidence intervals of the structure's parameters.
    dead_band : DeadBandFit or None
        Play of the valve that the model stands behind; None where the record calls for none.
    pv0 : float or None
        PV at the first sample for the output before the first move. [PV]
    drift, drift_error : float or None
        Slope of PV that is no answer, 0 where none is fitted, and its standard error. [PV/s]
    start : float or None
        How far PV was from rest at the first sample, 0 where none is fitted. [PV]
    fit_percent : float or None
        100 (1 - |residual|/|pv - mean|), no evidence of a good model. [%]
    noise_sd : float or None
        Standard deviation of a reading about the model. [PV]
    colour : Colour or None
        Whiteness of the residual.
    t, pv, predicted, residual : ndarray, shape (n,), or None
        Values fitted, model and difference. [s], [PV]
    weight : ndarray, shape (n,), or None
        Readings behind each value; None for one each. [-]
    """

    kind: str = "FOPDT"
    process: SimpleProcess | None
    verdict: Verdict
    reasons: tuple[str, ...]
    rows: int
    samples: int
    spikes: int
    span: float
    longest_gap: float
    steps: tuple[StepReading, ...] = ()
    gains: StepGains | None = None
    fitted: SimpleProcess | None = None
    choice: Choice | None = None
    standard_errors: Real | None = None
    correlation: Real | None = None
    intervals: Real | None = None
    dead_band: DeadBandFit | None = None
    pv0: float | None = None
    drift: float | None = None
    drift_error: float | None = None
    start: float | None = None
    fit_percent: float | None = None
    noise_sd: float | None = None
    colour: Colour | None = None
    t: Real | None = None
    pv: Real | None = None
    predicted: Real | None = None
    residual: Real | None = None
    weight: Real | None = None

    @property
    def full(self) -> Process | None:
        """Process to verify settings on: with its lead where it has one, else `process`."""
        if self.process is not None and self.structure and self.structure.structure is LEAD:
            return self.structure.process
        return self.process

    @property
    def structure(self) -> Candidate | None:
        """Structure that the record speaks for, None where nothing was fitted."""
        return None if self.choice is None else self.choice.chosen


def identify(record: Record) -> Identification:
    """Fit a process model with dead time to a record and judge it.

    One lag with dead time is fitted first; another structure takes its place where the record
    calls for it (see `identification.candidates`).

    Bad data raise nothing: a refusal is a result with its reasons.

    Parameters
    ----------
    record : Record
        One loop over one stretch of time, with at least one move of OP in manual.

    Examples
    --------
    >>> t = np.arange(0.0, 600.0)
    >>> op = np.where(t < 60, 40.0, 45.0)
    >>> pv = 20 + 10 * np.where(t > 80, 1 - np.exp(-(t - 80) / 50), 0)
    >>> found = identify(Record(t=t, pv=pv, op=op))
    >>> found.verdict.value, round(found.process.K, 3), round(found.process.tau, 3)
    ('trusted', 2.0, 50.0)
    """
    nothing = _data_facts(record)
    try:
        experiment = read_experiment(record)
        require_one_unit(experiment.t, experiment.pv)
        samples, spikes = _without_spikes(experiment)
        reading = read_process(samples, experiment)
    except LoopError as fact:
        return replace(nothing, reasons=(_sentence(str(fact)),))
    explanation, choice = reading.explanation, reading.choice
    described = _described(nothing, samples, explanation, experiment, choice)
    fitted, remark = simplified(choice.chosen)
    described = replace(
        described,
        spikes=spikes,
        dead_band=reading.dead_band if reading.taken else None,
        fitted=fitted,
        kind=described.kind if fitted is None else type(fitted).__name__,
    )
    notes = _notes(described, experiment, explanation, samples)
    try:
        findings = _findings(described, experiment, samples, explanation)
    except LoopError as fact:
        return replace(described, reasons=tuple(map(_sentence, (str(fact), *notes))))
    findings += _of_the_data(record, described, experiment)
    if reading.dead_band is not None:
        findings.append(judge_dead_band(reading.dead_band, taken=reading.taken))
    if fitted is None:
        findings.insert(0, Finding(verdict=Verdict.REFUSED, reason=remark))
    elif remark:
        findings.append(Finding(verdict=Verdict.CARE, reason=remark))
    verdict = worst(findings)
    severity = [Verdict.REFUSED, Verdict.CARE, Verdict.TRUSTED]
    findings.sort(key=lambda finding: severity.index(finding.verdict))
    return replace(
        described,
        process=None if verdict is Verdict.REFUSED else described.fitted,
        verdict=verdict,
        reasons=tuple(map(_sentence, (*(f.reason for f in findings), *notes))),
    )


def _data_facts(record: Record) -> Identification:
    """Refusal with nothing but the facts of the data, to be filled in."""
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


def _without_spikes(experiment: Experiment) -> tuple[Samples, int]:
    """Samples to fit, averaged where there are very many, without single wild readings."""
    instants = experiment.held.instants
    samples = condense(experiment.t, experiment.pv, instants, at_most=MOST_SAMPLES)
    rough = fopdt_least_squares(samples.t, samples.pv, experiment.held, weight=samples.weight)
    residual = experiment.pv - rough.predict(experiment.t)
    spikes: Flags = find_spikes(residual, experiment.pv)
    good = ~spikes
    if np.all(good):
        return samples, 0
    kept = condense(experiment.t[good], experiment.pv[good], instants, at_most=MOST_SAMPLES)
    return kept, int(np.count_nonzero(spikes))


def _described(
    nothing: Identification,
    samples: Samples,
    explanation: Explanation,
    experiment: Experiment,
    choice: Choice,
) -> Identification:
    """All numbers of the fit, without a verdict."""
    fit, chosen = explanation.fit, choice.chosen
    colour = chosen.colour
    sizes = np.where(chosen.standard_errors > 0, chosen.standard_errors, 1.0)
    predicted = chosen.fit.predict(samples.t)
    residual = samples.pv - predicted
    steps = experiment.steps
    weight = samples.weight
    return replace(
        nothing,
        samples=samples.t.size if weight is None else int(weight.sum()),
        steps=read_steps(fit, samples, steps),
        gains=step_gains(fit, samples, steps),
        choice=choice,
        standard_errors=chosen.standard_errors,
        correlation=chosen.covariance / np.outer(sizes, sizes),
        intervals=parameter_intervals(chosen, explanation.rival),
        pv0=fit.pv0,
        drift=fit.drift,
        drift_error=fit.drift_error * colour.inflation**0.5,
        start=fit.start,
        fit_percent=fit_percent(samples.pv, residual, weight),
        noise_sd=chosen.fit.noise_sd,
        colour=colour,
        t=samples.t,
        pv=samples.pv,
        predicted=predicted,
        residual=residual,
        weight=weight,
    )


def _findings(
    described: Identification, experiment: Experiment, samples: Samples, explanation: Explanation
) -> list[Finding]:
    """Everything that speaks for or against the model; facts that forbid it are raised."""
    fit, colour, steps = explanation.fit, explanation.colour, experiment.steps
    choice, intervals = described.choice, described.intervals
    assert choice is not None  # noqa: S101 - whatever is described was chosen
    assert intervals is not None  # noqa: S101 - and has errors
    require_cause_first(fit, colour, samples, experiment.hole_before(steps[0]))
    one_lag = choice.chosen.structure is FIRST_ORDER
    if not choice.chosen.structure.integrates:  # one lag fits an integrator of an integral badly
        require_answer(fit, colour, samples, steps)
    require_unsaturated(fit, samples, steps)
    # One gain for all steps that leaves nothing but noise settles the question of their signs.
    if described.gains is not None and (one_lag or choice.chosen.colour.inflation > NEARLY_WHITE):
        require_one_sign(described.gains, steps)
    if not one_lag:
        return judge_structure(choice, fit, experiment, intervals)
    swing = answer_swing(fit, samples.t)
    misfit = worst_misfit(
        samples.t,
        samples.pv - fit.predict(samples.t),
        noise_sd=fit.noise_sd,
        width=max(fit.tau / 4, 5 * experiment.spacing),
        weight=samples.weight,
    )
    # Waves hold nowhere, and Smith's reading knows nothing of a valve that does not follow.
    one_by_one = not (experiment.waves or described.dead_band)
    findings = [
        *([] if experiment.waves else [judge_length(fit, described.steps, float(samples.t[-1]))]),
        judge_misfit(misfit, swing, steps[0].start),
        *judge_rival(explanation),
        *(judge_two_point(fit, described.steps) if one_by_one else []),
        *judge_timing(fit, experiment),
        judge_errors(fit, intervals),
        judge_dead_time(fit, intervals[2], experiment.spacing),
        Finding(verdict=Verdict.TRUSTED, reason=choice.reason),
    ]
    if described.gains is not None:
        findings += judge_gains(fit, described.gains)
    return findings


def _of_the_data(
    record: Record, described: Identification, experiment: Experiment
) -> list[Finding]:
    """What was done to the readings before they came here."""
    chosen = described.structure
    assert chosen is not None  # noqa: S101 - whatever is judged was fitted
    return [
        *judge_data(
            experiment.t,
            experiment.pv,
            chosen.fit.predict(experiment.t),
            swing=chosen.swing,
            slowness=chosen.slowness,
            noise_sd=chosen.fit.noise_sd,
        ),
        *judge_unit(experiment.pv, record.pv_unit),
    ]


def _notes(
    described: Identification,
    experiment: Experiment,
    explanation: Explanation,
    samples: Samples,
) -> list[str]:
    """What was decided or left out on the way."""
    assert described.choice is not None  # noqa: S101 - whatever is described was chosen
    chosen = described.choice.chosen
    colour = chosen.colour
    notes = [*experiment.notes, *explanation.notes]
    swing = answer_swing(explanation.fit, samples.t)
    if chosen.fit.noise_sd < NO_NOISE * swing:
        notes.append("the record is without noise, the residual is rounding")
    elif colour.white:
        notes.append("the residual is white noise as far as can be seen")
    else:
        notes.append(
            f"the residual is not white (neighbours correlate by {colour.lag1:.2f}), so standard "
            f"errors are widened {colour.inflation**0.5:.2g} times"
        )
    if experiment.stated_before:
        notes.append(
            f"OP before the first row is taken as {experiment.held.levels[0]:.4g}, as stated; PV "
            f"at rest is fitted ({described.pv0:.4g}), no row shows it"
        )
    if described.spikes:
        notes.append(f"{described.spikes} single readings far off their neighbours are left out")
    if samples.weight is not None:
        notes.append(f"{described.samples} samples are averaged to {samples.t.size} values")
    return notes


def _sentence(reason: str) -> str:
    return reason[:1].upper() + reason[1:] + ("" if reason.endswith(".") else ".")
