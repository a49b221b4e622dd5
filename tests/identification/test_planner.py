"""Planned step and relay tests, run on processes that nobody guessed exactly."""

import math

import numpy as np
import pytest

from identification.held_input import HeldInput
from identification.identify import identify
from identification.least_squares import fopdt_least_squares
from identification.planner import StepPlan, Wishes, plan_steps, planned_errors
from identification.pulse_planner import PulseWishes, plan_pulses
from identification.relay_model import relay_model
from identification.relay_planner import RelayPlan, plan_relay
from loop.controller import Action
from loop.errors import NoLimitCycle
from loop.open_loop import process_output
from loop.process import FOPDT, IPDT
from loop.record import Record
from loop.relay_feedback import Relay, simulate_relay

HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


def stepped(plan: StepPlan, true: FOPDT, noise: float, rng: np.random.Generator) -> Record:
    t = np.arange(0.0, plan.duration, plan.sample_time)
    op = np.append(0.0, plan.levels)[np.searchsorted(plan.times, t, side="right")]
    pv = process_output(true, t, op) + rng.normal(0, noise, t.size)
    return Record(t=t, pv=pv, op=op)


def relayed(plan: RelayPlan, true: FOPDT, noise: float, rng: np.random.Generator) -> Record:
    run = simulate_relay(
        true,
        Relay(
            amplitude=plan.amplitude,
            bias=plan.bias,
            hysteresis=plan.hysteresis,
            action=Action.for_gain(true.K),
        ),
        t_end=plan.cycles * plan.longest_period,
        dt=plan.sample_time,
        noise=noise,
        rng=rng,
    )
    rest = int(plan.rest / plan.sample_time)
    pv = np.append(rng.normal(0, noise, rest), run.pv)
    op = np.append(np.zeros(rest), run.op)
    ups = np.flatnonzero((op[1:] > plan.bias) & (op[:-1] <= plan.bias))
    end = ups[plan.cycles] + 2 if ups.size > plan.cycles else op.size
    return Record(t=plan.sample_time * np.arange(end), pv=pv[:end], op=op[:end])


def near(guess: FOPDT, factor: float, rng: np.random.Generator) -> FOPDT:
    off = np.exp(rng.uniform(-math.log(factor), math.log(factor), 3))
    return FOPDT(K=guess.K * off[0], tau=guess.tau * off[1], theta=guess.theta * off[2])


def test_planned_step_tests_are_accepted_and_reach_their_errors() -> None:
    rng = np.random.default_rng(5)
    refused, reached = 0, []
    for _ in range(6):
        guess = FOPDT(K=-2.0, tau=60.0, theta=60.0 * 10 ** rng.uniform(-1.3, 0.5))
        noise = 10 ** rng.uniform(-2.0, -1.0)
        plan = plan_steps(Wishes(guess=guess, noise=noise, deviation=1.0))
        assert plan.reaches
        record = stepped(plan, near(guess, 1.5, rng), noise, rng)
        assert np.max(np.abs(record.pv)) < plan.abort_deviation + 4 * noise
        found = identify(record)
        refused += found.process is None
        if found.kind == "FOPDT":
            assert found.standard_errors is not None
            reached.append(np.all(found.standard_errors < 1.05 * np.array(plan.largest_errors)))
    assert refused == 0
    assert len(reached) >= 5
    assert all(reached)


def test_planned_relay_tests_are_accepted_and_reach_their_errors() -> None:
    rng = np.random.default_rng(7)
    for _ in range(6):
        guess = FOPDT(K=-1.0, tau=1.0, theta=10 ** rng.uniform(-0.7, 0.5))
        plan = plan_relay(Wishes(guess=guess, noise=0.02, deviation=1.0, factor=1.3))
        assert plan.reaches
        record = relayed(plan, near(guess, 1.3, rng), 0.02, rng)
        assert np.max(np.abs(record.pv)) < plan.abort_deviation
        found = relay_model(record, hysteresis=plan.hysteresis).model
        assert found.process is not None, found.reasons
        assert found.standard_errors is not None
        assert np.all(found.standard_errors < 1.05 * np.array(plan.largest_errors))


