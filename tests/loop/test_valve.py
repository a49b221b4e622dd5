"""Sticking valves against their describing function, hand-made traces and each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loop.signals import Real
from loop.valve import Choudhury, DeadBand, He, Kano, Valve, stem_positions
from loop.valve_gain import describing_function

POINTS = 20_000


def first_harmonic(valve: Valve, amplitude: float) -> complex:
    """Gain from a sine to the first harmonic of the position, by simulation."""
    phase = 2 * np.pi * np.arange(3 * POINTS) / POINTS
    op = amplitude * np.cos(phase)
    # From the top of the sine, where a stem that has followed it up lags behind.
    position = stem_positions(valve, op, position=-op[0])[-POINTS:]
    turn = np.exp(-1j * phase[-POINTS:])
    return complex((position * turn).sum() / (op[-POINTS:] * turn).sum())


@pytest.mark.parametrize("model", [Choudhury, Kano])
@pytest.mark.parametrize(
    ("S", "J", "amplitude"), [(3, 1, 5), (3, 0, 2), (4, 4, 5), (4, 4, 2.5), (5, 2, 30)]
)
def test_the_first_harmonic_is_the_describing_function(
    model: type[Choudhury] | type[Kano], S: float, J: float, amplitude: float
) -> None:
    """Given to four digits; the sine's samples cost A (2 pi/n)^2/2 at its top, far less."""
    expected = describing_function(np.array(amplitude), S=S, J=J)
    found = first_harmonic(model(S=S, J=J), amplitude)
    assert abs(found - expected) < 1e-4


def test_an_overshooting_jump_has_the_describing_function_in_kanos_model_alone() -> None:
    expected = describing_function(np.array(4.0), S=2, J=3)
    assert abs(first_harmonic(Kano(S=2, J=3), 4) - expected) < 1e-4
    assert abs(first_harmonic(Choudhury(S=2, J=3), 4) - expected) > 0.05


@pytest.mark.parametrize(("J", "equal"), [(0, True), (1, False), (3, False)])
def test_hes_model_has_it_without_slip_jump_only(J: float, equal: bool) -> None:
    S = 3
    found = first_harmonic(He(fs=(S + J) / 2, fd=(S - J) / 2), 5)
    difference = abs(found - describing_function(np.array(5.0), S=S, J=J))
    assert difference < 1e-4 if equal else difference > 0.05


@pytest.mark.parametrize("model", [Choudhury, Kano])
def test_a_trace_by_hand(model: type[Choudhury] | type[Kano]) -> None:
    """S = 3, J = 1: lets go (S + J)/2 = 2 from the stem, follows (S - J)/2 = 1 behind."""
    op = np.array([0, 1, 2, 3, 4, 4, 4.5, 5, 5.5, 5, 4, 2.6, 2.4, 1, 1, 0.5, -0.5, 0.5, 2.4, 2.6])
    position = [0, 0, 0, 2, 3, 3, 3, 3, 4.5, 4.5, 4.5, 4.5, 3.4, 2, 2, 2, 0.5, 0.5, 0.5, 1.6]
    assert stem_positions(model(S=3, J=1), op).tolist() == position


def test_an_overshooting_valve_by_hand() -> None:
    """S = 1, J = 2: lets go past 1.5 and jumps ahead of the output, to op + 0.5."""
    op = np.array([0.0, 1, 2, 3, 3, 4, 4.5, 6])
    assert stem_positions(Kano(S=1, J=2), op).tolist() == [0, 0, 2.5, 3.5, 3.5, 3.5, 3.5, 6.5]


def test_hes_valve_by_hand() -> None:
    """A slow ramp makes it jump by fs - fd = 1 again and again."""
    op = np.array([0, 1, 2, 2.5, 3, 3.1, 3, 1, 0.5, 0.4])
    position = stem_positions(He(fs=2, fd=1), op)
    assert position.tolist() == pytest.approx([0, 0, 0, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5])
    assert stem_positions(He(fs=2, fd=1), np.array([0, -2.5])).tolist() == [0, -1.5]


def test_backlash_by_hand() -> None:
    op = np.array([0.0, 0.5, 1, 2, 3, 2, 1, 0.5, 2])
    assert stem_positions(DeadBand(width=2), op).tolist() == [0, 0, 0, 1, 2, 2, 2, 1.5, 1.5]


def test_a_valve_without_friction_follows() -> None:
    op = wandering(3, 200)
    for valve in (Choudhury(S=0, J=0), Kano(S=0, J=0), He(fs=0, fd=0), DeadBand(width=0)):
        assert np.array_equal(stem_positions(valve, op), op)


