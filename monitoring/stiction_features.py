"""Every number that speaks for or against a sticking valve, in one fixed order."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real
from monitoring.bicoherence import Bicoherence, bicoherence
from monitoring.cross_correlation import CrossCorrelation, cross_correlation
from monitoring.mean_cycle import MeanCycle, mean_cycle
from monitoring.oscillation import Oscillation
from monitoring.regularity import acf_regularity
from monitoring.sensor import noise_level
from monitoring.spectrum import BANDS, band_pass, power_spectrum
from monitoring.wave_shapes import (
    area_ratio,
    hagglund_index,
    harmonic,
    he_index,
    rossi_scali_index,
    slope_kurtosis,
)

# Samples a cycle for the bicoherence, whose segments hold 64.
BICOHERENCE_PERIOD = 16.0
BAND = 2**0.4
# A shape is known from this much; more would only take time.
MOST_SAMPLES, MOST_CYCLES = 6000, 60


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StictionFeatures:
    """What the methods found at one period.

    Attributes
    ----------
    period : float
        Period that was looked at. [samples]
    cycle : MeanCycle
        Mean waves of OP and PV.
    correlation : CrossCorrelation or None
        Shape of the cross-correlation.
    bicoherence : Bicoherence or None
        Non-Gaussianity and non-linearity of the error.
    vector : ndarray, shape (k,)
        The features in the order of `NAMES`.
    """

    period: float
    cycle: MeanCycle
    correlation: CrossCorrelation | None
    bicoherence: Bicoherence | None
    vector: Real


NAMES = (
    "share of the oscillation in the error",
    "regularity, log10",
    "lasting autocorrelation",
    "likeness of the cycles of OP",
    "likeness of the cycles of PV",
    "triangle fit of OP (He)",
    "triangle fit of PV (He)",
    "relay fit of PV (Rossi-Scali)",
    "relay fit of OP (Rossi-Scali)",
    "square fit of PV (Hägglund)",
    "third harmonic of OP, log",
    "third harmonic of PV, log",
    "kurtosis of the slope of PV, log",
    "kurtosis of the slope of OP, log",
    "area ratio of PV, log",
    "delta tau (Horch)",
    "delta rho (Horch)",
    "largest cross-correlation",
    "non-Gaussianity, square root",
    "noise of PV over its sd, log",
    "integrating",
    "triangle fit of PV if integrating",
    "triangle fit of OP if integrating",
)


def stiction_features(
    op: Real, pv: Real, error: Real, swings: Oscillation, dt: float, *, integrating: bool
) -> StictionFeatures | None:
    """Gather the features at the main oscillation, or at the strongest band where there is none.

    Parameters
    ----------
    op, pv, error : ndarray, shape (n,)
        Signals without gaps. [OP], [PV], [PV]
    swings : Oscillation
        Oscillations of the error.
    dt : float
        Sample time. [s]
    integrating : bool
        Whether the process integrates.

    Returns
    -------
    StictionFeatures or None
        None where there are fewer than three cycles to look at.
    """
    main = swings.main
    part = active_part(swings, dt)
    op, pv, error = op[part], pv[part], error[part]
    period = main.period / dt if main is not None else strongest_period(error)
    if period is None:
        return None
    cycle = mean_cycle(op, pv, period)
    if cycle is None:
        return None
    wave = band_pass(error, period, width=BAND)
    _, regularity, lasting = acf_regularity(wave, period)
    share = float(np.var(wave) / max(float(np.var(error)), np.finfo(np.float64).tiny))
    correlation = cross_correlation(op, pv, period)
    rate = max(int(period / BICOHERENCE_PERIOD), 1)
    gaussian = bicoherence(_thinned(error, rate))
    he_op, he_pv = he_index(cycle.op), he_index(cycle.pv)
    spread = max(float(np.std(pv)), np.finfo(np.float64).tiny)
    odd = (0.5, 0.3, 0.5) if correlation is None else (
        correlation.delta_tau, correlation.delta_rho, correlation.largest
    )  # fmt: skip
    vector = np.array([
        min(share, 1.0),
        np.log10(np.clip(regularity, 0.1, 100.0)),
        lasting,
        cycle.op_likeness,
        cycle.pv_likeness,
        he_op,
        he_pv,
        rossi_scali_index(cycle.pv),
        rossi_scali_index(cycle.op),
        hagglund_index(cycle.pv),
        np.log(harmonic(cycle.op, 3) + 1e-3),
        np.log(harmonic(cycle.pv, 3) + 1e-3),
        np.log(slope_kurtosis(cycle.pv)),
        np.log(slope_kurtosis(cycle.op)),
        np.log(area_ratio(cycle.pv)),
        *odd,
        np.sqrt(max(gaussian.NGI, 0.0)) if gaussian is not None else 0.0,
        np.log(noise_level(pv) / spread + 1e-3),
        float(integrating),
        he_pv * integrating,
        he_op * integrating,
    ])  # fmt: skip
    return StictionFeatures(
        period=period, cycle=cycle, correlation=correlation, bicoherence=gaussian, vector=vector
    )


def active_part(swings: Oscillation, dt: float) -> slice:
    """Samples of the main oscillation, all where there is none; the last ones of a long one."""
    main = swings.main
    if main is None:
        return slice(-MOST_SAMPLES, None)
    last = int(main.end / dt)
    most = max(MOST_SAMPLES, int(MOST_CYCLES * main.period / dt))
    return slice(max(int(main.start / dt), last - most), last)


def strongest_period(error: Real) -> float | None:
    """Period with the most power a band of log frequency, six cycles at least. [samples]

    Parameters
    ----------
    error : ndarray, shape (n,)
        Control error without gaps. [PV]
    """
    if error.size < 64 or not np.ptp(error) > 0:
        return None
    power = power_spectrum(error)
    sums = np.cumsum(np.r_[0.0, power])
    bins = np.arange(6, max(int(error.size / 6), 7))
    reach = 2 ** (0.5 / BANDS)
    upper = np.minimum((bins * reach).astype(int) + 1, power.size)
    best = int(bins[np.argmax(sums[upper] - sums[(bins / reach).astype(int)])])
    return error.size / best


def _thinned(signal: Real, rate: int) -> Real:
    """Means of `rate` samples each."""
    if rate == 1:
        return signal
    return np.asarray(signal[: signal.size // rate * rate].reshape(-1, rate).mean(axis=1))
