"""Fit the weights by which the evidence of where an oscillation begins is combined.

    python -m benchmarks.origin_weights

writes `monitoring/origin_weights.json`. Only simulated plants play a part in it;
`benchmarks/who_leads.py` judges on others.
"""

import json
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from advice.swings import Grid, Swing, swings_of
from benchmarks.shared_swings import Origin, SharedSwing, Topology, shared_swings
from loop.signals import Real
from monitoring.origin import NAMES, WEIGHTS, OriginModel, origin_features, strongest_arrow

SEED, COUNT = 1, 16
RIDGE = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Example:
    """The largest group of one simulated plant.

    Attributes
    ----------
    topology : Topology
        How the loops hang together.
    origin : Origin
        What makes them swing.
    truth : int or None
        Place in the group of the loop where it begins; None where it enters everywhere.
    swing : Swing or None
        What was found; None where no group holds the loop where it begins.
    features : ndarray, shape (m, k)
        Features of the loops of the group.
    strongest : float
        Of its arrows, as the model takes it.
    """

    topology: Topology
    origin: Origin
    truth: int | None
    swing: Swing | None
    features: Real
    strongest: float


def examples(seed: int, count: int) -> Iterator[Example]:
    """Simulate plants of every kind and look at them, `count` of each.

    Parameters
    ----------
    seed : int
        Seed of the plants.
    count : int
        How many of each topology and origin.
    """
    kinds = [(top, origin, count, seed) for top in Topology for origin in Origin]
    with ProcessPoolExecutor(2) as pool:
        for found in pool.map(_of_kind, kinds):
            yield from found


def _of_kind(kind: tuple[Topology, Origin, int, int]) -> list[Example]:
    topology, origin, count, seed = kind
    return [example(plant) for plant in shared_swings(topology, origin, count, seed=seed)]


def example(plant: SharedSwing) -> Example:
    """Look at one plant.

    Parameters
    ----------
    plant : SharedSwing
        A simulated plant.
    """
    known = [one for one in swings_of(grid_of(plant)) if _holds(one, plant.source)]
    swing = known[0] if known else None
    truth = None
    if swing is not None and plant.source is not None:
        truth = swing.members.index(plant.source)
    features: Real = np.zeros((0, len(NAMES)))
    strongest = 0.0
    if swing is not None:
        features = origin_features(swing.loops, swing.arrows, swing.delays, swing.period)
        strongest = strongest_arrow(swing.arrows)
    return Example(
        topology=plant.topology, origin=plant.origin, truth=truth, swing=swing,
        features=features, strongest=strongest,
    )  # fmt: skip


def _holds(swing: Swing, source: int | None) -> bool:
    return source is None or source in swing.members


def grid_of(plant: SharedSwing) -> Grid:
    """Put a plant's records side by side; they have the same instants.

    Parameters
    ----------
    plant : SharedSwing
        A simulated plant.
    """
    pv = np.array([record.pv for record in plant.records])
    sp = np.array([record.sp for record in plant.records])
    return Grid(
        dt=1.0, error=sp - pv, pv=pv, op=np.array([record.op for record in plant.records]),
        mode=(None,) * len(pv), levels=(False,) * len(pv),
    )  # fmt: skip


def fitted(found: list[Example]) -> OriginModel:
    """Fit by maximum likelihood with a ridge; every plant with a group counts once.

    Parameters
    ----------
    found : list of Example
        Groups with what is true of them.
    """
    groups = [one for one in found if one.swing is not None]

    def loss(w: Real) -> float:
        chances = [
            _model(w).probabilities(one.features, one.strongest)[
                -1 if one.truth is None else one.truth
            ]
            for one in groups
        ]
        return float(-np.sum(np.log(np.maximum(chances, 1e-12))) + RIDGE / 2 * (w[1:] @ w[1:]))

    return _model(minimize(loss, np.zeros(2 + len(NAMES)), method="BFGS").x)


def _model(w: Real) -> OriginModel:
    return OriginModel(elsewhere=float(w[0]), strongest=float(w[1]), weights=w[2:])


def main() -> None:
    """Fit and write the weights."""
    found = list(examples(SEED, COUNT))
    model = fitted(found)
    held = {
        "names": NAMES,
        "weights": [round(float(w), 4) for w in model.weights],
        "elsewhere": round(model.elsewhere, 4),
        "strongest": round(model.strongest, 4),
        "plants": len(found),
        "groups": sum(one.swing is not None for one in found),
    }
    WEIGHTS.write_text(json.dumps(held, indent=1) + "\n", "utf-8")
    print(json.dumps(held, indent=1))


if __name__ == "__main__":
    main()
