import math

import numpy as np
import pytest

from loop.controller import PID
from loop.frequency_curves import bandwidths
from loop.margins import margins
from loop.process import FOPDT, IPDT, Process, TransferFunction
from loop.stability import unstable_poles
from tuning.performance_limits import (
    Bound,
    crossover_feasibility,
    fastest_crossover,
    largest_lead,
    performance_limits,
)

UNSTABLE = TransferFunction((1.0,), (10.0, -1.0), 2.0)


def by_bound(process: Process) -> dict[Bound, float]:
    return {limit.bound: limit.value for limit in performance_limits(process)}


def test_one_cause_alone_gives_the_number_of_its_own_formula() -> None:
    assert by_bound(FOPDT(K=2, tau=120, theta=30)) == {
        Bound.WC_BELOW: pytest.approx(math.pi / 3 / 30)
    }
    zero = TransferFunction((-1.0, 0.5), (1.0, 2.0, 1.0))
    assert by_bound(zero) == {Bound.WC_BELOW: pytest.approx(0.5 / math.sqrt(3))}
    assert by_bound(UNSTABLE)[Bound.WC_ABOVE] == pytest.approx(0.1 * math.sqrt(3))
    assert performance_limits(FOPDT(K=2, tau=120, theta=0)) == ()


def test_the_ideal_loop_of_the_all_pass_crosses_over_there() -> None:
    # T = A is the ideal; L = A/(1 - A) has gain 1 at the limit and not before.
    process = TransferFunction((-1.0, 0.5), (1.0, 2.0, 1.0), 1.5)
    limit = by_bound(process)[Bound.WC_BELOW]
    w = np.linspace(1e-3, limit, 500)
    A = np.exp(-1.5j * w) * (0.5 - 1j * w) / (0.5 + 1j * w)

    gain = np.abs(A / (1 - A))
    assert np.all(gain[:-1] > 1)
    assert gain[-1] == pytest.approx(1.0)


def test_no_stable_loop_of_many_passes_the_rigorous_peaks() -> None:
    processes = [UNSTABLE, TransferFunction((-1.0, 3.0), (10.0, -1.0))]
    rng = np.random.default_rng(2)
    for process in processes:
        limits, held = by_bound(process), 0
        for _ in range(120):
            pid = PID(
                Kc=10 ** rng.uniform(-1, 1.2),
                Ti=float(rng.choice([math.inf, 10 ** rng.uniform(0.5, 2.5)])),
                Td=float(rng.choice([0.0, 10 ** rng.uniform(-1, 0.5)])),
            )
            if unstable_poles(process, pid):
                continue
            held += 1
            found = margins(process, pid)
            assert found.Mt >= limits.get(Bound.MT, 0.0) * (1 - 1e-9)
            assert found.Ms >= limits.get(Bound.MS, 0.0) * (1 - 1e-9)
        assert held > 10
    assert by_bound(UNSTABLE)[Bound.MT] == pytest.approx(math.exp(0.2))
    assert by_bound(processes[1])[Bound.MS] == pytest.approx((3 + 0.1) / (3 - 0.1))


def test_a_complex_pair_of_zeros_is_named_once() -> None:
    process = TransferFunction((1.0, -0.4, 1.0), (1.0, 3.0, 3.0, 1.0))
    (limit,) = performance_limits(process)

    assert limit.cause.startswith("Right half-plane zero at 0.2+0.9798j rad/s")
    assert "even an ideal controller" in limit.sentence
    assert 0.1 < limit.value < 1.0


@pytest.mark.parametrize("N", [5.0, 10.0, math.inf])
def test_no_pid_leads_by_more_than_its_filter_lets_it(N: float) -> None:
    w = np.geomspace(1e-3, 1e4, 4001)
    leads = []
    for Ki in (0.0, 0.01, 0.3):
        d = 1j * w / (1 + 1j * w * (1 / N))
        leads.append(np.max(np.angle(1 + Ki / (1j * w) + d, deg=True)))

    assert max(leads) <= largest_lead("PID", N) + 1e-9
    assert leads[0] == pytest.approx(largest_lead("PID", N), abs=0.02)
    assert largest_lead("PI") == 0.0


def test_the_fastest_crossover_is_where_the_phase_runs_out() -> None:
    # An integrator with dead time under P: 90° - w theta = PM.
    assert fastest_crossover(IPDT(K=1, theta=2), 45, structure="P") == pytest.approx(math.pi / 8)
    heater = FOPDT(K=2, tau=120, theta=30)
    most = fastest_crossover(heater, 60, structure="PI")
    rng = np.random.default_rng(4)
    for _ in range(200):
        pid = PID(Kc=10 ** rng.uniform(-1, 0.6), Ti=10 ** rng.uniform(1, 3))
        if unstable_poles(heater, pid) or margins(heater, pid).phase < 60:
            continue
        assert (bandwidths(heater, pid).wc or 0.0) <= most
    assert fastest_crossover(FOPDT(K=1, tau=1, theta=0), 60) == math.inf
    assert fastest_crossover(TransferFunction((1.0,), (1.0, 0.0, 0.0)), 60, structure="P") == 0.0


def test_a_speed_that_no_pid_can_have_is_refused_with_the_numbers() -> None:
    heater = FOPDT(K=2, tau=120, theta=30)
    fine = crossover_feasibility(heater, 0.02, phase=45)
    assert fine.possible
    assert len(fine.reasons) == 2
    no = crossover_feasibility(heater, 0.2, phase=60, structure="PI")
    assert not no.possible
    assert "a PI a crossover of at most" in no.reasons[0]
    assert "Dead time of 30 s: wc at most 0.03491 rad/s" in no.reasons[1]
    tight = crossover_feasibility(
        TransferFunction((-1.0, 0.3), (10.0, -1.0)), 0.18, phase=20, Ms=1.7
    )
    assert any("Ms at least 2 with any linear controller" in r for r in tight.reasons)


def test_impossible_questions_are_refused_in_words() -> None:
    heater = FOPDT(K=2, tau=120, theta=30)
    for call, sentence in (
        (lambda: largest_lead("I"), "must be P, PI, PD or PID, got I"),
        (lambda: largest_lead("PID", -1), "N must be positive, got -1"),
        (lambda: fastest_crossover(heater, 200), "within 0° and 180°, got 200"),
        (lambda: crossover_feasibility(heater, math.inf), "the crossover must be positive"),
        (lambda: crossover_feasibility(heater, 1.0, Ms=1.0), "Ms must be above 1"),
    ):
        with pytest.raises(ValueError, match=sentence):
            call()
