"""Monitoring of a full loop-day against code assembled from statsmodels and scipy."""

from collections.abc import Callable, Mapping
from functools import partial
from unittest.mock import patch

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import correlate, correlation_lags
from statsmodels.tsa.ar_model import AutoReg
from statsmodels.tsa.stattools import acf, acovf

from advice.assess import assess
from benchmarks.section import Section, Target
from benchmarks.timing import Timing, duration, interleaved
from benchmarks.virtual_loops import State, VirtualLoop, virtual_loops
from loop.record import Record
from loop.signals import Real
from monitoring.bicoherence import NFFT, SEGMENT, Bicoherence, bicoherence
from monitoring.cross_correlation import CrossCorrelation, cross_correlation
from monitoring.loop_signals import Stretch
from monitoring.minimum_variance import ORDER, MinimumVariance, minimum_variance
from monitoring.oscillation import Oscillation, oscillation
from monitoring.stiction_search import stiction_search

SAMPLES, DT = 86_400, 1.0
DELAY = 10
LAGS = 2_000
SEED = 4
# The bicoherence of both sides looks at as many samples.
BICOHERENCE_SAMPLES = 4096
# Samples that are correlated, and the period that counts without an oscillation. [samples]
CROSS_SAMPLES, USUAL_PERIOD = 8192, 64.0
STATES = (State.HEALTHY, State.OUTSIDE)


def acf_period(error: Real) -> float:
    """Period from the mean distance of ten zero crossings of statsmodels' autocorrelation."""
    rho = acf(error, nlags=LAGS, fft=True)
    crossings = np.flatnonzero((rho[1:] > 0) != (rho[:-1] > 0))[:11]
    return 2 * float(np.mean(np.diff(crossings))) if crossings.size > 1 else USUAL_PERIOD


def eta_by_products(error: Real) -> float:
    """Minimum-variance index from statsmodels' autocovariance and scipy's Toeplitz solver."""
    r = acovf(error, nlag=DELAY + ORDER, fft=True)
    right = r[DELAY : DELAY + ORDER]
    return float(1 - right @ solve_toeplitz(r[:ORDER], right) / r[0])


def eta_by_autoreg(error: Real) -> float:
    """Minimum-variance index as statsmodels' AutoReg gives it."""
    fit = AutoReg(error, lags=list(range(DELAY, DELAY + ORDER))).fit()
    return float(fit.sigma2 / np.var(error))


