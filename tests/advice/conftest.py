"""Records with a known truth behind them."""

import numpy as np
import pytest

from loop.open_loop import process_output
from loop.process import FOPDT
from loop.record import Record

HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


def step_record(process: FOPDT, *, noise: float = 0.05, seed: int = 1) -> Record:
    """Two moves, up and down, on a steady start."""
    t = np.arange(0.0, 3000.0, 2.0)
    op = np.where(t < 200, 40.0, np.where(t < 1600, 50.0, 45.0))
    pv = 60.0 + process_output(process, t, op, op_before=40.0)
    pv = pv + np.random.default_rng(seed).normal(0, noise, t.size)
    return Record(t=t, pv=pv, op=op, tag="TIC-900", pv_unit="degC", op_unit="%")


@pytest.fixture(scope="session")
def heater() -> FOPDT:
    return HEATER


@pytest.fixture(scope="session")
def heater_test() -> Record:
    return step_record(HEATER)


@pytest.fixture(scope="session")
def cooler_test() -> Record:
    return step_record(FOPDT(K=-0.5, tau=60.0, theta=12.0), noise=0.02)


@pytest.fixture(scope="session")
def flat_record() -> Record:
    t = np.arange(0.0, 500.0)
    return Record(t=t, pv=np.full(t.size, 20.0), op=np.full(t.size, 40.0))


@pytest.fixture
def square_wave() -> Record:
    """Output switched by the clock: it looks like a relay's and is none."""
    t = np.arange(0.0, 4000.0, 2.0)
    op = np.where((t // 200) % 2 == 1, 60.0, 50.0)
    pv = process_output(FOPDT(K=2.0, tau=40.0, theta=10.0), t, op, pv0=100.0)
    return Record(t=t, pv=pv + 0.1 * np.sin(7 * t), op=op)
