"""Settings over a box and over draws: proofs, plants that break a faster answer, counts."""

import math
from dataclasses import replace

import numpy as np
import pytest

from loop.batch import PIDBatch, ProcessBatch
from loop.errors import RuleNotApplicable
from loop.margin_batch import batch_margins
from loop.process import FOPDT, IPDT, SOPDT, Process, TransferFunction
from loop.signals import Real
from tuning.box_verdict import hold_box
from tuning.loop_limits import LoopLimits
from tuning.optimal import optimal
from tuning.optimal_robust import optimal_over_box, optimal_over_draws
from tuning.optimal_search import Structure
from tuning.profiles import PROFILES

GENERAL = PROFILES["general"]
LIMITS = LoopLimits.of(GENERAL)
HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


def _draws(n: int = 100) -> Real:
    rng = np.random.default_rng(4)
    spread = np.exp(np.array([0.15, 0.2, 0.15]) * rng.standard_normal((n, 3)))
    return np.asarray(np.array([2.0, 120.0, 30.0]) * spread)


@pytest.mark.parametrize("structure", ["PI", "PID"])
@pytest.mark.parametrize(
    "process",
    [
        HEATER,
        FOPDT(K=1.0, tau=1.0, theta=3.0),
        SOPDT(K=2.0, tau1=120.0, tau2=20.0, theta=20.0),
        IPDT(K=0.1, theta=5.0),
    ],
)
def test_over_a_box_the_limits_are_proven_and_a_little_faster_breaks_them(
    process: Process, structure: Structure
) -> None:
    found = optimal_over_box(process, LIMITS, structure=structure)
    assert found.verdict.holds is True
    assert hold_box(process, found.settings.pid, GENERAL).holds is True
    faster = replace(found.settings.pid, Kc=1.015 * found.settings.pid.Kc)
    assert hold_box(process, faster, GENERAL).holds is False


def test_robustness_costs_area_and_a_smaller_box_costs_less() -> None:
    areas = [
        optimal_over_box(HEATER, LIMITS, errors=(e, e, e)).settings.load_IAE
        for e in (0.0, 0.2, 0.5)
    ]
    assert areas == sorted(areas)
    assert areas[0] == pytest.approx(optimal(HEATER, LIMITS).load_IAE, rel=0.01)


def test_a_general_process_has_a_proven_optimum_too() -> None:
    lags = TransferFunction((1.0,), (1.0, 3.0, 3.0, 1.0), 0.5)
    found = optimal_over_box(lags, LIMITS, errors=(0.2, 0.2, 0.2))
    assert found.verdict.holds is True
    assert found.settings.margins.Ms < 2.0


def test_the_stated_part_of_the_draws_keeps_the_limits() -> None:
    draws = _draws()
    areas = []
    for probability in (1.0, 0.9):
        found = optimal_over_draws(HEATER, draws, LIMITS, probability=probability)
        plants = ProcessBatch(
            K=draws[:, 0],
            tau1=draws[:, 1],
            tau2=np.zeros(1),
            integrators=np.zeros(1, dtype=int),
            theta=draws[:, 2],
        )
        kept = batch_margins(plants, PIDBatch.of(found.settings.pid))
        holds = kept.stable & (kept.Ms <= 2.0) & (kept.phase >= 45.0)
        holds &= kept.gain >= GENERAL.gain
        assert found.draws == 100
        assert found.missed == 100 - np.count_nonzero(holds)
        assert found.probability == np.mean(holds) >= probability
        assert found.at_least < found.probability
        areas.append(found.settings.load_IAE)
    assert areas[1] < 0.9 * areas[0]


def test_the_confidence_bound_is_the_exact_binomial_one() -> None:
    """With none missed of n the bound b solves b^n = .05."""
    found = optimal_over_draws(HEATER, _draws(60), LIMITS, probability=1.0)
    assert found.missed == 0
    assert found.at_least == pytest.approx(0.05 ** (1 / 60), rel=1e-12)


def test_draws_without_spread_give_the_optimum_of_the_model() -> None:
    draws = np.tile([2.0, 120.0, 30.0], (20, 1))
    found = optimal_over_draws(HEATER, draws, LIMITS)
    alone = optimal(HEATER, LIMITS)
    assert found.settings.pid.Kc == pytest.approx(alone.pid.Kc, rel=1e-3)
    assert found.settings.load_IAE == pytest.approx(alone.load_IAE, rel=1e-3)


@pytest.mark.parametrize(
    ("process", "values"),
    [
        (SOPDT(K=2.0, tau1=120.0, tau2=100.0, theta=20.0), [2.0, 120.0, 100.0, 20.0]),
        (IPDT(K=0.1, theta=5.0), [0.1, 5.0]),
    ],
)
def test_draws_of_other_kinds_come_in_the_order_of_their_parameters(
    process: SOPDT | IPDT, values: list[float]
) -> None:
    rng = np.random.default_rng(8)
    draws = np.array(values) * np.exp(0.1 * rng.standard_normal((40, len(values))))
    found = optimal_over_draws(process, draws, LIMITS, probability=0.9)
    assert found.missed <= 4
    assert found.settings.load_IAE > optimal(process, LIMITS).load_IAE


def test_impossible_draws_are_refused_in_words() -> None:
    with pytest.raises(ValueError, match="at least 20 rows"):
        optimal_over_draws(HEATER, _draws()[:5], LIMITS)
    with pytest.raises(ValueError, match="at least 20 rows"):
        optimal_over_draws(HEATER, _draws()[:, :2], LIMITS)
    with pytest.raises(ValueError, match=r"probability must lie within 0\.5 and 1"):
        optimal_over_draws(HEATER, _draws(), LIMITS, probability=0.3)
    mixed = _draws()
    mixed[0, 0] = -2.0
    with pytest.raises(ValueError, match="both signs"):
        optimal_over_draws(HEATER, mixed, LIMITS)
    mixed[0] = math.nan
    with pytest.raises(ValueError, match="K must lie within"):
        optimal_over_draws(HEATER, mixed, LIMITS)


def test_a_box_that_nothing_survives_is_refused() -> None:
    with pytest.raises(RuleNotApplicable, match="no settings"):
        optimal_over_box(IPDT(K=1.0, theta=1.0), LoopLimits(Ms=1.02, phase=80.0))
