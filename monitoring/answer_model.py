"""From PV's answers to OP, and the wave's word where there is one, to one probability."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from loop.signals import Real
from monitoring.boosted_trees import BoostedTrees, trees_from
from monitoring.stiction_model import logistic, terms
from monitoring.valve_answers import NAMES

ANSWER_WEIGHTS = Path(__file__).parent / "answer_weights.json"
# Log odds beyond this count as this much: neither word alone is a certainty.
MOST_ODDS = 8.0
JOINT_NAMES = (
    "log odds by the answers",
    "log odds by the wave",
    "clear oscillation",
    "share of the oscillation in the error",
    "likeness of the cycles of OP",
    "likeness of the cycles of PV",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class WaveWord:
    """What the shapes of the waves say, and how clear the waves are; as it stands, nothing.

    Attributes
    ----------
    probability : float
        Probability of stiction by `monitoring.stiction_model`. [-]
    clear : bool
        There is a clear oscillation.
    share, op_likeness, pv_likeness : float
        As in `monitoring.stiction_features.NAMES`. [-]
    """

    probability: float = 0.5
    clear: bool = False
    share: float = 0.0
    op_likeness: float = 0.0
    pv_likeness: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnswerModel:
    """Models fitted on simulated windows and loops alone.

    Attributes
    ----------
    trees : BoostedTrees
        Log odds by PV's answers.
    joint_mean, joint_spread, joint : ndarray
        Of a logistic model of both words, in the order of `JOINT_NAMES`, as in `StictionModel`.
    stiction_from, none_below : float
        Probabilities from which the answer is stiction, and below which it is none.
    lost_motion_from, correlation_from : float
        Lost motion that one healthy window in a hundred has, correlation that one sticking
        window in a hundred has: the limits of each method's own word.
    """

    trees: BoostedTrees
    joint_mean: Real
    joint_spread: Real
    joint: Real
    stiction_from: float
    none_below: float
    lost_motion_from: float
    correlation_from: float

    def answers(self, vectors: Real) -> Real:
        """Probability by PV's answers alone, rows of `NAMES` -> (m,)."""
        return logistic(self.trees.log_odds(vectors))

    def together(self, vectors: Real) -> Real:
        """Probability by both words, rows of `joint_vector` -> (m,)."""
        return logistic(terms(vectors, self.joint_mean, self.joint_spread) @ self.joint)


def joint_vector(answers: float, wave: WaveWord) -> Real:
    """Both words, and how clear the wave is, in the order of `JOINT_NAMES`."""
    return np.array([
        _log_odds(answers), _log_odds(wave.probability), float(wave.clear), wave.share,
        wave.op_likeness, wave.pv_likeness,
    ])  # fmt: skip


def _log_odds(probability: float) -> float:
    inside = min(max(probability, 1e-9), 1 - 1e-9)
    return float(np.clip(np.log(inside / (1 - inside)), -MOST_ODDS, MOST_ODDS))


@cache
def answer_model() -> AnswerModel:
    """Read the weights that `benchmarks/answer_weights.py` fitted."""
    body = json.loads(ANSWER_WEIGHTS.read_text("utf-8"))
    if tuple(body["names"]) != NAMES:
        raise ValueError("the weights belong to other numbers: fit them again")
    return AnswerModel(
        trees=trees_from(body["trees"]),
        joint_mean=np.array(body["joint_mean"]),
        joint_spread=np.array(body["joint_spread"]),
        joint=np.array(body["joint"]),
        stiction_from=float(body["stiction_from"]),
        none_below=float(body["none_below"]),
        lost_motion_from=float(body["lost_motion_from"]),
        correlation_from=float(body["correlation_from"]),
    )
