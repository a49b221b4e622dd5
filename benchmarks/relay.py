"""Errors of the model from noisy relay tests, from short to long dead times."""

import math

import numpy as np

from benchmarks.section import Section, Target
from identification.relay_cycle import limit_cycle
from identification.relay_model import relay_model
from identification.relay_ultimate import ultimate_gain_and_period
from loop.errors import NoLimitCycle
from loop.process import FOPDT
from loop.record import Record
from loop.relay_feedback import Relay, simulate_relay
from loop.signals import Real

RATIOS = (0.05, 0.1, 0.3, 1.0, 3.0, 10.0)
SEEDS = 100
BIAS, NOISE, CYCLES, REST = 0.4, 0.02, 10, 2.0


def run() -> Section:
    """Fit a hundred relay tests at each ratio of dead time to time constant."""
    rows, median, bias = [], [], []
    for ratio in RATIOS:
        process = FOPDT(K=1.0, tau=1.0, theta=ratio)
        errors, described, inverted, refused = _errors(process)
        middle = 100 * np.median(np.abs(errors), axis=0)
        mean = 100 * errors.mean(axis=0)
        of_mean = 100 * errors.std(axis=0, ddof=1) / math.sqrt(len(errors))
        median.append(float(middle.max()))
        bias.append(float(np.max(np.abs(mean) / of_mean)))
        rows.append(
            (
                f"{ratio:g}",
                *(f"{value:.2f}" for value in middle),
                *(f"{m:+.2f} ± {e:.2f}" for m, e in zip(mean, of_mean, strict=True)),
                f"{100 * np.median(described):+.0f}",
                f"{100 * np.median(np.abs(inverted)):.1f}",
                str(refused),
            )
        )
    return Section(
        title="Models from noisy relay tests",
        how=(
            f"{SEEDS} simulated tests at each theta/tau, seeds 0 to {SEEDS - 1}: relay biased by "
            f"{BIAS:g} of its amplitude, noise of {100 * NOISE:g} % of PV's half swing, hysteresis "
            f"of three times the noise, at least {CYCLES} settled cycles, a rest of {REST:g} "
            "cycles before, samples every min(tau, theta)/20. Errors in percent of the true value; "
            "± is the standard error of the mean."
        ),
        columns=(
            "theta/tau", "median K", "tau", "theta", "mean K", "tau", "theta",
            "Ku by describing function", "median tau by half periods", "refused",
        ),
        rows=tuple(rows),
        targets=(
            Target(what="Largest median error", limit=1.0, reached=max(median), unit="%"),
            Target(
                what="Largest mean error over its standard error, of 18",
                limit=3.0, reached=max(bias), unit="",
            ),
        ),
        notes=(
            "The last but one column is the exact inversion of the limit cycle from its mean half "
            "periods: noise makes the relay switch early, which it takes for another process.",
        ),
    )  # fmt: skip


def _errors(process: FOPDT) -> tuple[Real, list[float], list[float], int]:
    """Relative errors of K, tau, theta; of Ku by describing function, of tau by half periods."""
    Ku, _ = ultimate_gain_and_period(process.K, process.tau, process.theta)
    errors, described, inverted, refused = [], [], [], 0
    for seed in range(SEEDS):
        record, hysteresis = simulated_test(process, seed)
        try:
            found = relay_model(record, hysteresis=hysteresis)
        except NoLimitCycle:
            refused += 1
            continue
        p = found.model.fitted
        if not isinstance(p, FOPDT) or found.model.process is None:
            refused += 1
            continue
        errors.append([p.K / process.K - 1, p.tau / process.tau - 1, p.theta / process.theta - 1])
        described.append(found.relay.Ku / Ku - 1)
        if found.inverted is not None:
            inverted.append(found.inverted.tau / process.tau - 1)
    return np.array(errors), described, inverted, refused


def simulated_test(process: FOPDT, seed: int) -> tuple[Record, float]:
    """Simulate one test after a rest; the hysteresis that it ran with comes along."""
    dt = min(process.tau, process.theta) / 20
    sd = NOISE * limit_cycle(process, amplitude=1.0).amplitude
    cycle = limit_cycle(process, amplitude=1.0, bias=BIAS, hysteresis=3 * sd)
    rng = np.random.default_rng(seed)
    run = simulate_relay(
        process,
        Relay(amplitude=1.0, bias=BIAS, hysteresis=3 * sd),
        # Two cycles until all is settled; noise shortens the others.
        t_end=(CYCLES + 2) * cycle.period,
        dt=dt,
        noise=sd,
        rng=rng,
    )
    before = round(REST * cycle.period / dt)
    pv = np.concatenate([rng.normal(0, sd, before), run.pv])
    op = np.concatenate([np.zeros(before), run.op])
    return Record(t=dt * np.arange(pv.size), pv=pv, op=op), 3 * sd
