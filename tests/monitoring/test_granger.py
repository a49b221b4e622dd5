"""Granger causality: plain regressions, a closed form, and limit cycles that tell nothing."""

import numpy as np
import pytest
from scipy import stats

from loop.signals import Real
from monitoring.granger import f_tail, granger, var_order

N = 600


def chain(seed: int = 1, n: int = N) -> Real:
    """0 drives 1, 1 drives 2, and 3 is alone."""
    e = np.random.default_rng(seed).normal(size=(4, n))
    x = np.zeros((4, n))
    for t in range(2, n):
        x[:, t] = 0.5 * x[:, t - 1] + e[:, t]
        x[1, t] += 0.5 * x[0, t - 2]
        x[2, t] += 0.5 * x[1, t - 1]
    return x


def significant(signals: Real) -> set[tuple[int, int]]:
    return {(a.cause, a.effect) for a in granger(signals).arrows if a.significant}


def by_plain_regression(signals: Real, cause: int, effect: int, order: int) -> tuple[float, float]:
    """Strength and F of the definition, by numpy's own least squares on lags cut out one by one."""
    m, n = signals.shape
    y = signals[effect, order:]

    def left(rows: list[int]) -> float:
        X = [np.ones(n - order)]
        X += [signals[r, order - k : n - k] for r in rows for k in range(1, order + 1)]
        return float(np.linalg.lstsq(np.array(X).T, y, rcond=None)[1][0])

    without, told = left([r for r in range(m) if r != cause]), left([*range(m)])
    freedom = n - order - m * order - 1
    return np.log(without / told), (without - told) / order / (told / freedom)


def test_strength_and_f_test_are_those_of_the_definition() -> None:
    x = chain()
    found = granger(x)
    assert found.order == 2
    assert found.conditional
    assert len(found.arrows) == 12
    for arrow in found.arrows:
        strength, F = by_plain_regression(x, arrow.cause, arrow.effect, 2)
        assert arrow.strength == pytest.approx(strength, rel=1e-8, abs=1e-10)
        tail = stats.f.sf(F, 2, N - 2 - 8 - 1)
        assert arrow.p_value == pytest.approx(tail, rel=1e-6, abs=1e-300)


@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_f_of_two_loops_is_that_of_statsmodels() -> None:
    """Needs the dependency group `bench`; both sides see the same rows and the same order."""
    stattools = pytest.importorskip("statsmodels.tsa.stattools")
    pair = chain()[:2]
    found = granger(pair)
    assert found.order is not None
    freedom = N - found.order - (2 * found.order + 1)
    for arrow in found.arrows:
        both = np.column_stack([pair[arrow.effect], pair[arrow.cause]])
        tests = stattools.grangercausalitytests(both, [found.order])[found.order][0]
        F, p_value, within, between = tests["ssr_ftest"]
        assert (between, within) == (found.order, freedom)
        assert np.expm1(arrow.strength) * freedom / found.order == pytest.approx(F, rel=1e-8)
        assert arrow.p_value == pytest.approx(p_value, rel=1e-6, abs=1e-300)


def test_the_strength_of_a_white_cause_is_that_of_the_closed_form() -> None:
    """y = a x one sample later plus e: ln(1 + a² var(x)/var(e)), with n large."""
    rng = np.random.default_rng(2)
    x, e = rng.normal(size=(2, 20_000))
    y = 0.7 * np.roll(x, 1) + 0.5 * e
    (there, back) = granger(np.array([x, y]), most_lags=1).arrows
    # The standard error of a log of a mean square is sqrt(2/n) for each of two: 0.02 for both.
    assert there.strength == pytest.approx(np.log(1 + 0.7**2 / 0.5**2), abs=0.04)
    assert there.significant
    assert not back.significant


def test_a_chain_has_its_own_arrows_and_none_through_a_third_loop() -> None:
    assert significant(chain()) == {(0, 1), (1, 2)}


def test_without_rows_for_all_at_once_pairs_are_looked_at_alone() -> None:
    found = granger(chain(n=130))
    assert not found.conditional
    assert found.drives(0, 1)
    assert not found.drives(1, 0)


def test_units_signs_offsets_and_the_order_of_the_loops_change_nothing() -> None:
    x = chain()
    plain = {(a.cause, a.effect): a for a in granger(x).arrows}
    order = [2, 0, 3, 1]
    scale = np.array([[3.0], [-0.01], [1e4], [1.0]])
    for arrow in granger(scale * x[order] + 7.0).arrows:
        same = plain[order[arrow.cause], order[arrow.effect]]
        assert arrow.strength == pytest.approx(same.strength, abs=1e-9)
        assert arrow.significant == same.significant


def test_loops_of_one_limit_cycle_predict_each_other_and_are_no_causes() -> None:
    """Every noisy copy of a wave helps to tell every other: F is sure of it, and wrong."""
    rng = np.random.default_rng(3)
    t = np.arange(N)
    copies = np.array([np.sin(2 * np.pi * (t - late) / 20) for late in (0, 3, 6)])
    found = granger(copies + 0.3 * rng.normal(size=copies.shape))
    assert sum(arrow.p_value < 1e-3 for arrow in found.arrows) >= 2
    assert not any(arrow.significant for arrow in found.arrows)


def test_independent_loops_have_no_arrows() -> None:
    for seed in range(5):
        x = np.zeros((3, N))
        e = np.random.default_rng(seed).normal(size=x.shape)
        for t in range(1, N):
            x[:, t] = 0.9 * x[:, t - 1] + e[:, t]
        assert significant(x) == set()


def test_the_order_is_that_of_the_process() -> None:
    e = np.random.default_rng(4).normal(size=(2, 3000))
    x = np.zeros((2, 3000))
    for t in range(3, 3000):
        x[:, t] = 0.3 * x[:, t - 1] - 0.5 * x[:, t - 3] + e[:, t]
    assert var_order(x, 8) == 3


@pytest.mark.parametrize(("F", "between", "within"), [(0.0, 2, 30), (1.3, 4, 100), (12.0, 3, 60)])
def test_the_tail_of_f_is_that_of_scipy(F: float, between: int, within: int) -> None:
    assert f_tail(F, between, within) == pytest.approx(stats.f.sf(F, between, within), rel=1e-10)


@pytest.mark.parametrize(
    ("signals", "reason"),
    [
        (np.zeros((1, 500)), "a single loop has nobody"),
        (np.vstack([np.ones(500), np.arange(500.0)]), "signal 1 does not move"),
        (np.random.default_rng(0).normal(size=(2, 2)), "2 samples are too few"),
        (np.random.default_rng(0).normal(size=(2, 50)), "50 samples are too few"),
    ],
)
def test_what_cannot_be_tested_says_why(signals: Real, reason: str) -> None:
    found = granger(signals)
    assert found.arrows == ()
    assert reason in found.reason


def test_gaps_and_single_signals_are_refused() -> None:
    with pytest.raises(ValueError, match="gaps bridged or left out"):
        granger(np.array([[1.0, np.nan], [1.0, 2.0]]))
    with pytest.raises(ValueError, match="rows of finite numbers"):
        granger(np.ones(5))
