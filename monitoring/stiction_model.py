"""From the features to one probability: a logistic model fitted on simulated loops alone."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from loop.signals import Real
from monitoring.stiction_features import NAMES

WEIGHTS = Path(__file__).parent / "stiction_weights.json"
# Features beyond this many standard deviations count as this far: no single one decides alone.
FARTHEST = 4.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StictionModel:
    """Logistic model on the features, their squares and their products.

    Attributes
    ----------
    mean, spread : ndarray, shape (k,)
        Mean and standard deviation of the features where it was fitted.
    weights : ndarray, shape (1 + 2 k + k (k - 1)/2,)
        Weights in the order of `terms`.
    second : ndarray, shape (3,)
        Weights of a constant, the first log odds and what the search took off, for flagged loops.
    flagged_from : float
        First probability from which the search is run.
    stiction_from, none_below : float
        Probabilities from which the answer is stiction, and below which it is none.
    """

    mean: Real
    spread: Real
    weights: Real
    second: Real
    flagged_from: float
    stiction_from: float
    none_below: float

    def probability(self, vectors: Real) -> Real:
        """Probability of stiction for rows of features, shape (m, k) -> (m,).

        Sticking and other loops are taken as equally likely beforehand.
        """
        return logistic(terms(vectors, self.mean, self.spread) @ self.weights)

    def searched(self, probability: Real, improvement: Real) -> Real:
        """Probability once the search has run, shape (m,).

        Parameters
        ----------
        probability : ndarray, shape (m,)
            First probability.
        improvement : ndarray, shape (m,)
            Part of the linear model's residual that the best S and J take off. [-]
        """
        return logistic(second_terms(probability, improvement) @ self.second)


def logistic(score: Real) -> Real:
    """Probability from log odds."""
    return np.asarray(1 / (1 + np.exp(-np.clip(score, -30, 30))))


def second_terms(probability: Real, improvement: Real) -> Real:
    """A constant, the first log odds and what the search took off, a row a loop."""
    odds = np.log(probability / (1 - probability))
    return np.column_stack([np.ones(odds.size), odds, np.sqrt(np.maximum(improvement, 0.0))])


def terms(vectors: Real, mean: Real, spread: Real) -> Real:
    """A constant, the scaled features, their squares and their products, a row a loop."""
    z = np.clip((vectors - mean) / spread, -FARTHEST, FARTHEST)
    i, j = np.triu_indices(z.shape[1], 1)
    return np.hstack([np.ones((z.shape[0], 1)), z, z * z, z[:, i] * z[:, j]])


@cache
def stiction_model() -> StictionModel:
    """Read the weights that `benchmarks/stiction_weights.py` fitted."""
    body = json.loads(WEIGHTS.read_text("utf-8"))
    if tuple(body["names"]) != NAMES:
        raise ValueError("the weights belong to other features: fit them again")
    return StictionModel(
        mean=np.array(body["mean"]),
        spread=np.array(body["spread"]),
        weights=np.array(body["weights"]),
        second=np.array(body["second"]),
        flagged_from=float(body["flagged_from"]),
        stiction_from=float(body["stiction_from"]),
        none_below=float(body["none_below"]),
    )
