"""Oscillations of the control error: lines in the spectrum that stay regular in time.

A line is looked for in the spectrum of the whole record and of shorter and shorter segments. What
stands out is filtered to its own band and must pass there as an oscillation: regular crossings of
its autocorrelation, an autocorrelation that lasts, a fair part of the error's variance, and enough
cycles in a row. Its band and its harmonics are then left out and the next one is looked for.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from loop.autoregression import autocovariance
from loop.signals import Flags, Real
from monitoring.basis import Basis, Setting, graded, refusal
from monitoring.spectrum import BandFilter, Spectra, segment_spectra

FEWEST_CYCLES = 6
FEWEST_SAMPLES = 64
SHORTEST_PERIOD = 4.0
# Below this many samples a cycle, the waveform and its amplitude are only guessed.
COARSE_PERIOD = 8.0
BAND = 2**0.4
# Samples a period from which crossings and activity are read; a longer period is thinned to it.
POINTS = 48
SEGMENT_RATIO = 4
SHORTEST_SEGMENT = 96
MOST_OSCILLATIONS = 3
PERSISTENT_SHARE = 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a candidate must reach; fixed on simulated healthy and oscillating loops.

    Attributes
    ----------
    score : float
        Power of the line over the smooth spectrum. [-]
    regularity : float
        Regularity r of the crossings of the autocorrelation. [-]
    lasting : float
        Autocorrelation that is left after two and a half to five periods. [-]
    share : float
        Part of the variance within the band. [-]
    cycles : float
        Cycles in a row. [-]
    """

    score: float
    regularity: float
    lasting: float
    share: float
    cycles: float


WHOLE = Limits(score=7.0, regularity=6.0, lasting=0.5, share=0.3, cycles=4.5)
SEGMENT = Limits(score=30.0, regularity=10.0, lasting=0.75, share=0.4, cycles=5.5)


class OscillationVerdict(StrEnum):
    """Whether a loop oscillates."""

    NONE = "none"
    INTERMITTENT = "intermittent"
    PERSISTENT = "persistent"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True, kw_only=True)
class OscillationComponent:
    """One oscillation.

    Attributes
    ----------
    period : float
        Mean period. [s]
    amplitude : float
        Amplitude of its fundamental wave while it lasts. [PV]
    regularity : float
        r = Tp/(3 sigma) of the filtered autocorrelation [1]_. [-]
    decay_ratio : float
        Autocorrelation that is left after two and a half to five periods. [-]
    score : float
        Power of the line over the smooth spectrum around it. [-]
    share : float
        Part of the variance of the error in its band. [-]
    start, end : float
        First and last instant, from the first sample. [s]
    cycles : float
        Cycles between them. [-]
    persistent : bool
        It lasts through most of the record.

    References
    ----------
    .. [1] N. F. Thornhill, B. Huang and H. Zhang, "Detection of multiple oscillations in control
       loops", Journal of Process Control 13 (2003); the definition is from memory.
    """

    period: float
    amplitude: float
    regularity: float
    decay_ratio: float
    score: float
    share: float
    start: float
    end: float
    cycles: float
    persistent: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Oscillation:
    """Oscillations of a loop, the strongest first.

    Attributes
    ----------
    verdict : OscillationVerdict
        Whether it oscillates.
    components : tuple of OscillationComponent
        What was found.
    basis : Basis
        What this rests on.
    """

    verdict: OscillationVerdict
    components: tuple[OscillationComponent, ...]
    basis: Basis

    @property
    def oscillates(self) -> bool:
        """Whether there is any oscillation."""
        return bool(self.components)

    @property
    def main(self) -> OscillationComponent | None:
        """The strongest oscillation."""
        return self.components[0] if self.components else None


