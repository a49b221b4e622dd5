from pathlib import Path

import numpy as np
import pytest

from benchmarks.false_alarms import auc, auc_interval, episode_probabilities, outcomes
from benchmarks.virtual_loops import State, virtual_loops
from monitoring.loop_signals import Stretch
from monitoring.oscillation import oscillation
from monitoring.stiction import stiction
from monitoring.stiction_features import NAMES, strongest_period
from monitoring.stiction_model import logistic, second_terms, stiction_model, terms
from monitoring.stiction_result import StictionVerdict

EPISODES = Path(__file__).parents[3] / "shared" / "data" / "refinery_loops"


def test_healthy_loops_are_hardly_ever_accused() -> None:
    found = outcomes(State.HEALTHY, 30, seed=41)
    assert sum(one.verdict is StictionVerdict.STICTION for one in found) <= 1


def test_most_sticking_loops_are_found_with_their_evidence() -> None:
    found = outcomes(State.STICKING, 30, seed=42)
    said = [one.verdict is StictionVerdict.STICTION for one in found]
    assert len(said) >= 10
    assert np.mean(said) >= 0.75


def test_the_probability_does_not_depend_on_the_units() -> None:
    one = next(v for v in virtual_loops(State.STICKING, 9, samples=1000, seed=5) if v.drives)
    plain = Stretch(first=0, dt=1.0, pv=one.pv, op=one.op, sp=one.sp, share=1.0)
    scaled = Stretch(first=0, dt=60.0, pv=7 * one.pv, op=one.op / 100, sp=7 * one.sp, share=1.0)
    first = stiction(plain, oscillation(plain.error, 1.0))
    other = stiction(scaled, oscillation(scaled.error, 60.0), op_span=1.0, compressed=True)
    assert first.probability is not None
    assert other.probability == pytest.approx(first.probability, abs=1e-4)
    assert first.S is not None
    assert other.S is not None
    assert abs(other.S / first.S - 1) < 1e-3
    assert len(first.evidence) == 10
    assert "PV was compressed, which straightens waves" in other.basis.reasons


def test_a_loop_whose_output_rests_is_not_judged() -> None:
    n = 500
    pv = np.random.default_rng(0).normal(size=n)
    still = Stretch(first=0, dt=1.0, pv=pv, op=np.full(n, 40.0), sp=None, share=1.0)
    found = stiction(still, oscillation(still.error, 1.0))
    assert found.verdict is StictionVerdict.UNDECIDED
    assert found.probability is None
    assert found.basis.refused
    assert strongest_period(np.ones(500)) is None


def test_the_weights_belong_to_the_features_and_the_limits_are_in_order() -> None:
    model = stiction_model()
    k = len(NAMES)
    assert model.mean.size == k
    assert model.weights.size == 1 + 2 * k + k * (k - 1) // 2
    assert 0 < model.none_below <= model.stiction_from < 1
    row = terms(model.mean[None] + model.spread, model.mean, model.spread)
    np.testing.assert_allclose(row, 1.0)
    p = model.searched(np.array([0.5, 0.5]), np.array([0.0, 0.5]))
    assert p[1] > p[0]
    assert logistic(np.array([0.0]))[0] == 0.5
    assert second_terms(np.array([0.5]), np.array([-0.1])).tolist() == [[1.0, 0.0, 0.0]]


def test_the_area_under_the_curve_is_the_part_of_pairs_won() -> None:
    label, score = np.array([1, 1, 0, 0, 0]), np.array([0.9, 0.4, 0.4, 0.2, 0.1])
    won = [(a > b) + 0.5 * (a == b) for a in score[:2] for b in score[2:]]
    assert auc(label, score) == pytest.approx(np.mean(won))
    low, high = auc_interval(label, score, draws=200)
    assert low <= auc(label, score) <= high


def test_real_episodes_are_all_answered() -> None:
    if not EPISODES.is_dir():
        pytest.skip("shared/data/refinery_loops is not beside the project")
    loops = episode_probabilities(EPISODES)
    assert len(loops) == 17
    assert all(0 <= row[1] <= 1 for row in loops.values())
