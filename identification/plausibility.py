"""Facts that forbid a model although a fit exists: whether PV's movement is an answer at all."""

import numpy as np

from identification.condense import Samples, condense
from identification.held_input import lag_response
from identification.least_squares import LeastSquaresFit, fopdt_least_squares
from identification.quality import Colour
from identification.steps import Step
from loop.errors import FitNotTrusted, NotSteady, PoorExcitation
from loop.signals import Flags, Real

# An answer under three standard deviations of the noise is within what PV does anyhow.
SMALLEST_ANSWER = 3.0
FEWEST_AT_REST = 5
EITHER = "Either the step is too small for the noise, or it does not reach PV."
# Four standard errors from nothing: one false alarm in 16,000.
CERTAIN = 4.0
# The best of many tau and theta finds an answer of three errors in pure noise.
FOUND = 5.0
# Part of PV's range below which a difference is arithmetic.
ROUNDING = 1e-6
# Bounds the extra fits on very long records.
MOST_SAMPLES = 2000
# A reading repeats at a limit by saturation, not by chance, from five in a row on.
FEWEST_AT_LIMIT, LIMIT_PART = 5, 0.05
# With fewer free readings after the move nothing tells where PV would have gone.
FEWEST_FREE = 8


def answer_swing(fit: LeastSquaresFit, t: Real) -> float:
    """Highest less lowest PV that the model gives without drift and start. [PV]"""
    return abs(fit.K) * float(np.ptp(lag_response(fit.held, t, fit.tau, fit.theta)[0]))


def require_answer(
    fit: LeastSquaresFit, colour: Colour, samples: Samples, steps: tuple[Step, ...]
) -> None:
    """Refuse a record whose PV does not follow the output.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit.
    colour : Colour
        Of its residual.
    samples : Samples
        What was fitted.
    steps : tuple of Step
        Moves of the output.

    Raises
    ------
    PoorExcitation
        The answer is not certain, too small for the noise, or gone again at the end of a record
        over which OP did move.
    """
    swing, noise = answer_swing(fit, samples.t), fit.noise_sd
    size = max((step.size for step in steps), key=abs)
    rounding = ROUNDING * float(np.ptp(samples.pv))
    variance = max(noise**2 * colour.inflation, rounding**2)
    certainty = (max(_squares_without_answer(fit, samples) - fit.sse, 0.0) / variance) ** 0.5
    if certainty < FOUND:
        raise PoorExcitation(
            f"Nothing in PV follows the move of {size:+.4g} in OP: the best answer has a gain of "
            f"{fit.K:.3g} and stands {certainty:.1f} standard errors from none, and {FOUND:g} are "
            "needed to tell it from chance."
        )
    _require_net_change(fit, samples, steps)
    if swing < SMALLEST_ANSWER * noise:
        raise PoorExcitation(
            f"PV hardly follows the move of {size:+.4g} in OP: it answers by {swing:.3g}, "
            f"{swing / noise:.1f} times its noise of {noise:.3g}, and {SMALLEST_ANSWER:g} times "
            f"are needed. {EITHER}"
        )


def _squares_without_answer(fit: LeastSquaresFit, samples: Samples) -> float:
    """Sum of squares that remains without an answer to OP. [PV^2]

    This and not the error of K tells whether there is an answer: where tau is not known K is not
    either, though an answer may be plain to see.
    """
    since = samples.t - fit.t0
    columns: list[Real] = [np.ones_like(since)]
    if fit.drift_fitted:
        columns.append(since)
    if fit.start_fitted:
        columns.append(np.exp(-since / fit.tau))
    root = np.ones_like(since) if samples.weight is None else np.sqrt(samples.weight)
    design, y = np.stack(columns, axis=1) * root[:, None], (samples.pv - fit.pv0) * root
    best, *_ = np.linalg.lstsq(design, y, rcond=None)
    return float(np.sum((y - design @ best) ** 2))


def _require_net_change(fit: LeastSquaresFit, samples: Samples, steps: tuple[Step, ...]) -> None:
    """Compare PV before the first move and at the end, where OP stands elsewhere than before."""
    net = steps[-1].op_to - steps[0].op_from
    largest = max(abs(step.size) for step in steps)
    hold = float(samples.t[-1]) - steps[-1].end
    if abs(net) < largest / 2 or hold < fit.theta + fit.tau:
        return
    since = samples.t - fit.t0
    pv = samples.pv - fit.drift * since - fit.start * np.exp(-since / fit.tau)
    before = samples.t < steps[0].start
    if np.count_nonzero(before) < FEWEST_AT_REST:
        before = np.arange(pv.size) < FEWEST_AT_REST
    end = samples.t > float(samples.t[-1]) - hold / 10
    levels = [float(np.median(pv[part])) for part in (before, end)]
    change = abs(levels[1] - levels[0])
    if change < SMALLEST_ANSWER * fit.noise_sd:
        raise PoorExcitation(
            f"PV hardly follows the move of {net:+.4g} in OP: it stands at {levels[0]:.4g} before "
            f"and at {levels[1]:.4g} in the end, {change / fit.noise_sd:.1f} times its noise of "
            f"{fit.noise_sd:.3g} apart, and {SMALLEST_ANSWER:g} times are needed. {EITHER}"
        )


