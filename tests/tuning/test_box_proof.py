"""Worst margins over a box: bounds against random plants, grids, planted resonances and margins."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID, Action
from loop.errors import UnstableLoop
from loop.margin_batch import batch_margins
from loop.margins import margins
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, TransferFunction
from loop.response import loop_response, sensitivity
from loop.signals import Real
from loop.stability import unstable_poles
from tuning.box_proof import BoxProof, prove_box
from tuning.box_verdict import hold_box
from tuning.profiles import PROFILES, Profile
from tuning.uncertain_loop import UncertainLoop, error_sizes

HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)
# A dead time at which the loop around the resonance of 3.3 rad/s is stable. [s]
STEADY = 3.3
HEATER_PID = PID(Kc=0.45, Ti=135.0, Td=13.3)
LOOPS: tuple[tuple[Process, PID], ...] = (
    (HEATER, HEATER_PID),
    (HEATER, PID(Kc=0.8, Ti=120.0)),
    (replace(HEATER, K=-2.0), PID(Kc=0.4, Ti=90.0, tauF=5.0, action=Action.DIRECT)),
    (FOPDT(K=1.0, tau=1.0, theta=4.0), PID(Kc=0.2, Ti=1.6)),
    (FOPDT(K=1.0, tau=20.0, theta=1.0), PID(Kc=5.0)),
    (SOPDT(K=2.0, tau1=120.0, tau2=20.0, theta=20.0), PID(Kc=0.5, Ti=130.0, Td=15.0)),
    (SOPDT(K=1.0, tau1=60.0, tau2=10.0, theta=10.0), PID(Kc=1.0, Ti=65.0)),
    (IPDT(K=0.1, theta=5.0), PID(Kc=0.8, Ti=60.0)),
    (IPDT(K=0.1, theta=5.0), PID(Kc=0.8, Ti=60.0, Td=2.0, N=5.0)),
    (DoubleIntegrator(K=0.01, theta=1.0), PID(Kc=0.3, Ti=200.0, Td=25.0)),
)


def _plants(process: Process, factors: Real) -> ProcessBatch:
    """Plants with the factors on (K, tau or tau1, tau2, theta), shape (n, 4)."""
    assert not isinstance(process, TransferFunction)
    model = ProcessBatch.of(process)
    K, tau1, tau2, theta = factors.T
    return ProcessBatch(
        K=model.K * K,
        tau1=model.tau1 * tau1,
        tau2=model.tau2 * tau2,
        integrators=model.integrators,
        theta=model.theta * theta,
    )


def _never_passed(proof: BoxProof, found: object, *, close: float = 1e-9) -> None:
    """No margin of a batch lies beyond the bound."""
    for name, worst in proof.worst.items():
        values = getattr(found, name)
        if name in ("Ms", "Mt"):
            assert values.max() <= worst.bound * (1 + close), name
        else:
            assert values.min() >= worst.bound * (1 - close), name


@pytest.mark.parametrize(("process", "controller"), LOOPS)
def test_random_plants_never_pass_the_bound(process: Process, controller: PID) -> None:
    rng = np.random.default_rng(7)
    for error in (0.15, 0.3):
        proof = prove_box(process, controller, errors=(error, error, error))
        factors = rng.uniform(1 - error, 1 + error, (150, 4))
        factors[:60] = rng.choice([1 - error, 1.0, 1 + error], (60, 4))
        found = batch_margins(_plants(process, factors), PIDBatch.of(controller))
        assert proof.stable is True
        assert found.stable.all()
        _never_passed(proof, found)


@pytest.mark.parametrize(("process", "controller"), LOOPS)
def test_the_bound_is_within_a_hundredth_of_a_plant_that_is_really_that_bad(
    process: Process, controller: PID
) -> None:
    proof = prove_box(process, controller, errors=(0.3, 0.3, 0.3))
    assert proof.finished
    for name, worst in proof.worst.items():
        assert worst.gap < 0.01, name
        there = margins(worst.plant, controller)
        assert getattr(there, name) == pytest.approx(worst.found, rel=1e-6), name


def test_the_heater_is_as_bad_as_the_printed_grid_and_hardly_worse() -> None:
    """Printed for the 5 x 5 x 5 grid: GM 2.065, PM 64.9, DM 86.7 s, Ms 1.970."""
    proof = prove_box(HEATER, HEATER_PID)
    for name, printed, half in (
        ("gain", 2.065, 5e-4),
        ("phase", 64.9, 0.05),
        ("delay", 86.7, 0.05),
        ("Ms", 1.970, 5e-4),
    ):
        worst = proof.worst[name]
        if name == "Ms":
            assert worst.found > printed - half
            assert worst.bound < printed * 1.01
        else:
            assert worst.found < printed + half
            assert worst.bound > printed * 0.99
    assert "1 is excluded for every plant" in proof.certificate


def test_without_errors_the_worst_case_is_the_model() -> None:
    for process, controller in LOOPS:
        proof = prove_box(process, controller, errors=(0.0, 0.0, 0.0), sample_time=0.2)
        model = margins(process, controller, sample_time=0.2)
        for name, worst in proof.worst.items():
            assert worst.found == pytest.approx(getattr(model, name), rel=1e-9), name
            assert worst.gap < 0.01, name


def _resonant(*, damping: float, size: float) -> TransferFunction:
    """A lag with a light resonance at 3.3 rad/s, which a grid of 100 points a decade misses."""
    lag = np.array([10.0, 1.0])
    peak = np.array([1 / 3.3**2, 2 * damping / 3.3, 1.0])
    numerator = np.polyadd(np.polymul([1.0], peak), size * lag)
    return TransferFunction(
        tuple(map(float, numerator)), tuple(map(float, np.polymul(lag, peak))), 0.5
    )


def test_a_resonance_between_grid_points_is_caught() -> None:
    """Second route: the margins of one loop, whose scan is dense about every root."""
    process, controller = _resonant(damping=2e-5, size=1.2e-5), PID(Kc=2.0, Ti=10.0)
    grid = np.logspace(-4, 3, 701)
    seen = float(np.abs(sensitivity(process, controller, grid)).max())
    proof = prove_box(process, controller, errors=(0.0, 0.0, 0.0))
    true = margins(process, controller).Ms
    assert true > 1.5 * seen
    assert true * (1 - 1e-9) <= proof.worst["Ms"].bound < 1.01 * true


def test_an_unstable_plant_inside_is_found_though_model_and_corners_are_stable() -> None:
    """A whole turn of dead time at the resonance lies between model and corner."""
    turn = 2 * math.pi / 3.3
    process = replace(_resonant(damping=1e-4, size=4e-4), theta=STEADY)
    controller, errors = PID(Kc=1.0, Ti=10.0), {"theta": turn / STEADY}
    for theta in (STEADY - turn, STEADY, STEADY + turn):
        assert unstable_poles(replace(process, theta=theta), controller) == 0
    proof = prove_box(process, controller, errors=errors)
    found = hold_box(process, controller, PROFILES["general"], errors=errors)
    assert proof.stable is False
    assert proof.unstable_plant is not None
    assert unstable_poles(proof.unstable_plant, controller) > 0
    assert abs(proof.unstable_plant.theta - STEADY) <= turn * (1 + 1e-12)
    assert found.holds is False
    assert found.plant is not None
    assert margins(replace(process, theta=STEADY), controller).Ms < 2


def test_a_box_with_an_unstable_corner_answers_that_plant() -> None:
    proof = prove_box(HEATER, PID(Kc=1.6, Ti=120.0))
    assert proof.stable is False
    assert proof.worst["Ms"].found == proof.worst["Mt"].bound == math.inf
    assert proof.worst["gain"].bound == proof.worst["phase"].bound == 0.0
    assert proof.unstable_plant is not None
    with pytest.raises(UnstableLoop):
        margins(proof.unstable_plant, PID(Kc=1.6, Ti=120.0))
    assert "unstable plant" in proof.certificate


def test_an_unstable_model_is_the_answer_itself() -> None:
    proof = prove_box(HEATER, PID(Kc=9.0, Ti=120.0))
    assert proof.unstable_plant == HEATER
    assert proof.cells == 0


def test_when_the_budget_runs_out_the_bound_is_wider_and_still_true() -> None:
    exact = prove_box(HEATER, HEATER_PID)
    for budget in (60, 120, 240):
        hurried = prove_box(HEATER, HEATER_PID, most_cells=budget)
        assert not hurried.finished
        assert hurried.cells <= budget
        assert hurried.worst["Ms"].bound >= exact.worst["Ms"].found
        assert hurried.worst["gain"].bound <= exact.worst["gain"].found
    undecided = prove_box(HEATER, HEATER_PID, most_cells=10)
    assert undecided.stable is None
    assert undecided.certificate.startswith("Undecided")
    assert "budget ran out" in hurried.certificate
    verdict = hold_box(HEATER, HEATER_PID, PROFILES["general"], most_cells=10)
    assert verdict.holds is None
    assert verdict.plant is None


def test_a_verdict_agrees_with_the_bounds() -> None:
    for process, controller in LOOPS:
        proof = prove_box(process, controller, errors=(0.3, 0.3, 0.3))
        for factor in (0.97, 1.03):
            profile = Profile(
                name="edge",
                gain=max(1.001, 0.9 * proof.worst["gain"].bound),
                phase=0.9 * min(proof.worst["phase"].bound, 90.0),
                Ms=factor * proof.worst["Ms"].found,
            )
            verdict = hold_box(process, controller, profile, errors=(0.3, 0.3, 0.3))
            assert verdict.holds is (factor > 1)
            assert (verdict.plant is None) is (factor > 1)


@pytest.mark.parametrize(
    ("profile", "word"),
    [
        (Profile(name="a", gain=3.0, phase=30.0, Ms=9.0), "the gain margin is 2.0"),
        (Profile(name="a", gain=1.5, phase=70.0, Ms=9.0), "the phase margin is 6"),
        (Profile(name="a", gain=1.5, phase=30.0, Ms=1.9), "Ms is 1.9"),
        (Profile(name="a", gain=1.5, phase=30.0, Ms=9.0, Mt=1.02), "Mt is 1.03"),
        (
            Profile(name="a", gain=1.5, phase=30.0, Ms=9.0, delay_over_theta=2.0),
            "the delay margin is 86",
        ),
    ],
)
def test_the_sentence_names_the_limit_that_is_broken(profile: Profile, word: str) -> None:
    verdict = hold_box(HEATER, HEATER_PID, profile)
    assert verdict.holds is False
    assert verdict.sentence.startswith(word)


def test_a_delay_limit_is_held_to_the_longest_dead_time() -> None:
    """The delay margin falls and the demand rises with theta; worst is 86.67 s at theta = 45 s."""
    for ratio, holds in ((1.90, True), (1.94, False)):
        profile = Profile(name="a", gain=1.5, phase=30.0, Ms=9.0, delay_over_theta=ratio)
        assert hold_box(HEATER, HEATER_PID, profile).holds is holds


def test_a_change_of_the_unit_of_time_changes_times_alone() -> None:
    minutes = FOPDT(K=2.0, tau=2.0, theta=0.5)
    a, b = prove_box(HEATER, HEATER_PID), prove_box(minutes, PID(Kc=0.45, Ti=2.25, Td=13.3 / 60))
    for name, worst in a.worst.items():
        unit = 60.0 if name == "delay" else 1.0
        assert worst.found == pytest.approx(unit * b.worst[name].found, rel=1e-8)
        assert worst.bound == pytest.approx(unit * b.worst[name].bound, rel=1e-3)


def test_every_point_of_a_cell_lies_within_its_enclosure() -> None:
    rng = np.random.default_rng(3)
    loops: list[tuple[Process, PID]] = [*LOOPS, (_resonant(damping=0.02, size=0.5), PID(Kc=2.0))]
    loops.append((TransferFunction((-2.0, 1.0), (1.0, 0.0, 4.0), 0.3), PID(Kc=1.0, Ti=3.0)))
    for process, controller in loops:
        sizes = error_sizes(process, (0.4, 0.4, 0.4))
        loop = UncertainLoop.of(process, controller, sizes, 0.0)
        low = np.tile(loop.low, (60, 1))
        high = np.tile(loop.high, (60, 1))
        low[:, 0] = rng.uniform(-9, 5, 60)
        high[:, 0] = low[:, 0] + 10 ** rng.uniform(-3, 0.5, 60)
        narrow = rng.uniform(0, 1, 60)[:, None]
        high[:, 1:] = low[:, 1:] + narrow * (high[:, 1:] - low[:, 1:])
        cell = loop.enclose(low, high)
        at = low + rng.uniform(0, 1, low.shape) * (high - low)
        w = np.exp(at[:, 0])
        theta = rng.uniform(loop.theta_low, loop.theta_high, 60)
        for i in range(60):
            plant = loop.plant(process, 1.0, at[i], float(theta[i]))
            L = loop_response(plant, controller, w[i : i + 1])[0]
            assert cell.log_low[i] - 1e-9 <= math.log(abs(L)) <= cell.log_high[i] + 1e-9
            turns = (np.angle(L) - cell.phase_low[i]) % (2 * math.pi)
            width = cell.phase_high[i] - cell.phase_low[i]
            assert turns <= width + 1e-8 or turns >= 2 * math.pi - 1e-8


def test_errors_go_by_name_and_impossible_ones_are_refused() -> None:
    lag = SOPDT(K=2.0, tau1=120.0, tau2=20.0, theta=20.0)
    assert error_sizes(lag, {"tau": 0.2, "tau2": 0.4}) == {
        "K": 0.0, "tau1": 0.2, "tau2": 0.4, "theta": 0.0,
    }  # fmt: skip
    assert error_sizes(IPDT(K=1.0, theta=1.0), (0.1, 0.2, 0.3)) == {"K": 0.1, "theta": 0.3}
    with pytest.raises(ValueError, match="the error of K must lie within 0 and below 1, got 1"):
        prove_box(HEATER, HEATER_PID, errors=(1.0, 0.5, 0.5))
    with pytest.raises(ValueError, match="a FOPDT has K, tau, theta, not tau2"):
        prove_box(HEATER, HEATER_PID, errors={"tau2": 0.1})
    with pytest.raises(ValueError, match="sample_time must lie within"):
        prove_box(HEATER, HEATER_PID, sample_time=-1.0)


def test_a_proportional_loop_without_dead_time_has_no_limit() -> None:
    lag = TransferFunction((2.0,), (10.0, 1.0))
    proof = prove_box(lag, PID(Kc=3.0), errors=(0.5, 0.5, 0.5))
    assert proof.worst["gain"].bound == math.inf
    assert proof.worst["Ms"].bound == pytest.approx(1.0, rel=0.01)
    blocked = TransferFunction((2.0, 0.0), (10.0, 11.0, 1.0))
    assert prove_box(blocked, PID(Kc=3.0)).stable is True
    direct = TransferFunction((2.0, 1.0), (10.0, 1.0))
    assert prove_box(direct, PID(Kc=1.0)).worst["Ms"].bound < 1.01


def test_plants_of_a_box_are_described_in_words() -> None:
    process, controller = _resonant(damping=0.01, size=0.05), PID(Kc=30.0, Ti=10.0)
    assert "numerator" in prove_box(process, controller).certificate
    assert {f.name for f in fields(BoxProof)} >= {"worst", "cells", "finished"}
