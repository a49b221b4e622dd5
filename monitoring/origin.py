"""Where a shared oscillation begins: all evidence of a group as one ranking with probabilities."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from loop.signals import Real
from monitoring.granger import Granger
from monitoring.propagation import Propagation

WEIGHTS = Path(__file__).parent / "origin_weights.json"
NAMES = (
    "non-linearity ahead of the others",
    "log odds that the valve sticks",
    "net Granger flow",
    "lead in phase",
    "lead that is clear",
    "share of the oscillation ahead of the others",
)
# Log odds beyond these, 0.95 and 0.05, count as these: plants have valves whose sticking is rounded
# off further than in any that the weights were fitted on.
FARTHEST = 3.0
# From this probability on a loop is named.
NAMED_FROM = 0.8


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopEvidence:
    """What a loop of a group shows on its own.

    Attributes
    ----------
    share : float
        Part of the variance of its signal that lies at the group's period. [-]
    nonlinearity : float or None
        Index of `monitoring.nonlinearity`. [-]
    stiction : float or None
        Probability that its valve sticks. [-]
    """

    share: float
    nonlinearity: float | None
    stiction: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Where an oscillation begins, or enters.

    Attributes
    ----------
    probabilities : tuple of float
        Of every loop, in the order given. [-]
    elsewhere : float
        Probability that it reaches several of them at once from outside. [-]
    named : int or None
        Place of the loop that stands out; None where none does.
    """

    probabilities: tuple[float, ...]
    elsewhere: float
    named: int | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OriginModel:
    """Conditional logit: the probability of a loop grows with the exponential of its score.

    Attributes
    ----------
    weights : ndarray, shape (k,)
        Weights of the features, in the order of `NAMES`.
    elsewhere : float
        Score of a cause outside where no loop's past tells anything of another.
    strongest : float
        By how much that score grows with the strongest arrow; below zero.
    """

    weights: Real
    elsewhere: float
    strongest: float

    def probabilities(self, features: Real, strongest: float) -> Real:
        """Probabilities of rows of features, and last that of a cause outside, shape (m + 1,).

        P_i = exp(w·x_i) / (exp(w_0 + w_s s) + sum_j exp(w·x_j))

        with s the square root of the strength of the strongest arrow. What reaches all loops from
        outside makes no past tell much of another.
        """
        scores = np.append(features @ self.weights, self.elsewhere + self.strongest * strongest)
        parts = np.exp(scores - np.max(scores))
        return np.asarray(parts / np.sum(parts))


@cache
def origin_model() -> OriginModel:
    """Read the weights, fitted on simulated plants alone by `benchmarks/origin_weights.py`."""
    held = json.loads(WEIGHTS.read_text("utf-8"))
    if tuple(held["names"]) != NAMES:
        raise ValueError("the weights of the origin belong to other features: fit them again")
    return OriginModel(
        weights=np.array(held["weights"]), elsewhere=float(held["elsewhere"]),
        strongest=float(held["strongest"]),
    )  # fmt: skip


def origin(
    loops: Sequence[LoopEvidence],
    arrows: Granger,
    delays: Sequence[Propagation],
    period: float,
) -> Origin:
    """Weigh what loops that oscillate together show.

    Parameters
    ----------
    loops : sequence of LoopEvidence, length m
        What each shows on its own.
    arrows : Granger
        Who predicts whom, places as in `loops`.
    delays : sequence of Propagation
        Who follows whom, places as in `loops`.
    period : float
        Period. [samples]
    """
    found = origin_model().probabilities(
        origin_features(loops, arrows, delays, period), strongest_arrow(arrows)
    )
    best = int(np.argmax(found[:-1]))
    return Origin(
        probabilities=tuple(found[:-1].tolist()),
        elsewhere=float(found[-1]),
        named=best if found[best] >= NAMED_FROM else None,
    )


def origin_features(
    loops: Sequence[LoopEvidence],
    arrows: Granger,
    delays: Sequence[Propagation],
    period: float,
) -> Real:
    """Turn evidence into numbers, shape (m, k); what is not known counts as nothing, 0.

    Parameters
    ----------
    loops, arrows, delays, period
        As in `origin`.
    """
    m = len(loops)
    nonlinear = np.log1p([max(one.nonlinearity or 0.0, 0.0) for one in loops])
    sticking = np.array([_log_odds(one.stiction) for one in loops])
    raw, clear = np.zeros((m, m)), np.zeros((m, m))
    for pair in delays:
        i, j = pair.first, pair.second
        ahead = float(np.clip(4 * pair.delay / period, -1.0, 1.0))
        raw[i, j], raw[j, i] = ahead, -ahead
        if pair.clear and abs(pair.delay) > 2 * pair.error:
            clear[i, j], clear[j, i] = np.sign(pair.delay), -np.sign(pair.delay)
    others = max(m - 1, 1)
    return np.column_stack(
        [
            np.clip(_ahead(nonlinear), -1.0, 1.0),
            sticking,
            net_flow(arrows, m),
            np.sum(raw, axis=1) / others,
            np.sum(clear, axis=1) / others,
            _ahead(np.array([one.share for one in loops])),
        ]
    )


def strongest_arrow(arrows: Granger) -> float:
    """Square root of the strength of the strongest significant arrow; 0 where there is none.

    Parameters
    ----------
    arrows : Granger
        Who predicts whom.
    """
    strengths = [one.strength for one in arrows.arrows if one.significant]
    return float(np.sqrt(max(strengths, default=0.0)))


def net_flow(arrows: Granger, m: int) -> Real:
    """What each loop tells of others less what they tell of it, as a part of all that is told.

    Parameters
    ----------
    arrows : Granger
        Who predicts whom.
    m : int
        How many loops there are.

    Returns
    -------
    ndarray, shape (m,)
        Sums of the square roots of the strengths of significant arrows, out less in. [-]
    """
    flow = np.zeros(m)
    total = 0.0
    for arrow in arrows.arrows:
        if arrow.significant:
            size = float(np.sqrt(max(arrow.strength, 0.0)))
            flow[arrow.cause] += size
            flow[arrow.effect] -= size
            total += size
    return flow / total if total > 0 else flow


def _log_odds(probability: float | None) -> float:
    if probability is None:
        return 0.0
    p = min(max(probability, 1e-6), 1 - 1e-6)
    return float(np.clip(np.log(p / (1 - p)), -FARTHEST, FARTHEST))


def _ahead(values: Real) -> Real:
    """By how much each value exceeds the largest of the others; 0 for a single one."""
    if values.size < 2:
        return np.zeros(values.size)
    order = np.sort(values)
    rest = np.where(np.arange(values.size) == np.argmax(values), order[-2], order[-1])
    return np.asarray(values - rest)
