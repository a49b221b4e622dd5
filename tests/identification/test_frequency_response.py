"""Frequency responses from chirp, sine steps and multisine against the true process."""

import numpy as np
import pytest

from identification.frequency_fit import fit_frequency_response
from identification.frequency_margins import measured_margins
from identification.frequency_response import FrequencyResponse, frequency_response
from loop.controller import PID, Action
from loop.errors import FitNotTrusted, PoorExcitation
from loop.margins import margins
from loop.open_loop import process_output
from loop.process import FOPDT
from loop.record import Record
from loop.signals import Complex, Real

PROCESS = FOPDT(K=2.0, tau=20.0, theta=5.0)
N, H = 4000, 0.5
T = H * np.arange(N)


def chirp() -> Real:
    ratio = np.log(0.6 / 0.005)
    swept: Real = 5 * np.sin(0.005 * T[-1] / ratio * np.expm1(ratio * T / T[-1]))
    return swept


def schroeder_multisine() -> Real:
    lines = np.arange(1, 60)
    phase = -np.pi * lines * (lines - 1) / lines.size
    period = np.cos(2 * np.pi * np.outer(np.arange(1000), lines) / 1000 + phase).sum(axis=1)
    return np.tile(5 * period / np.abs(period).max(), 4)


def sine_steps() -> Real:
    return np.concatenate([5 * np.sin(w * T[:800]) for w in (0.02, 0.05, 0.1, 0.2, 0.4)])


def true(w: Real, process: FOPDT = PROCESS) -> Complex:
    G: Complex = process.K * np.exp(-1j * w * process.theta) / (1j * w * process.tau + 1)
    return G


def record(op: Real, noise: float = 0.3, seed: int = 0, process: FOPDT = PROCESS) -> Record:
    pv = process_output(process, T, op) + np.random.default_rng(seed).normal(0, noise, N)
    return Record(t=T, pv=50 + pv, op=op)


@pytest.mark.parametrize("op", [chirp(), schroeder_multisine(), sine_steps()])
def test_errors_of_the_points_are_as_large_as_stated(op: Real) -> None:
    off = []
    for seed in range(6):
        found = frequency_response(record(op, seed=seed))
        apart = slice(None, None, found.stride)
        off.append(np.abs(found.G - true(found.w))[apart] ** 2 / found.sd[apart] ** 2)
    assert 0.6 < np.mean(np.concatenate(off)) < 1.5
    assert found.coherence[0] > 0.95
    assert np.all((found.coherence >= 0) & (found.coherence <= 1))


@pytest.mark.parametrize("op", [chirp(), schroeder_multisine(), sine_steps()])
def test_without_noise_the_points_lie_on_the_true_response(op: Real) -> None:
    found = frequency_response(record(op, noise=0.0))
    near = found.w < 0.2
    np.testing.assert_allclose(found.G[near], true(found.w[near]), rtol=0.03)


@pytest.mark.parametrize("op", [chirp(), schroeder_multisine(), sine_steps()])
def test_the_fitted_model_is_the_process_within_its_errors(op: Real) -> None:
    fit = fit_frequency_response(frequency_response(record(op)))
    found = np.array([fit.process.K, fit.process.tau, fit.process.theta])
    assert np.all(np.abs(found - [2.0, 20.0, 5.0]) < 4 * fit.standard_errors)
    assert np.all(fit.standard_errors / [2.0, 20.0, 5.0] < 0.03)
    assert fit.misfit < 3
    negative = fit_frequency_response(
        frequency_response(record(op, process=FOPDT(K=-2.0, tau=20.0, theta=5.0)))
    )
    assert pytest.approx(-2.0, rel=0.05) == negative.process.K


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_margins_without_a_model_are_those_of_the_true_loop(sign: float) -> None:
    process = FOPDT(K=2.0 * sign, tau=20.0, theta=5.0)
    controller = PID(Kc=0.8, Ti=15.0, action=Action.for_gain(process.K))
    truth = margins(process, controller)
    found = measured_margins(
        frequency_response(record(chirp(), noise=0.1, process=process)), controller
    )
    assert found.gain is not None
    assert found.phase is not None
    assert found.Ms is not None
    assert found.gain[0] == pytest.approx(truth.gain, rel=0.05)
    assert found.phase[0] == pytest.approx(truth.phase, abs=2)
    assert found.Ms[0] == pytest.approx(truth.Ms, rel=0.05)
    for middle, low, high in (found.gain, found.phase, found.Ms):
        assert low < middle < high
    assert found.gain[1] < truth.gain < found.gain[2]
    assert found.remarks == ()


def test_what_the_points_do_not_reach_is_not_made_up() -> None:
    found = frequency_response(record(chirp(), noise=0.05))
    low = found.w < 0.1
    part = FrequencyResponse(
        w=found.w[low], G=found.G[low], sd=found.sd[low], coherence=found.coherence[low], stride=1
    )
    weak = measured_margins(part, PID(Kc=0.01, Ti=1000.0))
    assert weak.gain is None
    assert weak.phase is None
    assert weak.Ms is None
    assert len(weak.remarks) == 2
    hidden = FrequencyResponse(
        w=found.w, G=found.G, sd=np.abs(found.G), coherence=found.coherence, stride=1
    )
    assert "out of the noise" in measured_margins(hidden, PID(Kc=1.0)).remarks[0]


def test_few_points_carry_no_model() -> None:
    w = np.array([0.01, 0.02, 0.05])
    few = FrequencyResponse(w=w, G=true(w), sd=np.full(3, 0.01), coherence=np.ones(3), stride=1)
    with pytest.raises(FitNotTrusted, match="Only 3 points"):
        fit_frequency_response(few)
    many = np.geomspace(0.01, 0.3, 12)
    tiny = FrequencyResponse(
        w=many, G=1e-12 * true(many), sd=np.full(12, 1e-15), coherence=np.ones(12), stride=1
    )
    with pytest.raises(FitNotTrusted, match="K must lie within"):
        fit_frequency_response(tiny)


def test_points_that_noise_hides_are_left_out_or_the_record_is_refused() -> None:
    found = frequency_response(record(chirp(), noise=1.0))
    assert np.all(found.sd < np.abs(found.G) / 4)
    assert found.w[-1] < 0.6
    with pytest.raises(PoorExcitation, match="stand out of the noise"):
        frequency_response(record(0.001 * chirp(), noise=1.0))


def test_lines_at_the_very_start_of_the_spectrum_have_no_window() -> None:
    lines = np.array([1, 2, 3, 4, 60])
    op = np.cos(2 * np.pi * np.outer(np.arange(400), lines) / 400).sum(axis=1)
    with pytest.raises(PoorExcitation, match="too low"):
        frequency_response(Record(t=T[:400], pv=op, op=op))


SINE = np.sin(0.05 * T[:400])


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"t": T[:50], "pv": SINE[:50], "op": SINE[:50]}, "at least 100 samples"),
        ({"pv": np.append(SINE[:-1], np.nan)}, "without gaps"),
        ({"t": T[:400] ** 1.1}, "even samples"),
        ({"op": np.ones(400)}, "stands still"),
        ({"op": np.sin(2 * np.pi * 20 * np.arange(400) / 400)}, "excites 1 lines"),
    ],
)
def test_records_without_a_spectrum_are_refused(changed: dict[str, Real], words: str) -> None:
    with pytest.raises(PoorExcitation, match=words):
        frequency_response(Record(**{"t": T[:400], "pv": SINE, "op": SINE, **changed}))