def bicoherence_by_arrays(error: Real) -> float:
    """Mean squared bicoherence over the whole plane, by numpy's FFT and arrays."""
    x = error[-BICOHERENCE_SAMPLES:]
    rows = np.lib.stride_tricks.sliding_window_view(x, SEGMENT)[:: SEGMENT // 2]
    X = np.fft.fft((rows - rows.mean(axis=1, keepdims=True)) * np.hanning(SEGMENT), NFFT)
    f = np.arange(NFFT // 2)
    pair = X[:, f, None] * X[:, None, f]
    sums = X[:, (f[:, None] + f) % NFFT]
    top = np.abs(np.mean(pair * np.conj(sums), axis=0)) ** 2
    return float(np.mean(top / (np.mean(np.abs(pair) ** 2, 0) * np.mean(np.abs(sums) ** 2, 0))))


def largest_cross_correlation(op: Real, pv: Real) -> float:
    """Largest correlation within a usual period, by scipy's FFT correlation of the whole day."""
    u, y = op - op.mean(), pv - pv.mean()
    r = correlate(y, u, method="fft") / np.sqrt((u @ u) * (y @ y))
    near = np.abs(correlation_lags(y.size, u.size)) <= USUAL_PERIOD
    return float(np.max(np.abs(r[near])))


def assembled(stretch: Stretch, eta: Callable[[Real], float]) -> tuple[float, float, float, float]:
    """Put the four indices together from libraries."""
    error = stretch.error
    return (
        acf_period(error),
        eta(error),
        bicoherence_by_arrays(error),
        largest_cross_correlation(stretch.op, stretch.pv),
    )


def four_indices(
    stretch: Stretch,
) -> tuple[Oscillation, MinimumVariance, Bicoherence | None, CrossCorrelation | None]:
    """Give what the assembled code gives: the strongest oscillation and three indices more."""
    error = stretch.error
    swings = oscillation(error, stretch.dt, segments=False, most=1)
    period = USUAL_PERIOD if swings.main is None else swings.main.period / stretch.dt
    recent = slice(-max(CROSS_SAMPLES, min(int(8 * period), error.size)), None)
    return (
        swings,
        minimum_variance(error, delay=DELAY),
        bicoherence(error),
        cross_correlation(stretch.op[recent], stretch.pv[recent], period),
    )


def _works(one: VirtualLoop) -> Mapping[str, Callable[[], object]]:
    stretch = Stretch(first=0, dt=DT, pv=one.pv, op=one.op, sp=one.sp, share=1.0)
    record = Record(t=np.arange(SAMPLES) * DT, pv=one.pv, op=one.op, sp=one.sp, tag="day")
    error = stretch.error
    recent = slice(-CROSS_SAMPLES, None)
    whole = partial(assess, record, kind="flow", pv_range=(0.0, 100.0), delay=DELAY * DT)
    return {
        "four indices": partial(four_indices, stretch),
        "assess, everything": whole,
        "search for S and J, of that": partial(_again, _searches(whole)),
        "oscillation, whole record": partial(oscillation, error, DT, segments=False),
        "oscillation, bursts too": partial(oscillation, error, DT),
        "minimum variance": partial(minimum_variance, error, delay=DELAY),
        "bicoherence": partial(bicoherence, error),
        "cross-correlation": partial(
            cross_correlation, one.op[recent], one.pv[recent], USUAL_PERIOD
        ),
        "statsmodels/scipy, best parts": partial(assembled, stretch, eta_by_products),
        "statsmodels/scipy, AutoReg": partial(assembled, stretch, eta_by_autoreg),
        "statsmodels acf alone": partial(acf_period, error),
        "statsmodels AutoReg alone": partial(eta_by_autoreg, error),
        "numpy bicoherence alone": partial(bicoherence_by_arrays, error),
        "scipy correlate alone": partial(largest_cross_correlation, one.op, one.pv),
    }


def _searches(whole: Callable[[], object]) -> list[tuple[Real, Real, float]]:
    """What an assessment has searched for S and J; nothing on a loop that is not flagged."""
    with patch("monitoring.wave_word.stiction_search", wraps=stiction_search) as search:
        whole()
    return [call.args for call in search.call_args_list]


def _again(searches: list[tuple[Real, Real, float]]) -> None:
    for op, pv, period in searches:
        stiction_search(op, pv, period)


def run() -> Section:
    """Time a calm day and one that swings; the target counts for the slower of the two."""
    loops = [next(virtual_loops(s, 1, samples=SAMPLES, seed=SEED)) for s in STATES]
    timings = [interleaved(_works(one), repeats=15, seconds=15.0) for one in loops]
    rows = tuple((name, *(_cell(times[name]) for times in timings)) for name in timings[0])

    def slowest(name: str) -> float:
        return 1e3 * max(times[name].median for times in timings)

    def ahead(name: str) -> float:
        return min(times[name].median / times["four indices"].median for times in timings)

    indices = 1e3 * max(
        times["assess, everything"].median - times["search for S and J, of that"].median
        for times in timings
    )
    return Section(
        title="A loop-day of 86,400 samples",
        how=(
            "One calm simulated day and one with a wave from outside, seed "
            f"{SEED}, set-point moves and loads in both. Processor time of one core, median and "
            "(best) of up to 15 rounds in turn. " + _agreement(loops)
        ),
        columns=("work", "calm day", "day with a wave"),
        rows=rows,
        targets=(
            Target(what="four indices", limit=5.0, unit="ms", reached=slowest("four indices")),
            Target(what="every index of an assessment but the search for S and J", limit=50.0,
                   unit="ms", reached=indices),
            Target(what="search for S and J", limit=1000.0, unit="ms",
                   reached=slowest("search for S and J, of that")),
            Target(what="four indices against the best parts of statsmodels/scipy", limit=9.0,
                   unit="times", at_least=True, reached=ahead("statsmodels/scipy, best parts")),
            Target(what="four indices against a typical user's code, with AutoReg", limit=50.0,
                   unit="times", at_least=True, reached=ahead("statsmodels/scipy, AutoReg")),
        ),
        notes=(
            "The four indices: strongest oscillation of the whole record, minimum variance, "
            "bicoherence, cross-correlation. The assembled code gives four numbers and no "
            "verdicts; ours look for an oscillation with significance, state an interval of the "
            "minimum-variance index and correlate the last 8,192 samples only.",
            "A typical user takes what statsmodels offers: `acf` and `AutoReg` with its standard "
            "errors; the best parts take the index from the autocovariance by a Toeplitz solver.",
            "`assess` is the whole walk: usage, sensor, moves, load responses, stiction with its "
            "search for S and J where flagged, diagnosis and grade.",
        ),
    )  # fmt: skip


def _cell(timing: Timing) -> str:
    return f"{duration(timing.median)} ({duration(timing.best)})"


def _agreement(loops: list[VirtualLoop]) -> str:
    """Numbers of both sides beside each other."""
    said = []
    for one in loops:
        error = one.sp - one.pv
        eta = minimum_variance(error, delay=DELAY).eta
        said.append(f"{eta:.4f} / {eta_by_products(error):.4f} / {eta_by_autoreg(error):.4f}")
    return (
        "Minimum-variance index ours / by products / by AutoReg, calm and with a wave: "
        + " and ".join(said)
        + "."
    )


if __name__ == "__main__":
    from benchmarks.section import as_markdown

    print(as_markdown(run()))