def test_the_expected_errors_are_those_of_the_fit() -> None:
    plan = plan_steps(Wishes(guess=HEATER, noise=0.2, deviation=9.0, factor=1.0))
    record = stepped(plan, HEATER, 0.2, np.random.default_rng(0))
    held = HeldInput.from_samples(record.t, record.op)
    fit = fopdt_least_squares(record.t, record.pv, held)
    expected = np.array(plan.expected_errors) * fit.noise_sd / 0.2
    np.testing.assert_allclose(fit.standard_errors[:3], expected, rtol=0.05)
    assert plan.expected_errors == plan.largest_errors


def test_very_many_samples_count_by_their_number() -> None:
    held = HeldInput(instants=np.array([100.0]), levels=np.array([0.0, 1.0]))
    fine, finer = (
        planned_errors(HEATER, held, duration=800.0, sample_time=dt, noise=0.1)
        for dt in (0.2, 0.05)
    )
    np.testing.assert_allclose(finer, fine / 2, rtol=0.02)


def test_what_a_test_does_not_show_has_a_huge_error() -> None:
    held = HeldInput(instants=np.array([100.0]), levels=np.array([0.0, 1.0]))
    errors = planned_errors(HEATER, held, duration=120.0, sample_time=1.0, noise=0.1)
    assert np.all(np.isfinite(errors))
    assert errors[1] == 0 or errors[1] > 1e3  # PV has not moved at all
    shown = planned_errors(HEATER, held, duration=160.0, sample_time=1.0, noise=0.1)
    assert shown[1] > HEATER.tau / 4


def test_more_noise_takes_more_moves_and_in_the_end_the_plan_says_no() -> None:
    plans = [
        plan_steps(Wishes(guess=HEATER, noise=noise, deviation=9.0)) for noise in (0.2, 1.5, 8.0)
    ]
    assert len(plans[0].times) < len(plans[1].times)
    assert not plans[2].reaches
    assert any("not reached" in remark for remark in plans[2].remarks)
    assert any("allow a larger deviation" in remark for remark in plans[2].remarks)
    two = [p for p in plans if len(p.times) > 2]
    assert all({-p.step, 0.0, p.step} == set(p.levels) for p in two)


@pytest.mark.parametrize(
    ("up", "down", "first", "levels"),
    [(5.0, 0.0, 1.0, {0.0, 1.0}), (0.0, 5.0, -1.0, {0.0, -1.0}), (5.0, 5.0, 1.0, {-1.0, 0.0, 1.0})],
)
def test_the_room_of_the_output_decides_the_directions(
    up: float, down: float, first: float, levels: set[float]
) -> None:
    plan = plan_steps(Wishes(guess=HEATER, noise=1.0, deviation=6.0, room_up=up, room_down=down))
    assert plan.levels[0] == first * plan.step
    assert {round(level / plan.step) for level in plan.levels} <= levels
    assert plan.answer == pytest.approx(HEATER.K * plan.levels[0])


def test_a_small_room_and_a_slow_sampling_are_named() -> None:
    plan = plan_steps(
        Wishes(
            guess=HEATER, noise=0.05, deviation=9.0, room_up=0.5, room_down=0.2, sample_time=20.0
        )
    )
    assert plan.step == 0.5
    assert plan.sample_time == 20.0
    text = " ".join(plan.remarks)
    assert "room of OP" in text
    assert "coarse" in text


def test_units_change_only_what_they_measure() -> None:
    one = plan_steps(Wishes(guess=HEATER, noise=0.3, deviation=9.0))
    fast = FOPDT(K=2.0, tau=2.0, theta=0.5)
    other = plan_steps(Wishes(guess=fast, noise=0.3, deviation=9.0))
    assert other.duration == pytest.approx(one.duration / 60)
    np.testing.assert_allclose(other.expected_errors[0], one.expected_errors[0], rtol=0.02)
    np.testing.assert_allclose(other.expected_errors[1], one.expected_errors[1] / 60, rtol=0.02)


def test_a_relay_that_cannot_clear_the_noise_is_refused_with_what_would_do() -> None:
    with pytest.raises(NoLimitCycle, match="swing clear") as refusal:
        plan_relay(Wishes(guess=HEATER, noise=0.1, deviation=1.2))
    wanted = float(str(refusal.value).split("with it a deviation of ")[1].split()[0].rstrip("."))
    assert plan_relay(Wishes(guess=HEATER, noise=0.1, deviation=1.01 * wanted)).amplitude > 0
    with pytest.raises(NoLimitCycle, match="room of OP leave"):
        plan_relay(Wishes(guess=HEATER, noise=0.1, deviation=9.0, room_down=0.0))
    with pytest.raises(NoLimitCycle, match="Without dead time"):
        plan_relay(Wishes(guess=FOPDT(K=1.0, tau=1.0, theta=0.0), noise=0.1, deviation=9.0))


