"""Simulated step tests with known truth, in closed form and without code of `loop`."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real

STEP = 10.0
REST = 50.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepTest:
    """One noisy step test of a first-order process with dead time.

    Attributes
    ----------
    K, tau, theta : float
        Truth. [PV/OP], [s], [s]
    at : float
        Instant of the step of the output, at a sample. [s]
    t, pv, op : ndarray, shape (n,)
        Times [s], noisy process variable [PV], output [OP].
    true_pv : ndarray, shape (n,)
        The same without noise. [PV]
    noise : float
        Standard deviation of the noise. [PV]
    """

    K: float
    tau: float
    theta: float
    at: float
    t: Real
    pv: Real
    op: Real
    true_pv: Real
    noise: float


def answer(
    t: Real, K: float, tau: float, theta: float, pv0: float, drift: float, *, at: float
) -> Real:
    """Answer to the step in closed form, pv0 + drift t + K STEP (1 - e^(-(t - at - theta)/tau)).

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times. [s]
    K, tau, theta : float
        Process. [PV/OP], [s], [s]
    pv0, drift : float
        Rest [PV] and slope [PV/s].
    at : float
        Instant of the step. [s]
    """
    since = np.maximum(t - at - theta, 0.0)
    return np.asarray(pv0 + drift * t - K * STEP * np.expm1(-since / tau))


def step_test(
    n: int, rng: np.random.Generator, *, K: float, tau: float, theta: float, noise: float = 0.015
) -> StepTest:
    """Simulate a step at a tenth of the record, which lasts until PV has settled.

    Parameters
    ----------
    n : int
        Number of samples. [-]
    rng : numpy.random.Generator
        Source of the noise.
    K, tau, theta : float
        Process. [PV/OP], [s], [s]
    noise : float
        Standard deviation of the noise as a share of the whole change of PV. [-]
    """
    t = np.linspace(0, 1.1 * (6 * tau + theta), n)
    at = float(t[n // 10])
    true_pv = answer(t, K, tau, theta, REST, 0.0, at=at)
    sd = noise * abs(K) * STEP
    return StepTest(
        K=K,
        tau=tau,
        theta=theta,
        at=at,
        t=t,
        pv=true_pv + rng.normal(0, sd, n),
        op=np.where(t >= at, STEP, 0.0),
        true_pv=true_pv,
        noise=sd,
    )


def heater_test(n: int, seed: int) -> StepTest:
    """Simulate the heater of the tutorial: K 2, tau 120 s, theta 30 s."""
    return step_test(n, np.random.default_rng(seed), K=2.0, tau=120.0, theta=30.0)


def random_test(n: int, seed: int) -> StepTest:
    """Simulate a random process: tau over a decade and a half, theta/tau within 0.1 and 2."""
    rng = np.random.default_rng(seed)
    tau = 10 ** rng.uniform(1, 2.5)
    K = rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-0.5, 0.5)
    return step_test(n, rng, K=K, tau=tau, theta=tau * rng.uniform(0.1, 2.0))
