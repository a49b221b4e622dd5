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
from monitoring.stiction_features import NAMES, stiction_features
from monitoring.stiction_model import WEIGHTS, StictionModel, terms

FITTING_SEEDS = (101, 102, 103)
LIMIT_SEEDS = (201, 202)
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
    states : ndarray of str, shape (n,)
        What is true of the loops; sticking ones drive a cycle.
    """

    vectors: Real
    states: np.ndarray

    @property
    def sticking(self) -> Real:
        """1 for sticking loops, 0 for all others."""
        return (self.states == State.STICKING.value).astype(np.float64)


def examples(seed: int) -> Examples:
    """Simulate loops of every state and gather their features."""
    vectors, states = [], []
    for samples, part in SAMPLES.items():
        for state, count in COUNTS.items():
            for one in virtual_loops(state, int(part * count), samples=samples, seed=seed):
                error = one.sp - one.pv
                if state is State.STICKING and not one.drives:
                    continue
                found = stiction_features(
                    one.op, one.pv, error, oscillation(error, 1.0), 1.0,
                    integrating=one.integrating,
                )  # fmt: skip
                if found is not None:
                    vectors.append(found.vector)
                    states.append(state.value)
    return Examples(vectors=np.array(vectors), states=np.array(states))


def together(parts: Iterable[Examples]) -> Examples:
    """Join examples."""
    listed = list(parts)
    return Examples(
        vectors=np.concatenate([part.vectors for part in listed]),
        states=np.concatenate([part.states for part in listed]),
    )


def fit(data: Examples, *, ridge: float = RIDGE) -> StictionModel:
    """Fit by Newton's method with a ridge; both classes weigh the same."""
    y = data.sticking
    mean, spread = data.vectors.mean(axis=0), data.vectors.std(axis=0) + 1e-9
    X = terms(data.vectors, mean, spread)
    weight = np.where(y == 1, 0.5 / y.mean(), 0.5 / (1 - y.mean()))
    penalty = ridge * np.eye(X.shape[1])
    penalty[0, 0] = 1e-6
    b = np.zeros(X.shape[1])
    for _ in range(40):
        p = 1 / (1 + np.exp(-np.clip(X @ b, -30, 30)))
        slope = X.T @ (weight * (y - p)) - penalty @ b
        b += np.linalg.solve((X.T * (weight * p * (1 - p))) @ X + penalty, slope)
    return StictionModel(mean=mean, spread=spread, weights=b, stiction_from=0.5, none_below=0.5)


def limits(model: StictionModel, data: Examples) -> tuple[float, float]:
    """Upper and lower limit of the probability, from loops that the fit has not seen."""
    p = model.probability(data.vectors)
    healthy = p[data.states == State.HEALTHY.value]
    sticking = p[data.states == State.STICKING.value]
    upper = float(np.quantile(healthy, 1 - FALSE_ALARMS))
    lower = float(np.quantile(sticking, MISSED))
    return max(upper, 0.5), min(lower, upper, 0.5)


def main() -> None:
    """Fit, set the limits and write the file."""
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(examples, (*FITTING_SEEDS, *LIMIT_SEEDS)))
    unseen = together(found[len(FITTING_SEEDS) :])
    model = fit(together(found[: len(FITTING_SEEDS)]))
    upper, lower = limits(model, unseen)
    p = model.probability(unseen.vectors)
    for state in State:
        of_state = p[unseen.states == state.value]
        print(
            f"{state.value}: {of_state.size} loops, stiction {np.mean(of_state >= upper):.3f}, "
            f"undecided {np.mean((of_state < upper) & (of_state >= lower)):.3f}"
        )
    body = {
        "names": NAMES,
        "fitted_by": "benchmarks/stiction_weights.py on simulated loops",
        "seeds": FITTING_SEEDS,
        "limit_seeds": LIMIT_SEEDS,
        "mean": model.mean.tolist(),
        "spread": model.spread.tolist(),
        "weights": model.weights.tolist(),
        "stiction_from": upper,
        "none_below": lower,
    }
    WEIGHTS.write_text(json.dumps(body, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