def test_a_relay_test_that_does_not_reach_the_precision_says_so() -> None:
    guess = FOPDT(K=1.0, tau=30.0, theta=1.0)
    plan = plan_relay(Wishes(guess=guess, noise=0.005, deviation=0.2, factor=1.2, precision=0.001))
    assert not plan.reaches
    assert plan.cycles == 22
    assert "a step test shows K and tau better" in plan.remarks[1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"noise": 0.0}, "noise must be positive"),
        ({"deviation": math.inf}, "deviation must be positive"),
        ({"precision": -1.0}, "precision must be positive"),
        ({"factor": 0.9}, "factor must lie within 1 and 5"),
        ({"room_up": 0.0, "room_down": 0.0}, "nor both 0"),
        ({"room_up": -1.0}, "must not be negative"),
        ({"sample_time": 0.0}, "sample_time must be positive"),
    ],
)
def test_impossible_wishes_are_refused(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Wishes(**{"guess": HEATER, "noise": 0.1, "deviation": 1.0, **change})


def test_planned_pulses_on_integrators_are_accepted_and_reach_their_errors() -> None:
    refused, outside = 0, 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        K, theta = 10 ** rng.uniform(-4, -1) * rng.choice([-1, 1]), 10 ** rng.uniform(0, 2)
        deviation = rng.uniform(1, 10)
        noise = deviation * 10 ** rng.uniform(-2.5, -1.2)
        guess = IPDT(K=K, theta=theta)
        plan = plan_pulses(PulseWishes(guess=guess, noise=noise, deviation=deviation))
        assert plan.reaches
        off = 1.5 ** rng.uniform(-1, 1, 2)
        true = IPDT(K=K * off[0], theta=theta * off[1])
        t = np.arange(0.0, plan.duration, plan.sample_time)
        op = np.append(0.0, plan.levels)[np.searchsorted(plan.times, t, side="right")]
        still = process_output(true, t, op)
        assert np.ptp(still) <= 1.01 * deviation  # never further than allowed
        pv = 50 + still + rng.normal(0, noise, t.size) + 0.05 * deviation * t / plan.duration
        found = identify(Record(t=t, pv=pv, op=40 + op))
        if not isinstance(found.process, IPDT):
            refused += 1
            continue
        assert found.standard_errors is not None
        errors = found.standard_errors[[0, -1]]
        outside += bool(np.any(errors > 1.5 * np.array(plan.largest_errors)))
        assert abs(found.process.K / true.K - 1) < 0.1
    assert refused <= 1
    assert outside <= 1


def test_pulses_keep_within_the_room_and_say_what_they_cannot() -> None:
    tank = IPDT(K=0.002, theta=10.0)
    given = {"noise": 0.05, "deviation": 2.0}
    plan = plan_pulses(PulseWishes(guess=tank, **given))
    assert (len(plan.times), plan.levels[1], sum(np.sign(plan.levels))) == (4, 0.0, 0.0)
    small = plan_pulses(PulseWishes(guess=tank, room_up=3.0, room_down=3.0, **given))
    assert small.step == 3.0
    assert small.hold > plan.hold
    assert any("the room of OP" in remark for remark in small.remarks)
    one_way = plan_pulses(PulseWishes(guess=tank, room_up=0.0, **given))
    assert one_way.levels == (-plan.step, 0.0)
    assert any("one direction only" in remark for remark in one_way.remarks)
    loud = plan_pulses(PulseWishes(guess=tank, noise=4.0, deviation=2.0))
    assert not loud.reaches
    assert any("are not reached" in remark for remark in loud.remarks)
    with pytest.raises(ValueError, match="needs the sample time"):
        PulseWishes(guess=IPDT(K=0.002, theta=0.0), **given)
    sampled = plan_pulses(PulseWishes(guess=IPDT(K=0.002, theta=0.0), sample_time=5.0, **given))
    assert sampled.hold == 300.0
    # Another unit of time changes times and the gain alone.
    faster = plan_pulses(PulseWishes(guess=IPDT(K=0.12, theta=10 / 60), **given))
    assert faster.step == pytest.approx(plan.step)
    assert faster.duration == pytest.approx(plan.duration / 60)
