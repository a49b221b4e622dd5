import numpy as np
import pytest

from benchmarks.answer_weights import boosted
from monitoring.answer_model import answer_model
from monitoring.boosted_trees import trees_from
from monitoring.valve_answers import NAMES

# if x0 <= 1: -1, else if x1 <= 5: 2, else 3; and a tree of one leaf
BY_HAND = {
    "number": [0, -1, 1, -1, -1, -1],
    "edge": [0, 0],
    "right": [2, 2],
    "value": [-1.0, 2.0, 3.0, 0.5],
    "edges": [[1.0], [5.0]],
}


def test_trees_are_walked_as_they_are_written() -> None:
    trees = trees_from(BY_HAND)
    assert trees.roots.tolist() == [0, 5]
    assert trees.depth == 2
    rows = np.array([[1.0, 9.0], [1.1, 5.0], [1.1, 5.1], [-np.inf, 0.0]])
    assert trees.log_odds(rows).tolist() == [-0.5, 2.5, 3.5, -0.5]


def test_a_tree_that_is_cut_off_is_refused() -> None:
    with pytest.raises(ValueError, match="cut off"):
        trees_from(BY_HAND | {"number": [0, -1], "edge": [0], "right": [2], "value": [-1.0]})


def test_no_answer_is_worth_a_certainty_and_every_row_ends_in_a_leaf() -> None:
    trees = answer_model().trees
    rows = np.random.default_rng(1).normal(size=(200, len(NAMES))) * 5
    odds = trees.log_odds(rows)
    assert np.all(np.isfinite(odds))
    assert odds.min() < 0 < odds.max()
    one_by_one = [float(trees.log_odds(row[None])[0]) for row in rows[:20]]
    np.testing.assert_allclose(one_by_one, odds[:20])


def test_written_trees_say_what_the_fitted_ones_say() -> None:
    lightgbm = pytest.importorskip("lightgbm", reason="LightGBM comes with make bench only")
    from benchmarks import answer_weights

    rng = np.random.default_rng(2)
    rows = rng.normal(size=(900, len(NAMES)))
    sticking = (rows[:, 0] * rows[:, 1] + 0.3 * rng.normal(size=900) > 0).astype(float)
    trees = trees_from(boosted(rows, sticking))
    weight = np.where(sticking == 1, 0.5 / sticking.mean(), 0.5 / (1 - sticking.mean()))
    data = lightgbm.Dataset(rows, sticking, weight=weight)
    fitted = lightgbm.train(answer_weights.TREES, data, num_boost_round=answer_weights.ROUNDS)
    unseen = rng.normal(size=(300, len(NAMES)))
    np.testing.assert_allclose(
        trees.log_odds(unseen), fitted.predict(unseen, raw_score=True), atol=0.03
    )
