"""The dead band of a valve, fitted with the model: output that is lost whenever it turns.

A valve with play does not follow the first part of a move that reverses the one before. The model
then sees a gain that is too small, the more so the smaller the moves. What tells the two apart is
that moves which go on in the same direction, or are larger, are answered in full.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from identification.condense import Samples, condense
from identification.held_input import HeldInput, lag_response
from identification.least_squares import LeastSquaresFit
from identification.quality import residual_colour
from identification.verdict import Finding, Verdict, graded
from loop.signals import Real
from loop.valve import DeadBand

# Values for each move that the search works on, and in all; moves beyond which it takes too long.
VALUES, MOST_VALUES, MOST_MOVES = 150, 1200, 400
# Reversing moves whose sizes differ by less all lose the same part, as a smaller gain would.
UNEQUAL = 0.2
# Starts: parts of the usual move, and of the play that the first move finds.
WIDTHS, FIRST = (0.05, 0.2, 0.5), (0.0, 0.5, 1.0)
# Standard errors from nothing: one false alarm in 16,000.
CERTAIN = 4.0
# Against the largest move: from a twentieth on it is worth care, from a half on nothing is linear.
MATTERS, TOO_WIDE = 0.05, 0.5
DELTA = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DeadBandFit:
    """A dead band with the first-order model that goes with it.

    Attributes
    ----------
    width, error : float
        What a reversing output loses, and its standard error. [OP]
    first : float
        Part of it that the first move lost, 0 to 1: where the valve stood before. [-]
    stem : HeldInput
        Position of the valve, as far as it moves PV, held between the moves of the output. [OP]
    covariance : ndarray, shape (3, 3)
        Of K, tau and theta with width and first part free, widened by the residual's colour.
    largest : float
        Largest move of the output. [OP]
    """

    width: float
    error: float
    first: float
    stem: HeldInput
    covariance: Real
    largest: float

    @property
    def certain(self) -> bool:
        """Whether there is a dead band beyond chance."""
        return self.width > CERTAIN * self.error

    @property
    def upper(self) -> float:
        """Largest width that the record allows (95 %). [OP]"""
        return self.width + 1.96 * self.error


def tells_dead_band(held: HeldInput) -> bool:
    """Whether the moves of an output can tell a dead band from a smaller gain.

    At least one move has to reverse, and after the first one either a move goes on in the direction
    of the one before, or reversing moves differ in size.

    Parameters
    ----------
    held : HeldInput
        Output.
    """
    jumps = np.diff(held.levels)
    jumps = jumps[jumps != 0]
    if not 3 <= jumps.size <= MOST_MOVES:
        return False
    turned = np.sign(jumps[1:]) != np.sign(jumps[:-1])
    sizes = np.abs(jumps[1:])[turned]
    if not sizes.size:
        return False
    return not np.all(turned) or bool(np.ptp(sizes) > UNEQUAL * float(np.max(sizes)))


def stem_of(held: HeldInput, width: float, first: float) -> HeldInput:
    """Position of a valve with play under a held output.

    Parameters
    ----------
    held : HeldInput
        Output.
    width : float
        Dead band. [OP]
    first : float
        Part of the play that the first move has to take up. [-]
    """
    levels = held.levels.tolist()
    jumps = [b - levels[0] for b in levels[1:] if b != levels[0]]
    sign = 1.0 if not jumps or jumps[0] > 0 else -1.0
    position = levels[0] - sign * width * (0.5 - first)
    move = DeadBand(width=width).one_stem(levels[0], position)
    return HeldInput(
        instants=held.instants, levels=np.array([position, *(move(level) for level in levels[1:])])
    )


def fit_dead_band(samples: Samples, fit: LeastSquaresFit) -> DeadBandFit | None:
    """Fit a first-order model and a dead band together.

    Parameters
    ----------
    samples : Samples
        Process values.
    fit : LeastSquaresFit
        First-order fit without a dead band.

    Returns
    -------
    DeadBandFit or None
        None where the moves cannot tell a dead band.
    """
    held = fit.held
    if not tells_dead_band(held):
        return None
    few = condense(
        samples.t,
        samples.pv,
        held.instants,
        weight=samples.weight,
        at_most=min(VALUES * (held.moves + 1), MOST_VALUES),
    )
    jumps = np.abs(np.diff(held.levels))
    search = _Search(few, fit, float(np.max(jumps)))
    usual = float(np.median(jumps[jumps > 0])) / search.largest
    starts = [search.start(usual * width, first) for width in WIDTHS for first in FIRST]
    best = min(starts, key=lambda point: float(np.sum(search.residual(point) ** 2)))
    found = least_squares(
        search.residual, best, bounds=(search.low, search.high), x_scale="jac", max_nfev=60
    )
    return search.result(np.asarray(found.x))


class _Search:
    """ln tau, theta over its scale, the width over the largest move, and the first part of it."""

    def __init__(self, few: Samples, fit: LeastSquaresFit, largest: float) -> None:
        self.few, self.fit, self.largest = few, fit, largest
        self.root = np.ones_like(few.t) if few.weight is None else np.sqrt(few.weight)
        self.y = (few.pv - few.pv[0]) * self.root
        span = float(few.t[-1] - few.t[0])
        self.scale = fit.tau + fit.theta
        self.low = np.array([np.log(1e-3 * self.scale), 0.0, 0.0, 0.0])
        latest = max(span - float(fit.held.instants[0] - few.t[0]), self.scale)
        self.high = np.array([np.log(10 * max(span, fit.tau)), latest / self.scale, 0.98, 1.0])

    def start(self, width: float, first: float) -> Real:
        point = np.array([np.log(self.fit.tau), self.fit.theta / self.scale, width, first])
        return np.asarray(np.clip(point, self.low + 1e-6, self.high - 1e-6))

    def columns(self, point: Real) -> Real:
        """What is linear: the answer of the valve's position, rest, and what else was fitted."""
        tau, theta = float(np.exp(point[0])), float(point[1]) * self.scale
        t = self.few.t
        stem = stem_of(self.fit.held, float(point[2]) * self.largest, float(point[3]))
        columns = [lag_response(stem, t, tau, theta)[0], np.ones_like(t)]
        if self.fit.drift_fitted:
            columns.append((t - t[0]) / (t[-1] - t[0]))
        if self.fit.start_fitted:
            columns.append(np.exp(-(t - t[0]) / tau))
        return np.stack(columns, axis=1) * self.root[:, None]

    def residual(self, point: Real) -> Real:
        columns = self.columns(point)
        return np.asarray(self.y - columns @ np.linalg.lstsq(columns, self.y, rcond=1e-12)[0])

    def result(self, point: Real) -> DeadBandFit:
        columns = self.columns(point)
        linear = np.linalg.lstsq(columns, self.y, rcond=1e-12)[0]
        left = self.y - columns @ linear
        sides = np.where(point + DELTA < self.high, 1.0, -1.0)
        moved = [
            (self.columns(point + off) - columns) @ linear / (DELTA * side)
            for off, side in zip(np.diag(DELTA * sides), sides.tolist(), strict=True)
        ]
        jacobian = np.column_stack((columns[:, 0], *moved, columns[:, 1:]))
        size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-100)
        normal = (jacobian / size).T @ (jacobian / size)
        # What the record does not determine at all gets a large error, not none.
        inverse = np.linalg.inv(normal + 1e-12 * np.eye(size.size)) / size / size[:, None]
        noise = float(left @ left) / max(left.size - size.size, 1)
        covariance = inverse * noise * residual_colour(left).inflation
        turn = np.diag([1.0, float(np.exp(point[0])), self.scale])
        width = float(point[2]) * self.largest
        return DeadBandFit(
            width=width,
            error=float(covariance[3, 3]) ** 0.5 * self.largest,
            first=float(point[3]),
            stem=stem_of(self.fit.held, width, float(point[3])),
            covariance=turn @ covariance[:3, :3] @ turn,
            largest=self.largest,
        )


