import numpy as np
import pytest
from scipy.signal import lfilter

from loop.signals import Real
from monitoring.before_after import Change, before_after


def slow(n: int, seed: int, keep: float = 0.9, size: float = 1.0) -> Real:
    white = np.random.default_rng(seed).normal(size=n)
    return np.asarray(size * lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], white))


def test_a_clear_improvement_is_better_and_the_other_way_round_worse() -> None:
    before, after = slow(4000, 1), slow(4000, 2, size=0.5)
    better, worse = before_after(before, after), before_after(after, before)
    assert better.change is Change.BETTER
    assert worse.change is Change.WORSE
    assert better.ratio is not None
    assert better.ratio == pytest.approx(np.sqrt(np.mean(after**2) / np.mean(before**2)))
    assert worse.ratio is not None
    assert better.ratio == pytest.approx(1 / worse.ratio)
    assert better.low is not None
    assert better.high is not None
    assert better.low < better.ratio < better.high < 1
    assert better.probability == 1


def test_without_a_change_an_alarm_is_rare_although_the_error_remembers() -> None:
    pairs = [before_after(slow(3000, 2 * k, 0.95), slow(3000, 2 * k + 1, 0.95), draws=400)
             for k in range(60)]  # fmt: skip
    alarms = sum(one.change in (Change.BETTER, Change.WORSE) for one in pairs)
    assert alarms <= 9  # 5 % of 60 and three standard errors
    # drawing single samples, as if they knew nothing of each other, is wrong far more often
    naive = [before_after(slow(3000, 2 * k, 0.95), slow(3000, 2 * k + 1, 0.95), draws=400, block=1)
             for k in range(60)]  # fmt: skip
    assert sum(one.change is not Change.NO_DIFFERENCE for one in naive) > 20


def test_without_a_change_an_alarm_is_rare_although_the_error_has_an_offset() -> None:
    changed = 0
    for k in range(150):
        first, second = (3.0 * 2.3 + slow(1500, 2 * k + part) for part in (0, 1))
        changed += before_after(first, second, draws=200).change in (Change.BETTER, Change.WORSE)
    assert changed <= 15  # 5 % of 150 and three standard errors


def test_for_white_noise_the_interval_is_that_of_the_f_distribution() -> None:
    rng = np.random.default_rng(0)
    found = before_after(rng.normal(size=2000), rng.normal(size=2000), block=1)
    assert found.low is not None
    assert found.high is not None
    # sd of ln of a root of a ratio of two mean squares: sqrt(2/n + 2/n)/2
    assert np.log(found.high / found.low) == pytest.approx(
        2 * 1.96 * np.sqrt(4 / 2000) / 2, rel=0.1
    )


def test_the_same_seed_gives_the_same_answer() -> None:
    a, b = (before_after(slow(2000, 1), slow(2000, 2), seed=7) for _ in range(2))
    assert (a.low, a.high) == (b.low, b.high)


def test_too_little_data_are_not_compared() -> None:
    short = before_after(slow(2000, 1), slow(12, 2))
    assert short.change is Change.NOT_COMPARABLE
    assert short.basis.refused
    still = before_after(np.zeros(2000), slow(2000, 2), block=5)
    assert still.basis.reasons == ("one of the errors does not move",)
    drift = before_after(np.arange(2000.0), slow(2000, 2))
    assert drift.change is Change.NOT_COMPARABLE
    assert before_after(np.full(50, np.nan), slow(50, 2)).ratio is None


def resonant(n: int, seed: int) -> Real:
    """A lively loop: a wave of 50 samples that loses its phase within some hundred."""
    white = np.random.default_rng([seed, 4]).normal(size=n + 2000)
    r, w = 0.99, 2 * np.pi / 50
    return np.asarray(lfilter([1.0], [1.0, -2 * r * np.cos(w), r * r], white)[2000:])


def test_without_a_change_an_alarm_is_rare_although_the_error_swings() -> None:
    pairs = [before_after(resonant(6000, 2 * k), resonant(6000, 2 * k + 1), draws=300)
             for k in range(300)]  # fmt: skip
    alarms = sum(one.change in (Change.BETTER, Change.WORSE) for one in pairs)
    assert alarms <= 26  # 5 % of 300 and three standard errors
    truth = [one.low <= 1 <= one.high for one in pairs if one.low and one.high]
    assert np.mean(truth) > 0.91