def oscillation(
    error: Real, dt: float, *, share: float = 1.0, compressed: bool = False, segments: bool = True
) -> Oscillation:
    """Find the oscillations of a control error.

    Parameters
    ----------
    error : ndarray, shape (n,)
        Control error, evenly sampled, without gaps. [PV]
    dt : float
        Sample time. [s]
    share : float
        Part of the record that the error covers. [-]
    compressed : bool
        Whether the historian compressed PV beyond what spectra bear.
    segments : bool
        Look for oscillations that last for a part of the record only, too.
    """
    if error.size < FEWEST_SAMPLES:
        return _undecided(f"{error.size} samples are fewer than {FEWEST_SAMPLES}", share)
    if not np.ptp(error) > 1e-12 * float(np.max(np.abs(error))):
        why = "the error does not move"
        return Oscillation(
            verdict=OscillationVerdict.NONE, components=(),
            basis=graded(share, (why,), settings=_settings()),
        )  # fmt: skip
    found: list[OscillationComponent] = []
    seen = _Seen(error)
    while len(found) < MOST_OSCILLATIONS:
        component = _strongest(seen, dt, found, segments=segments)
        if component is None:
            break
        found.append(component)
    doubts = []
    if compressed:
        doubts.append("PV was compressed: weak oscillations are lost and shapes are straightened")
    if found and found[0].period < COARSE_PERIOD * dt:
        doubts.append(f"the period is only {found[0].period / dt:.1f} samples long")
    verdict = OscillationVerdict.NONE
    if found:
        lasting = any(component.persistent for component in found)
        verdict = OscillationVerdict.PERSISTENT if lasting else OscillationVerdict.INTERMITTENT
    return Oscillation(
        verdict=verdict,
        components=tuple(found),
        basis=graded(share, tuple(doubts), settings=_settings()),
    )


def _undecided(why: str, share: float) -> Oscillation:
    return Oscillation(
        verdict=OscillationVerdict.UNDECIDED, components=(),
        basis=refusal(why, share=share, settings=_settings()),
    )  # fmt: skip


def _settings() -> tuple[Setting, ...]:
    return (
        ("score, whole record", WHOLE.score),
        ("score, segment", SEGMENT.score),
        ("regularity, whole record", WHOLE.regularity),
        ("regularity, segment", SEGMENT.regularity),
        ("lasting autocorrelation, whole record", WHOLE.lasting),
        ("lasting autocorrelation, segment", SEGMENT.lasting),
        ("share of the variance, whole record", WHOLE.share),
        ("share of the variance, segment", SEGMENT.share),
        ("cycles in a row, segment", SEGMENT.cycles),
        ("half-width of the band, octaves", float(np.log2(BAND))),
        ("shortest period, samples", SHORTEST_PERIOD),
    )


class _Seen:
    """An error with the transforms that every round of the search needs again."""

    def __init__(self, error: Real) -> None:
        self.error = error
        self._filter: BandFilter | None = None
        self._spectra: dict[int, Spectra] = {}

    @property
    def filter(self) -> BandFilter:
        if self._filter is None:
            self._filter = BandFilter.of(self.error)
        return self._filter

    def spectra(self, length: int) -> Spectra:
        if length not in self._spectra:
            self._spectra[length] = segment_spectra(
                self.error, length, fewest_cycles=FEWEST_CYCLES, shortest=SHORTEST_PERIOD
            )
        return self._spectra[length]


def _strongest(
    seen: _Seen, dt: float, found: list[OscillationComponent], *, segments: bool
) -> OscillationComponent | None:
    """Candidates of the whole record first, then of shorter and shorter segments."""
    length, limits = seen.error.size, WHOLE
    while length >= SHORTEST_SEGMENT or length == seen.error.size:
        component = _confirmed(seen, seen.spectra(length), dt, limits, found)
        if component is not None or not segments:
            return component
        length, limits = length // SEGMENT_RATIO, SEGMENT
    return None


def _confirmed(
    seen: _Seen,
    spectra: Spectra,
    dt: float,
    limits: Limits,
    found: list[OscillationComponent],
) -> OscillationComponent | None:
    """Try the highest line and, in the whole record, two more."""
    scores = spectra.scores.copy()
    scores[:, _belonging(spectra, dt, found)] = 0.0
    # A weaker oscillation is to be a fair part of what the stronger ones leave.
    rest = max(1 - sum(component.share for component in found), 0.0)
    for _ in range(3 if scores.shape[0] == 1 else 1):
        row, column = np.unravel_index(int(np.argmax(scores)), scores.shape)
        score = float(scores[row, column])
        if score < limits.score:
            return None
        period = spectra.length / (spectra.first + int(column))
        first = spectra.starts[int(row)]
        # The share told by the spectrum is cheap; a candidate far below its limit is not filtered.
        if spectra.share(int(row), period, BAND) >= 0.7 * limits.share * rest:
            component = _component(
                seen, period, (first, first + spectra.length), dt=dt, score=score, limits=limits,
                rest=rest,
            )  # fmt: skip
            if component is not None:
                return component
        scores[row, max(int(column) - 2, 0) : int(column) + 3] = 0.0
    return None


