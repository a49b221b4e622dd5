"""Fit the weights of the stiction probability on simulated loops, and set its two limits.

    python -m benchmarks.stiction_weights

writes `monitoring/stiction_weights.json`. Recorded plant data play no part in it. The limits are
set on loops that the weights have not seen; `benchmarks/false_alarms.py` judges on others again.
"""

import json
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from benchmarks.virtual_loops import State, virtual_loops
from loop.signals import Real
from monitoring.oscillation import oscillation
from monitoring.stiction_features import NAMES, active_part, stiction_features
from monitoring.stiction_model import WEIGHTS, logistic, second_terms, terms
from monitoring.stiction_search import stiction_search

FITTING_SEEDS = (101, 102, 103)
SECOND_SEED, LIMIT_SEED = 201, 301
COUNTS = {
    State.HEALTHY: 240,
    State.OUTSIDE: 160,
    State.SET_POINT: 80,
    State.TIGHT: 120,
    State.STICKING: 360,
}
SAMPLES = {750: 1.0, 1500: 1.0, 3000: 0.4}
# The second stage has three weights, and the limits are two: fewer loops do.
FEWER = {750: 0.6, 1500: 0.6}
RIDGE = 10.0
FLAGGED_FROM = 0.1
# Healthy loops beyond the upper limit, and sticking loops below the lower one.
FALSE_ALARMS, MISSED = 0.005, 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FirstStage:
    """Weights of the features, and from which probability on the search is run."""

    mean: Real
    spread: Real
    weights: Real
    flagged_from: float = FLAGGED_FROM

    def probability(self, vectors: Real) -> Real:
        """Probability by the features alone."""
        return logistic(terms(vectors, self.mean, self.spread) @ self.weights)

    def flags(self, vector: Real) -> bool:
        """Whether the search is to be run."""
        return bool(self.probability(vector[None])[0] >= self.flagged_from)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Examples:
    """Features of simulated loops.

    Attributes
    ----------
    vectors : ndarray, shape (n, k)
        Features.
    improvements : ndarray, shape (n,)
        What the search for S and J takes off the residual. [-]
    states : ndarray of str, shape (n,)
        What is true of the loops; sticking ones drive a cycle.
    """

    vectors: Real
    improvements: Real
    states: np.ndarray

    @property
    def sticking(self) -> Real:
        """1 for sticking loops, 0 for all others."""
        return np.asarray(self.states == State.STICKING.value, dtype=np.float64)


def examples(
    seed: int, samples_and_shares: Mapping[int, float], first: FirstStage | None = None
) -> Examples:
    """Simulate loops of every state and gather their features; search what a first stage flags."""
    vectors, improvements, states = [], [], []
    for samples, share in samples_and_shares.items():
        for state, count in COUNTS.items():
            for one in virtual_loops(state, int(share * count), samples=samples, seed=seed):
                error = one.sp - one.pv
                if state is State.STICKING and not one.drives:
                    continue
                swings = oscillation(error, 1.0)
                found = stiction_features(
                    one.op, one.pv, error, swings, 1.0, integrating=one.integrating
                )
                if found is not None:
                    vectors.append(found.vector)
                    improvement = 0.0
                    if first is not None and first.flags(found.vector):
                        part = active_part(swings, 1.0)
                        search = stiction_search(one.op[part], one.pv[part], found.period)
                        improvement = search.improvement or 0.0
                    improvements.append(improvement)
                    states.append(state.value)
    return Examples(
        vectors=np.array(vectors), improvements=np.array(improvements), states=np.array(states)
    )


def together(parts: Iterable[Examples]) -> Examples:
    """Join examples."""
    listed = list(parts)
    return Examples(
        vectors=np.concatenate([part.vectors for part in listed]),
        improvements=np.concatenate([part.improvements for part in listed]),
        states=np.concatenate([part.states for part in listed]),
    )


def first_stage(data: Examples) -> FirstStage:
    """Fit the weights of the features."""
    mean, spread = data.vectors.mean(axis=0), data.vectors.std(axis=0) + 1e-9
    weights = newton(terms(data.vectors, mean, spread), data.sticking, ridge=RIDGE)
    return FirstStage(mean=mean, spread=spread, weights=weights)


def second_stage(first: FirstStage, data: Examples) -> Real:
    """Fit the weights of the search's word on flagged loops that the first stage has not seen."""
    p = first.probability(data.vectors)
    flagged = p >= first.flagged_from
    return newton(
        second_terms(p[flagged], data.improvements[flagged]), data.sticking[flagged], ridge=0.1
    )


def newton(X: Real, y: Real, *, ridge: float) -> Real:
    """Fit logistic weights by Newton's method with a ridge; both classes weigh the same."""
    weight = np.where(y == 1, 0.5 / y.mean(), 0.5 / (1 - y.mean()))
    penalty = ridge * np.eye(X.shape[1])
    penalty[0, 0] = 1e-6
    b = np.zeros(X.shape[1])
    for _ in range(40):
        p = logistic(X @ b)
        slope = X.T @ (weight * (y - p)) - penalty @ b
        b += np.linalg.solve((X.T * (weight * p * (1 - p))) @ X + penalty, slope)
    return b


def final(first: FirstStage, second: Real, data: Examples) -> Real:
    """Probability of every loop, the search's word heard on flagged ones."""
    p = first.probability(data.vectors)
    searched = logistic(second_terms(p, data.improvements) @ second)
    return np.where(p >= first.flagged_from, searched, p)


def limits(p: Real, data: Examples) -> tuple[float, float]:
    """Upper and lower limit of the probability, from loops that no fit has seen."""
    upper = float(np.quantile(p[data.states == State.HEALTHY.value], 1 - FALSE_ALARMS))
    lower = float(np.quantile(p[data.states == State.STICKING.value], MISSED))
    return max(upper, 0.5), min(lower, upper, 0.5)


def main() -> None:
    """Fit, set the limits and write the file."""
    with ProcessPoolExecutor(2) as pool:
        fitting = pool.map(examples, FITTING_SEEDS, [SAMPLES] * len(FITTING_SEEDS))
        finish(first_stage(together(fitting)), pool)


def finish(first: FirstStage, pool: Executor) -> None:
    """Fit the second stage, set the limits and write everything."""
    data, unseen = pool.map(examples, (SECOND_SEED, LIMIT_SEED), (FEWER, FEWER), (first, first))
    second = second_stage(first, data)
    p = final(first, second, unseen)
    upper, lower = limits(p, unseen)
    for state in State:
        of_state = p[unseen.states == state.value]
        print(
            f"{state.value}: {of_state.size} loops, stiction {np.mean(of_state >= upper):.3f}, "
            f"undecided {np.mean((of_state < upper) & (of_state >= lower)):.3f}"
        )
    body = {
        "names": NAMES,
        "fitted_by": "benchmarks/stiction_weights.py on simulated loops",
        "seeds": [*FITTING_SEEDS, SECOND_SEED, LIMIT_SEED],
        "mean": first.mean.tolist(),
        "spread": first.spread.tolist(),
        "weights": first.weights.tolist(),
        "second": second.tolist(),
        "flagged_from": first.flagged_from,
        "stiction_from": upper,
        "none_below": lower,
    }
    WEIGHTS.write_text(json.dumps(body, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
