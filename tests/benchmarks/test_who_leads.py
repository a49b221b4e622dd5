"""Simulated plants with a known source, and how rankings are counted."""

from functools import cache

import numpy as np
import pytest

from advice.swings import Swing, swings_of
from benchmarks.origin_weights import Example, fitted, grid_of
from benchmarks.shared_swings import LOOPS, Origin, Topology, shared_swings
from benchmarks.who_leads import tally
from monitoring.origin import NAMES


@pytest.mark.parametrize("topology", Topology)
def test_a_plant_follows_from_its_seed_and_swings_as_stated(topology: Topology) -> None:
    (plant,) = shared_swings(topology, Origin.ENTERS, 1, seed=5)
    (again,) = shared_swings(topology, Origin.ENTERS, 1, seed=5)
    assert len(plant.records) == LOOPS
    assert plant.source is not None
    np.testing.assert_array_equal(plant.records[0].pv, again.records[0].pv)


def test_the_true_loop_of_a_chain_is_named_with_its_victims() -> None:
    (plant,) = shared_swings(Topology.CHAIN, Origin.VALVE, 1, seed=8)
    swing = swings_of(grid_of(plant))[0]
    assert swing.origin.named is not None
    assert swing.members[swing.origin.named] == plant.source
    assert len(swing.members) >= 2


@cache
def swing() -> Swing:
    (plant,) = shared_swings(Topology.UTILITY, Origin.ENTERS, 1, seed=5)
    return swings_of(grid_of(plant))[0]


def example(truth: int | None, *flow: float) -> Example:
    features = np.zeros((len(flow), len(NAMES)))
    features[:, NAMES.index("net Granger flow")] = flow
    return Example(
        topology=Topology.CHAIN, origin=Origin.VALVE, truth=truth, swing=swing(),
        features=features, strongest=max(flow),
    )  # fmt: skip


def test_the_fit_learns_what_points_to_the_true_loop_and_the_tally_counts_it() -> None:
    found = [example(0, 1.0, -1.0), example(1, -1.0, 1.0), example(None, 0.0, 0.0)] * 4
    model = fitted(found)
    assert model.weights[NAMES.index("net Granger flow")] > 1.0
    assert np.count_nonzero(np.abs(model.weights) > 1e-3) == 1
    # Where no arrow is strong, the cause is outside.
    assert model.strongest < 0
    counted = tally(found)
    assert (counted.plants, counted.groups) == (12, 12)
    assert counted.together == 1.0
    assert counted.alone == (0.5, 0.5, 1.0, 0.5)