def _belonging(spectra: Spectra, dt: float, found: list[OscillationComponent]) -> Flags:
    """Columns in the band of an oscillation that was found, or at its harmonics."""
    cycles = spectra.first + np.arange(spectra.scores.shape[1])
    belongs = np.zeros(cycles.size, dtype=np.bool_)
    for component in found:
        order = cycles * component.period / dt / spectra.length
        belongs |= np.abs(np.log(order)) <= 2 * np.log(BAND)
        belongs |= (order > 1) & (np.abs(order - np.round(order)) < 0.03 * order + 1.5 / cycles)
    return belongs


def _component(
    seen: _Seen,
    period: float,
    region: tuple[int, int],
    *,
    dt: float,
    score: float,
    limits: Limits,
    rest: float,
) -> OscillationComponent | None:
    """Filter to the band and hold the oscillation to its limits; period in samples."""
    wave, step = seen.filter.thinned(period, width=BAND, points=POINTS)
    start, stop = int(region[0] / step), int(np.ceil(region[1] / step))
    variance = float(np.var(seen.error[slice(*region)]))
    share = float(np.var(wave[start:stop])) / variance if variance > 0 else 0.0
    if share < limits.share * rest:
        return None
    mean_period, regularity, lasting = acf_regularity(wave[start:stop], period / step)
    if regularity < limits.regularity or lasting < limits.lasting:
        return None
    first, last, active, amplitude = _activity(wave, period / step, (start, stop))
    if (last - first) * step / period < limits.cycles:
        return None
    end = min(last * step, float(seen.error.size))
    return OscillationComponent(
        period=mean_period * step * dt,
        amplitude=amplitude,
        regularity=regularity,
        decay_ratio=lasting,
        score=score,
        share=share,
        start=first * step * dt,
        end=end * dt,
        cycles=(end - first * step) / (mean_period * step),
        persistent=active >= PERSISTENT_SHARE,
    )


def acf_regularity(wave: Real, period: float) -> tuple[float, float, float]:
    """Period, regularity and what lasts of the autocorrelation of a filtered signal.

    r = Tp/(3 sigma), Tp = 2 mean, sigma = 2 sd of the first ten distances between crossings of 0.

    Parameters
    ----------
    wave : ndarray, shape (n,)
        Signal filtered to one band.
    period : float
        Expected period. [samples]

    Returns
    -------
    period, regularity, lasting : float
        Period [samples], r [-], largest |autocorrelation| from 2.5 to 5 periods [-].
    """
    lags = max(min(int(6.5 * period), wave.size - 2), 1)
    covariance = autocovariance(wave, lags)
    if not covariance[0] > 0:
        return period, 0.0, 0.0
    rho = covariance / covariance[0] / (1 - np.arange(lags + 1) / wave.size)
    turns = np.flatnonzero((rho[1:] > 0) != (rho[:-1] > 0))
    crossings = turns + rho[turns] / (rho[turns] - rho[turns + 1])
    distances = np.diff(crossings[:11])
    tail = np.abs(rho[min(int(2.5 * period), lags) : int(5 * period) + 1])
    lasting = float(min(np.max(tail, initial=0.0), 1.0))
    if distances.size < 4:
        return period, 0.0, lasting
    mean, spread = float(np.mean(distances)), float(np.std(distances))
    # A sampled autocorrelation is never more regular than its crossings can be read.
    return 2 * mean, mean / (3 * max(spread, 1e-3 * mean)), lasting


def _activity(wave: Real, period: float, region: tuple[int, int]) -> tuple[int, int, float, float]:
    """First and one past the last sample of the longest active run, active part, amplitude.

    A window of one period is active where its mean square reaches a quarter of the region's 90 %
    quantile; breaks of up to two periods do not end a run. The active part counts all of the
    record: noise may break the run of a wave that never stops.
    """
    window = max(round(period), 2)
    sums = np.cumsum(np.r_[0.0, wave * wave])
    power = np.maximum(sums[window:] - sums[:-window], 0.0) / window
    there = power[region[0] : max(region[1] - window, region[0] + 1)]
    active = power >= 0.25 * float(np.quantile(there, 0.9))
    places = np.flatnonzero(active)
    breaks = np.flatnonzero(np.diff(places) > 2 * window)
    starts = places[np.r_[0, breaks + 1]]
    ends = places[np.r_[breaks, places.size - 1]]
    part = places.size / power.size
    best = int(np.argmax(ends - starts))
    first, last = int(starts[best]), int(ends[best]) + window
    if part >= PERSISTENT_SHARE:
        first, last = int(starts[0]), int(ends[-1]) + window
    amplitude = float(np.sqrt(2 * np.mean(wave[first:last] ** 2)))
    return first, last, part, amplitude
