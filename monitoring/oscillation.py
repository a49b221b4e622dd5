"""Oscillations of the control error: lines in the spectrum that stay regular in time.

A line is looked for in the spectrum of the whole record and of shorter and shorter segments. What
stands out is filtered to its own band and must pass there as an oscillation: regular crossings of
its autocorrelation, an autocorrelation that lasts, a fair part of the error's variance, and enough
cycles in a row. Its band and its harmonics are then left out and the next one is looked for.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from loop.signals import Flags, Real
from monitoring.activity import PERSISTENT_SHARE, activity
from monitoring.basis import Basis, Setting, graded, refusal
from monitoring.bursts import BURST, SHORTEST_PERIOD, BurstSearch
from monitoring.regularity import (
    ENVELOPE_POINTS,
    FEW_POINTS,
    acf_regularity,
    band_wave,
    is_long,
    spectrum_regularity,
)
from monitoring.spectrum import BandFilter, band_pass

FEWEST_CYCLES = 6
FEWEST_SAMPLES = 64
# Below this many samples a cycle, the waveform and its amplitude are only guessed.
COARSE_PERIOD = 8.0
BAND = 2**0.4
MOST_OSCILLATIONS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a candidate must reach; fixed on simulated healthy and oscillating loops.

    Attributes
    ----------
    regularity : float
        Regularity r of the crossings of the autocorrelation. [-]
    lasting : float
        Autocorrelation that is left after two and a half to five periods. [-]
    share : float
        Part of the variance within the band. [-]
    cycles : float
        Cycles in a row. [-]
    """

    regularity: float
    lasting: float
    share: float
    cycles: float


