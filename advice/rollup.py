"""Many loops' assessments as one page: how the plant stands, area by area, and its bad actors."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from monitoring.cause import Cause


@dataclass(frozen=True, slots=True, kw_only=True)
class Scored:
    """One loop of the plant, as it was assessed.

    Attributes
    ----------
    name, tag, area, unit : str
        Which loop, and where it is.
    weight : float
        How much it matters, stated by the plant. [-]
    points : float or None
        Grade, 0 to 100; None where it is not assessable. [-]
    cause : str
        What is wrong, a person's word before the computed one.
    worth : float or None
        What a day costs in which the loop does nothing right; None where nobody said. [money]
    """

    name: str
    tag: str
    area: str
    unit: str
    weight: float
    points: float | None
    cause: str
    worth: float | None = None

    @property
    def loss(self) -> float:
        """What the loop costs: weight times the points that are missing. [-]"""
        return 0.0 if self.points is None else self.weight * (100.0 - self.points)

    @property
    def cost(self) -> float | None:
        """Worth times the part of the points that is missing; None where it is not known. [money]

        A day is taken to cost in proportion to what the grade lacks.
        """
        if self.points is None or self.worth is None:
            return None
        return self.worth * (1 - self.points / 100)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rollup:
    """A group of loops as one line.

    Attributes
    ----------
    name : str
        Area, unit, or empty for the plant.
    loops, assessable : int
        How many there are, and how many could be judged.
    points : float or None
        Mean grade by weight of those that could; None where none could. [-]
    cost : float or None
        What a day costs, over the loops whose worth is known; None without any. [money]
    priced : int
        Loops that the cost rests on.
    causes : tuple of (str, int)
        What is wrong how often, the most frequent first.
    """

    name: str
    loops: int
    assessable: int
    points: float | None
    cost: float | None
    priced: int
    causes: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantScorecard:
    """How the plant stands.

    Attributes
    ----------
    plant : Rollup
        All loops.
    areas : tuple of Rollup
        Area by area, the worst first.
    bad_actors : tuple of Scored
        Loops that cost the most, the worst first; healthy ones are not among them.
    """

    plant: Rollup
    areas: tuple[Rollup, ...]
    bad_actors: tuple[Scored, ...]


class Order(StrEnum):
    """By what bad actors are ordered."""

    LOSS = "loss"
    COST = "cost"


def plant_scorecard(
    loops: Iterable[Scored], *, bad_actors: int = 20, by: Order = Order.LOSS
) -> PlantScorecard:
    """Roll the loops of a plant up.

    Parameters
    ----------
    loops : iterable of Scored
        One entry a loop.
    bad_actors : int
        Length of the list of the worst.
    by : Order
        What makes one worse than another: weight times missing points, or money. Loops whose
        worth is not known come after those whose is.
    """
    every = list(loops)
    areas = _grouped(every, lambda loop: loop.area)
    # A loop that could not be judged has no loss; it is counted, not blamed.
    suspects = [loop for loop in every if loop.loss > 0 and loop.cause != Cause.HEALTHY.value]
    return PlantScorecard(
        plant=_rolled("", every),
        areas=tuple(sorted(areas, key=_worst_first)),
        bad_actors=tuple(sorted(suspects, key=WORST[by])[:bad_actors]),
    )


WORST: Mapping[Order, Callable[[Scored], tuple[float, float, str]]] = {
    Order.LOSS: lambda loop: (-loop.loss, 0.0, loop.tag),
    Order.COST: lambda loop: (-(loop.cost or 0.0), -loop.loss, loop.tag),
}


def _grouped(loops: Sequence[Scored], key: Callable[[Scored], str]) -> list[Rollup]:
    names = dict.fromkeys(key(loop) for loop in loops)
    return [_rolled(name, [loop for loop in loops if key(loop) == name]) for name in names]


def _rolled(name: str, loops: Sequence[Scored]) -> Rollup:
    judged = [(loop.weight, loop.points) for loop in loops if loop.points is not None]
    weight = sum(w for w, _ in judged)
    costs = [loop.cost for loop in loops if loop.cost is not None]
    return Rollup(
        name=name,
        loops=len(loops),
        assessable=len(judged),
        points=sum(w * p for w, p in judged) / weight if judged else None,
        cost=sum(costs) if costs else None,
        priced=len(costs),
        causes=tuple(Counter(loop.cause for loop in loops).most_common()),
    )


def _worst_first(line: Rollup) -> tuple[float, str]:
    return (101.0 if line.points is None else line.points, line.name)
