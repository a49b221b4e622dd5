import math

import numpy as np
import pytest

from loop.process import (
    FOPDT,
    IPDT,
    SOPDT,
    DoubleIntegrator,
    TransferFunction,
    gain_sign,
    rational_response,
    static_gain,
)

S = 1j * np.geomspace(1e-3, 1e2, 30)


def test_every_model_is_its_printed_formula() -> None:
    for process, printed in [
        (FOPDT(K=2, tau=120, theta=30), 2 / (120 * S + 1)),
        (SOPDT(K=-3, tau1=10, tau2=4, theta=1), -3 / ((10 * S + 1) * (4 * S + 1))),
        (IPDT(K=0.5, theta=2), 0.5 / S),
        (DoubleIntegrator(K=250, theta=0), 250 / S**2),
        (TransferFunction((0, 1, -2), (1, 2, 1), 0.3), (S - 2) / (S + 1) ** 2),
    ]:
        np.testing.assert_allclose(rational_response(process, S), printed, rtol=1e-12)


def test_static_gain_and_direction() -> None:
    assert static_gain(FOPDT(K=-2, tau=1, theta=0)) == -2
    assert static_gain(IPDT(K=-2, theta=0)) == -math.inf
    assert gain_sign(TransferFunction((-2, 1), (1, 2, 1))) == 1
    assert static_gain(TransferFunction((1, 0), (1, 1))) == 0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: FOPDT(K=0, tau=1, theta=1), "K must lie"),
        (lambda: FOPDT(K=math.nan, tau=1, theta=1), "K must lie"),
        (lambda: FOPDT(K=1, tau=-3, theta=1), "tau must lie .* got -3"),
        (lambda: FOPDT(K=1, tau=1e-300, theta=1), "tau must lie"),
        (lambda: FOPDT(K=1, tau=1, theta=math.inf), "theta must be 0 or"),
        (lambda: SOPDT(K=1, tau1=1, tau2=2, theta=1), "tau1 must not be below"),
        (lambda: IPDT(K=math.inf, theta=1), "K must lie"),
        (lambda: DoubleIntegrator(K=1, theta=-1), "theta must be 0 or"),
        (lambda: TransferFunction((1, 0, 0), (1, 1)), "must be proper"),
        (lambda: TransferFunction((0,), (1, 1)), "not all zero"),
        (lambda: TransferFunction((1,), (1, math.nan)), "finite"),
    ],
)
def test_impossible_models_are_refused_in_words(make: object, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()  # type: ignore[operator]