def wandering(seed: int, n: int) -> Real:
    """A random walk on quarters that stops now and then; exact in binary."""
    return np.cumsum(np.random.default_rng(seed).integers(-6, 7, n) / 4.0)


quarters = st.integers(0, 20).map(lambda k: k / 4)


@settings(max_examples=60, deadline=None)
@given(S=quarters, part=st.integers(0, 4), seed=st.integers(0, 999))
def test_choudhury_and_kano_agree_scan_by_scan_while_the_jump_is_within_the_band(
    S: float, part: int, seed: int
) -> None:
    op, J = wandering(seed, 300), S * part / 4
    choudhury, kano = Choudhury(S=S, J=J), Kano(S=S, J=J)
    assert np.array_equal(stem_positions(choudhury, op), stem_positions(kano, op))


@settings(max_examples=20, deadline=None)
@given(S=quarters, J=quarters, more=quarters, seed=st.integers(0, 999))
def test_floats_and_arrays_are_one_law(S: float, J: float, more: float, seed: int) -> None:
    op, ones = wandering(seed, 200), np.ones(2)
    for one, many in (
        (Choudhury(S=S, J=J), Choudhury(S=S * ones, J=J)),
        (Kano(S=S, J=J), Kano(S=S, J=J * ones)),
        (He(fs=J + more, fd=J), He(fs=(J + more) * ones, fd=J)),
        (DeadBand(width=S), DeadBand(width=S * ones)),
    ):
        alone, both = stem_positions(one, op), stem_positions(many, op)
        assert both.shape == (200, 2)
        assert np.array_equal(both, np.stack([alone, alone], axis=1))


@settings(max_examples=30, deadline=None)
@given(S=quarters, J=quarters, seed=st.integers(0, 999), shift=st.integers(-9, 9))
def test_unit_sign_and_offset_change_only_the_scale(
    S: float, J: float, seed: int, shift: int
) -> None:
    op = wandering(seed, 200)
    for model in (Choudhury, Kano):
        position = stem_positions(model(S=S, J=J), op)
        assert np.array_equal(stem_positions(model(S=8 * S, J=8 * J), 8 * op), 8 * position)
        assert np.array_equal(stem_positions(model(S=S, J=J), op + shift), position + shift)
        if S >= J:  # an overshooting valve starts with a direction, so its mirror differs
            assert np.array_equal(stem_positions(model(S=S, J=J), -op), -position)


@settings(max_examples=30, deadline=None)
@given(S=quarters, seed=st.integers(0, 999))
def test_backlash_is_the_clip_of_the_last_position(S: float, seed: int) -> None:
    op = wandering(seed, 200)
    position, expected = 0.0 + op[0], []
    for u in op:
        position = float(np.clip(position, u - S / 2, u + S / 2))
        expected.append(position)
    for valve in (DeadBand(width=S), He(fs=S / 2, fd=S / 2), Kano(S=S, J=0)):
        assert stem_positions(valve, op).tolist() == expected


def test_every_loop_of_a_batch_has_its_own_valve_and_output() -> None:
    op = np.stack([wandering(1, 100), wandering(2, 100)], axis=1)
    both = stem_positions(Choudhury(S=np.array([2.0, 5.0]), J=np.array([1.0, 0.0])), op)
    assert np.array_equal(both[:, 0], stem_positions(Choudhury(S=2, J=1), op[:, 0]))
    assert np.array_equal(both[:, 1], stem_positions(Choudhury(S=5, J=0), op[:, 1]))


def test_impossible_valves_are_refused() -> None:
    with pytest.raises(
        ValueError, match="S must be 0 or positive, one number or one for each valve, got -1"
    ):
        Choudhury(S=-1, J=0)
    with pytest.raises(ValueError, match="J must be 0 or positive"):
        Kano(S=1, J=float("nan"))
    with pytest.raises(ValueError, match="width must be"):
        DeadBand(width=np.ones((2, 2)))
    with pytest.raises(ValueError, match="fd must not exceed fs"):
        He(fs=1, fd=2)
    with pytest.raises(ValueError, match="without gaps"):
        stem_positions(DeadBand(width=1), np.array([1.0, np.nan]))
    with pytest.raises(ValueError, match="do not make pairs"):
        stem_positions(DeadBand(width=np.ones(3)), np.ones((5, 2)))
    with pytest.raises(ValueError, match="S and J must be"):
        describing_function(np.array(1.0), S=-1, J=0)
    with pytest.raises(ValueError, match="moves only for amplitudes above S/2 = 1"):
        describing_function(np.array([2.0, 0.9]), S=2, J=0)