def widened(fit: LeastSquaresFit, band: DeadBandFit) -> LeastSquaresFit:
    """Give a fit to the valve's position the errors of K, tau and theta that include the width's.

    Parameters
    ----------
    fit : LeastSquaresFit
        First-order fit to `band.stem`.
    band : DeadBandFit
        The dead band.
    """
    covariance = fit.covariance.copy()
    own, joint = np.diag(covariance)[:3], np.diag(band.covariance)
    factors = np.sqrt(np.maximum(joint / np.maximum(own, 1e-300), 1.0))
    covariance[:3] *= factors[:, None]
    covariance[:, :3] *= factors
    return replace(fit, covariance=covariance)


def judge_dead_band(band: DeadBandFit, *, taken: bool) -> Finding:
    """Say what the record tells of a dead band, and what follows.

    Parameters
    ----------
    band : DeadBandFit
        The dead band.
    taken : bool
        Whether the model has it.
    """
    if not taken:
        return Finding(
            verdict=Verdict.TRUSTED,
            reason=f"a dead band of the valve is no wider than {band.upper:.2g} in OP (95 %): "
            "moves that reverse are answered like those that do not",
        )
    part = band.width / band.largest
    verdict = graded(part, MATTERS, TOO_WIDE)
    text = (
        f"the valve has a dead band of {band.width:.3g} ± {1.96 * band.error:.2g} in OP (95 %), "
        f"{100 * part:.2g} % of the largest move: so much is lost whenever OP turns. K is the "
        "gain of the valve's own position"
    )
    if verdict is not Verdict.TRUSTED:
        text += "; in automatic the loop will hunt about it with integral action: repair the valve"
    return Finding(verdict=verdict, reason=text)