def require_cause_first(
    fit: LeastSquaresFit, colour: Colour, samples: Samples, hole: float
) -> None:
    """Refuse a record whose PV moves before the output does.

    The fit is repeated with a negative dead time allowed; what counts is how much better it
    follows the samples before the first move.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit.
    colour : Colour
        Of its residual.
    samples : Samples
        What was fitted.
    hole : float
        Time without samples before the one that shows the first move. [s]

    Raises
    ------
    NotSteady
        PV moved before OP, or OP at some time in a hole.
    """
    move = float(fit.held.instants[0])
    before = samples.t < move
    if np.count_nonzero(before) < 3:
        return
    earliest = -0.95 * (move - float(samples.t[0]))
    few = condense(
        samples.t, samples.pv, fit.held.instants, weight=samples.weight, at_most=MOST_SAMPLES
    )
    early = fopdt_least_squares(
        few.t,
        few.pv,
        fit.held,
        weight=few.weight,
        drift=fit.drift_fitted,
        start=fit.start_fitted,
        earliest=earliest,
    )
    weight = np.ones_like(samples.t) if samples.weight is None else samples.weight
    sums = [
        float(weight[before] @ (samples.pv - f.predict(samples.t))[before] ** 2)
        for f in (fit, early)
    ]
    improvement = sums[0] - sums[1]
    needed = CERTAIN**2 * colour.inflation * early.noise_sd**2
    spacing = float(np.median(np.diff(samples.t)))
    if early.theta >= -2 * spacing or improvement < max(needed, 0.5 * sums[0]):
        return
    if -early.theta < hole:
        raise NotSteady(
            f"OP moved somewhere within a gap of {hole:.3g} s before {move:.4g} s, and PV had "
            "already answered when the samples go on: the dead time cannot be told."
        )
    raise NotSteady(
        f"PV moved before OP did: it fits best as an answer {-early.theta:.3g} s ahead of the "
        f"first move at {move:.4g} s. Something else moved PV, or the time stamps of PV and OP "
        "do not belong together."
    )


def require_unsaturated(fit: LeastSquaresFit, samples: Samples, steps: tuple[Step, ...]) -> None:
    """Refuse a record whose PV stands at a limit that the answer would have passed.

    Readings that repeat the highest or lowest value are left out and the model fitted to the rest
    tells where PV would have gone.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit.
    samples : Samples
        What was fitted.
    steps : tuple of Step
        Moves of the output.

    Raises
    ------
    FitNotTrusted
        PV is cut off.
    """
    after = samples.t > steps[0].start
    for limit, sign in ((float(samples.pv.max()), 1.0), (float(samples.pv.min()), -1.0)):
        at_limit = (samples.pv == limit) & after
        if _longest_run(at_limit) < FEWEST_AT_LIMIT:
            continue
        rest = ~at_limit
        # Where nothing else moves, as after a jump without noise, nothing tells either.
        if np.count_nonzero(rest & after) < FEWEST_FREE or np.ptp(samples.pv[rest]) == 0:
            continue
        free = _refit(fit, samples, rest)
        beyond = float(np.max(sign * (free.predict(samples.t[at_limit]) - limit)))
        if beyond > max(3 * free.noise_sd, LIMIT_PART * answer_swing(free, samples.t)):
            raise FitNotTrusted(
                f"PV is saturated: it stands at exactly {limit:.4g} for "
                f"{np.count_nonzero(at_limit)} samples, and the rest of the record would take it "
                f"to {limit + sign * beyond:.4g}. Widen the range or make a smaller move."
            )


def _longest_run(flags: Flags) -> int:
    edges = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _refit(fit: LeastSquaresFit, samples: Samples, kept: Flags) -> LeastSquaresFit:
    return fopdt_least_squares(
        samples.t[kept],
        samples.pv[kept],
        fit.held,
        weight=None if samples.weight is None else samples.weight[kept],
        drift=fit.drift_fitted,
        start=fit.start_fitted,
    )
