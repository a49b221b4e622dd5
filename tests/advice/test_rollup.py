"""The plant's scorecard from the loops' grades."""

import pytest

from advice.rollup import Order, Scored, plant_scorecard


def loop(
    tag: str,
    points: float | None,
    *,
    weight: float = 1.0,
    area: str = "A",
    cause: str = "valve",
) -> Scored:
    return Scored(name=tag, tag=tag, area=area, unit="", weight=weight, points=points, cause=cause)


def test_the_mean_grade_counts_loops_by_weight_and_leaves_out_the_unknown() -> None:
    card = plant_scorecard([loop("a", 90.0, weight=3.0), loop("b", 50.0), loop("c", None)])

    assert card.plant.points == pytest.approx((3 * 90 + 50) / 4)
    assert (card.plant.loops, card.plant.assessable) == (3, 2)


def test_areas_come_worst_first_and_unknown_ones_last() -> None:
    card = plant_scorecard(
        [loop("a", 90.0, area="good"), loop("b", 20.0, area="bad"), loop("c", None, area="dark")]
    )
    assert [area.name for area in card.areas] == ["bad", "good", "dark"]


def test_bad_actors_are_what_costs_most_not_what_is_worst_and_never_the_healthy() -> None:
    card = plant_scorecard(
        [
            loop("small", 10.0, weight=0.1),
            loop("large", 60.0, weight=5.0),
            loop("fine", 70.0, weight=50.0, cause="healthy"),
            loop("dark", None, weight=50.0),
        ],
        bad_actors=1,
    )
    assert [bad.tag for bad in card.bad_actors] == ["large"]
    assert card.bad_actors[0].loss == pytest.approx(200.0)


def test_a_plant_without_loops_has_no_grade() -> None:
    card = plant_scorecard([])
    assert (card.plant.points, card.areas, card.bad_actors) == (None, (), ())


def test_doubling_every_weight_changes_no_grade_and_no_order() -> None:
    some = [("a", 40.0, 1.0), ("b", 70.0, 3.0), ("c", 10.0, 0.5)]
    once = plant_scorecard([loop(t, p, weight=w) for t, p, w in some])
    twice = plant_scorecard([loop(t, p, weight=2 * w) for t, p, w in some])
    assert once.plant.points == pytest.approx(twice.plant.points)
    assert [b.tag for b in once.bad_actors] == [b.tag for b in twice.bad_actors]


def test_money_is_the_worth_of_what_the_grade_lacks_and_never_a_guess() -> None:
    dear = Scored(
        name="d", tag="d", area="A", unit="", weight=0.1, points=60.0, cause="valve", worth=1000.0
    )
    loops = [dear, loop("bad", 10.0), loop("dark", None)]
    card = plant_scorecard(loops, by=Order.COST)
    assert dear.cost == pytest.approx(400.0)
    assert card.plant.cost == pytest.approx(400.0)
    assert card.plant.priced == 1
    assert [one.tag for one in card.bad_actors] == ["d", "bad"]
    assert [one.tag for one in plant_scorecard(loops).bad_actors] == ["bad", "d"]
    assert plant_scorecard([loop("bad", 10.0)]).plant.cost is None
