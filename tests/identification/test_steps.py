"""Moves of the output: what is found, where, and what is not a move."""

import numpy as np
import pytest

from identification.steps import find_moves, output_noise
from loop.errors import NoStepFound


def staircase(*levels: float, hold: int = 100) -> np.ndarray:
    return np.repeat(np.array(levels, dtype=float), hold)


def clock(op: np.ndarray, spacing: float = 1.0) -> np.ndarray:
    return np.arange(op.size) * spacing


def test_one_step_is_found_at_the_sample_that_shows_it_first() -> None:
    op = staircase(40, 50)
    (step,) = find_moves(clock(op, 0.25), op).steps
    assert (step.first, step.last, step.start, step.end, step.instant) == (100, 100, 25, 25, 25)
    assert (step.op_from, step.op_to, step.size, step.direction) == (40, 50, 10, "up")


def test_steps_up_and_down_are_found_in_order() -> None:
    op = staircase(40, 50, 45, 60)
    steps = find_moves(clock(op), op).steps
    assert [s.size for s in steps] == [10, -5, 15]
    assert [s.direction for s in steps] == ["up", "down", "up"]
    assert [s.start for s in steps] == [100, 200, 300]


def test_steps_in_one_direction_stay_apart_when_held_between() -> None:
    op = staircase(40, 45, 50)
    assert [s.op_to for s in find_moves(clock(op), op).steps] == [45, 50]


def test_a_pulse_is_two_steps() -> None:
    op = np.full(300, 20.0)
    op[100:104] = 25.0
    steps = find_moves(clock(op), op).steps
    assert [(s.first, s.size) for s in steps] == [(100, 5), (104, -5)]


def test_a_ramp_is_one_move_centred_on_its_middle() -> None:
    op = np.concatenate((np.full(100, 30.0), np.linspace(30, 50, 41)[1:], np.full(200, 50.0)))
    (step,) = find_moves(clock(op), op).steps
    assert (step.start, step.end) == (100, 139)
    assert step.instant == pytest.approx(119.5, abs=0.01)
    assert (step.op_from, step.op_to) == (30, 50)


def test_a_quantised_slow_ramp_is_one_move() -> None:
    ramp = np.repeat(np.arange(30.0, 35.5, 0.5), 4)
    op = np.concatenate((np.full(400, 30.0), ramp, np.full(600, 35.0)))
    (step,) = find_moves(clock(op), op).steps
    assert (step.op_from, step.op_to) == (30, 35)
    assert step.end - step.start == pytest.approx(36, abs=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_steps_are_found_under_noise_with_their_mean_levels(seed: int) -> None:
    rng = np.random.default_rng(seed)
    op = staircase(40, 50, 44) + rng.normal(0, 0.5, 300)
    found = find_moves(clock(op), op)
    assert [round(s.size) for s in found.steps] == [10, -6]
    assert [s.first for s in found.steps] == pytest.approx([100, 200], abs=1)
    assert found.noise_sd == pytest.approx(0.5, rel=0.3)


def test_toggling_of_the_last_digit_is_not_a_move() -> None:
    rng = np.random.default_rng(4)
    op = staircase(40, 44) + 0.5 * (rng.random(200) < 0.3)
    (step,) = find_moves(clock(op), op).steps
    assert (step.first, step.size) == (100, 4)


def test_a_small_move_beside_a_large_one_is_left_out() -> None:
    op = staircase(40, 40.1, 50)
    assert [s.op_to for s in find_moves(clock(op), op).steps] == [50]


def test_a_fast_test_signal_is_not_taken_for_noise() -> None:
    rng = np.random.default_rng(1)
    op = np.repeat(rng.choice([40.0, 60.0], 60), 4)
    changes = int(np.count_nonzero(np.diff(op)))
    assert len(find_moves(clock(op), op).steps) == changes


def test_the_output_before_the_first_row_makes_a_step_at_the_first_row() -> None:
    op = np.full(50, 30.0)
    (step,) = find_moves(clock(op) + 7, op, op_before=10.0).steps
    assert (step.first, step.start, step.op_from, step.op_to) == (0, 7, 10, 30)


def test_the_output_before_the_first_row_holds_under_noise_as_well() -> None:
    op = 30 + np.random.default_rng(2).normal(0, 0.3, 100)
    (step,) = find_moves(clock(op), op, op_before=10.0).steps
    assert (step.first, step.op_from) == (0, 10)
    assert step.op_to == pytest.approx(30, abs=0.2)


@pytest.mark.parametrize(
    ("op", "before", "words"),
    [
        (np.full(50, 30.0), None, "--op-before"),
        (np.full(50, 30.0), 30.0, "also the OP before"),
        (30 + np.random.default_rng(0).normal(0, 0.2, 500), None, "only jitters"),
        (np.array([30.0]), None, "no move"),
        (
            staircase(0, 2.4, 4.8, hold=500) + np.random.default_rng(0).normal(0, 1, 1500),
            None,
            "wanders",
        ),
    ],
)
def test_an_output_without_a_move_is_refused(
    op: np.ndarray, before: float | None, words: str
) -> None:
    with pytest.raises(NoStepFound, match=words):
        find_moves(clock(op), op, before)


def test_an_output_that_stands_still_has_no_noise() -> None:
    assert output_noise(staircase(1, 2, 3)) == 0


@pytest.mark.parametrize(("scale", "shift", "speed"), [(0.01, 5, 60), (-250, -3, 1 / 3600)])
def test_units_of_output_and_time_change_nothing_else(
    scale: float, shift: float, speed: float
) -> None:
    op = staircase(40, 50, 44) + np.random.default_rng(7).normal(0, 0.4, 300)
    steps = find_moves(clock(op), op).steps
    other = find_moves(clock(op) * speed, op * scale + shift).steps
    assert [s.first for s in other] == [s.first for s in steps]
    assert [s.size for s in other] == pytest.approx([s.size * scale for s in steps])
    assert [s.instant for s in other] == pytest.approx([s.instant * speed for s in steps])