# Power of a line of the whole record over the smooth spectrum.
LINE_SCORE = 7.0
WHOLE = Limits(regularity=6.0, lasting=0.5, share=0.3, cycles=4.5)
CLEAR = Limits(regularity=10.0, lasting=0.75, share=0.4, cycles=5.5)


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
        Power of the line over the smooth spectrum around it; of a part, over the noise's. [-]
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
    error: Real,
    dt: float,
    *,
    share: float = 1.0,
    compressed: bool = False,
    segments: bool = True,
    most: int = MOST_OSCILLATIONS,
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
    most : int
        Stop after so many.
    """
    if error.size < FEWEST_SAMPLES:
        return _undecided(f"{error.size} samples are fewer than {FEWEST_SAMPLES}", share)
    low, high = float(np.min(error)), float(np.max(error))
    if not high - low > 1e-12 * max(high, -low):
        why = "the error does not move"
        return Oscillation(
            verdict=OscillationVerdict.NONE, components=(),
            basis=graded(share, (why,), settings=_settings()),
        )  # fmt: skip
    seen = _Seen(error)
    found: list[OscillationComponent] = []
    while len(found) < most:
        component = _of_whole(seen, dt, found)
        if component is None:
            break
        found.append(component)
    while segments and len(found) < most:
        component = _of_part(seen, dt, found)
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
        ("score, whole record", LINE_SCORE),
        ("evidence, part", BURST.evidence),
        ("regularity, whole record", WHOLE.regularity),
        ("regularity, clear part", CLEAR.regularity),
        ("lasting autocorrelation, whole record", WHOLE.lasting),
        ("lasting autocorrelation, clear part", CLEAR.lasting),
        ("share of the variance, whole record", WHOLE.share),
        ("share of the variance, clear part", CLEAR.share),
        ("share of the variance, faint part", BURST.share),
        ("cycles in a row, clear part", CLEAR.cycles),
        ("cycles in a row, faint part", BURST.cycles),
        ("half-width of the band, octaves", float(np.log2(BAND))),
        ("shortest period, samples", SHORTEST_PERIOD),
    )


class _Seen:
    """An error with the transforms that every round of the search needs again."""

    def __init__(self, error: Real) -> None:
        self.error = error
        self.filter = BandFilter.of(error)
        self.lines = self.filter.lines(fewest_cycles=FEWEST_CYCLES, shortest=SHORTEST_PERIOD)

    @cached_property
    def bursts(self) -> BurstSearch:
        return BurstSearch(self.filter)


def _of_whole(
    seen: _Seen, dt: float, found: list[OscillationComponent]
) -> OscillationComponent | None:
    """Try the highest line of the whole record and two more."""
    lines = seen.lines
    columns = np.flatnonzero(lines.scores >= LINE_SCORE)
    scores = lines.scores[columns]
    scores[_belonging(lines.length / (lines.first + columns), lines.length, dt, found)] = 0.0
    # A weaker oscillation is to be a fair part of what the stronger ones leave.
    rest = max(1 - sum(component.share for component in found), 0.0)
    for _ in range(3):
        best = int(np.argmax(scores)) if scores.size else 0
        if not scores.size or scores[best] < LINE_SCORE:
            return None
        period = lines.length / (lines.first + int(columns[best]))
        # The share told by the spectrum is cheap; a candidate far below its limit is not filtered.
        if lines.share(period, BAND) >= 0.7 * WHOLE.share * rest:
            component = _component(
                seen, period, (0, seen.error.size), dt=dt, score=float(scores[best]), limits=WHOLE,
                rest=rest,
            )  # fmt: skip
            if component is not None:
                return component
        scores[np.abs(columns - columns[best]) <= 2] = 0.0
    return None


def _of_part(
    seen: _Seen, dt: float, found: list[OscillationComponent]
) -> OscillationComponent | None:
    """Find the strongest tone that a part of the record holds.

    One that is clear in the band around it may be irregular and last longer than the tone that
    was fitted; of a faint one only the fitted part is known.
    """
    burst = seen.bursts.strongest(lambda periods, samples: _belonging(periods, samples, dt, found))
    if burst is None:
        return None
    n = seen.error.size
    region = (int(burst.start), min(int(np.ceil(burst.end)), n))
    if burst.share >= 0.7 * CLEAR.share:
        clear = _component(
            seen, burst.period, region, dt=dt, score=burst.score, limits=CLEAR, rest=1.0
        )
        if clear is not None:
            return clear
    margin = int(3 * burst.period)
    near = slice(max(region[0] - margin, 0), region[1] + margin)
    wave = band_pass(seen.error[near], burst.period, width=BAND)
    wave = wave[region[0] - near.start :][: region[1] - region[0]]
    _, regularity, lasting = acf_regularity(wave, burst.period)
    return OscillationComponent(
        period=burst.period * dt,
        amplitude=burst.amplitude,
        regularity=regularity,
        decay_ratio=lasting,
        score=burst.score,
        share=float(np.var(wave) / np.var(seen.error[slice(*region)])),
        start=burst.start * dt,
        end=burst.end * dt,
        cycles=burst.cycles,
        persistent=burst.end - burst.start >= PERSISTENT_SHARE * n,
    )


def _belonging(
    periods: Real, samples: float, dt: float, found: list[OscillationComponent]
) -> Flags:
    """Periods [samples] in the band of an oscillation that was found, or at its harmonics.

    A harmonic is told as exactly as so many samples tell periods.
    """
    belongs = np.zeros(periods.size, dtype=np.bool_)
    for component in found:
        order = component.period / dt / periods
        belongs |= np.abs(np.log(order)) <= 2 * np.log(BAND)
        blur = 0.03 * order + 1.5 * periods / samples
        belongs |= (order > 1) & (np.abs(order - np.round(order)) < blur)
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
    steady = None
    if region == (0, seen.error.size) and is_long(seen.error.size, period):
        steady = spectrum_regularity(seen.filter, period, width=BAND)
        if steady[1] < limits.regularity or steady[2] < limits.lasting:
            return None
    points = FEW_POINTS if steady else ENVELOPE_POINTS
    wave = band_wave(seen.filter, period, width=BAND, points=points)
    step = wave.step
    start, stop = int(region[0] / step), int(np.ceil(region[1] / step))
    variance = float(np.var(seen.error[slice(*region)]))
    share = float(np.mean(wave.square[start:stop])) / variance if variance > 0 else 0.0
    if share < limits.share * rest:
        return None
    mean_period, regularity, lasting = steady or wave.regularity(start, stop)
    if regularity < limits.regularity or lasting < limits.lasting:
        return None
    first, last, active, amplitude = activity(wave.square, period / step, (start, stop))
    if (last - first) * step / period < limits.cycles:
        return None
    end = min(last * step, float(seen.error.size))
    return OscillationComponent(
        period=mean_period * dt,
        amplitude=amplitude,
        regularity=regularity,
        decay_ratio=lasting,
        score=score,
        share=share,
        start=first * step * dt,
        end=end * dt,
        cycles=(end - first * step) / mean_period,
        persistent=active >= PERSISTENT_SHARE,
    )
