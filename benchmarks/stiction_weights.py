"""Fit the weights of the stiction probability on simulated loops, and set its two limits.

    python -m benchmarks.stiction_weights

writes `monitoring/stiction_weights.json`. Recorded plant data play no part in it. The limits are
set on loops that the weights have not seen; `benchmarks/false_alarms.py` judges on others again.
"""

import json
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from benchmarks.virtual_loops import State, virtual_loops
from loop.signals import Real
from monitoring.oscillation import oscillation
from monitoring.stiction_features import NAMES, active_part, stiction_features
from monitoring.stiction_model import WEIGHTS, StictionModel, logistic, second_terms, terms
from monitoring.stiction_search import stiction_search

FITTING_SEEDS = (101, 102, 103)
SECOND_SEEDS = (201,)
LIMIT_SEEDS = (301, 302)
COUNTS = {
    State.HEALTHY: 240,
    State.OUTSIDE: 160,
    State.SET_POINT: 80,
    State.TIGHT: 120,
    State.STICKING: 360,
}
SAMPLES = {750: 1.0, 1500: 1.0, 3000: 0.4}
RIDGE = 10.0
# Healthy loops beyond the upper limit, and sticking loops below the lower one.
FALSE_ALARMS, MISSED = 0.005, 0.01


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


def examples(seed: int) -> Examples:
    """Simulate loops of every state and gather their features."""
    vectors, improvements, states = [], [], []
    for samples, share in SAMPLES.items():
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
                    part = active_part(swings, 1.0)
                    search = stiction_search(one.op[part], one.pv[part], found.period)
                    vectors.append(found.vector)
                    improvements.append(search.improvement or 0.0)
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


def fit(first: Examples, second: Examples) -> StictionModel:
    """Fit the features on some loops and the word of the search on others."""
    mean, spread = first.vectors.mean(axis=0), first.vectors.std(axis=0) + 1e-9
    weights = newton(terms(first.vectors, mean, spread), first.sticking, ridge=RIDGE)
    p = logistic(terms(second.vectors, mean, spread) @ weights)
    flagged_from = min(float(np.quantile(p[second.sticking == 1], MISSED)), 0.5)
    flagged = p >= flagged_from
    return StictionModel(
        mean=mean,
        spread=spread,
        weights=weights,
        second=newton(
            second_terms(p[flagged], second.improvements[flagged]), second.sticking[flagged],
            ridge=0.1,
        ),
        flagged_from=flagged_from,
        stiction_from=1.0,
        none_below=0.0,
    )  # fmt: skip


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


def final(model: StictionModel, data: Examples) -> Real:
    """Probability of every loop, the search run on flagged ones."""
    p = model.probability(data.vectors)
    return np.where(p >= model.flagged_from, model.searched(p, data.improvements), p)


def limits(p: Real, data: Examples) -> tuple[float, float]:
    """Upper and lower limit of the probability, from loops that the fit has not seen."""
    upper = float(np.quantile(p[data.states == State.HEALTHY.value], 1 - FALSE_ALARMS))
    lower = float(np.quantile(p[data.states == State.STICKING.value], MISSED))
    return max(upper, 0.5), min(lower, upper, 0.5)


def main() -> None:
    """Fit, set the limits and write the file."""
    seeds = (*FITTING_SEEDS, *SECOND_SEEDS, *LIMIT_SEEDS)
    with ProcessPoolExecutor(2) as pool:
        found = dict(zip(seeds, pool.map(examples, seeds), strict=True))
    first, second, unseen = (
        together(found[seed] for seed in group)
        for group in (FITTING_SEEDS, SECOND_SEEDS, LIMIT_SEEDS)
    )
    model = fit(first, second)
    p = final(model, unseen)
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
        "seeds": seeds,
        "mean": model.mean.tolist(),
        "spread": model.spread.tolist(),
        "weights": model.weights.tolist(),
        "second": model.second.tolist(),
        "flagged_from": model.flagged_from,
        "stiction_from": upper,
        "none_below": lower,
    }
    WEIGHTS.write_text(json.dumps(body, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
