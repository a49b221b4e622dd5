"""What the measurement is worth: noise, resolution, frozen, clipped and compressed values."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real
from monitoring.basis import Basis, graded, refusal
from monitoring.loop_signals import FEWEST_SAMPLES, LoopSignals

# Sample differences for the resolution are taken from so many samples: sorting a whole day would
# cost more than everything else together.
RESOLUTION_SAMPLES = 8192
# So many second differences tell their median within one percent.
ENOUGH_DIFFERENCES = 16_384
# A value held this long, while OP moves on, is frozen.
FROZEN_SHARE = 0.1
FROZEN_SAMPLES = 60
# Thornhill et al. (2004, from memory) warn of oscillation and minimum-variance indices beyond
# a compression factor of 3.
COMPRESSION_LIMIT = 3.0
MAD_TO_SD = 1.4826


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorHealth:
    """Condition of the measurement; None where it cannot be known.

    Attributes
    ----------
    good : float
        Part with a PV of the samples in which PV or OP has a value: where neither was recorded,
        the recording stood still and not the sensor. [-]
    noise : float or None
        Standard deviation of the white part of the noise. [PV]
    resolution : float or None
        Step between neighbouring values, where all lie on one grid. [PV]
    coarse : bool
        The resolution is coarser than the standard deviation of PV: statistics of PV are those
        of its rounding, and a PV that keeps one value says nothing.
    longest_flat : float or None
        Longest time in which PV kept one value. [s]
    flat_share : float or None
        Part of the known values in it. [-]
    frozen : bool
        That was longer than a tenth of the record and 60 samples, OP moved in it, and PV is not
        coarse.
    clipped : float or None
        Part of the samples that share the highest or the lowest value, where PV stays there. [-]
    compression : float or None
        Samples a stored one, told by the straight lines between them. [-]
    basis : Basis
        What the numbers rest on.
    """

    good: float
    noise: float | None
    resolution: float | None
    coarse: bool
    longest_flat: float | None
    flat_share: float | None
    frozen: bool
    clipped: float | None
    compression: float | None
    basis: Basis

    @property
    def compressed(self) -> bool:
        """Whether compression is beyond what the statistics bear."""
        return self.compression is not None and self.compression > COMPRESSION_LIMIT


def sensor_health(signals: LoopSignals) -> SensorHealth:
    """Judge the measurement from PV alone, and from OP whether it is frozen."""
    known = np.isfinite(signals.pv)
    pv = signals.pv[known]
    share = float(pv.size / max(signals.pv.size, 1))
    recorded = int(np.count_nonzero(known | np.isfinite(signals.op)))
    good = float(pv.size / max(recorded, 1))
    settings = (
        ("samples for the resolution", float(RESOLUTION_SAMPLES)),
        ("frozen share of the record", FROZEN_SHARE),
    )
    if pv.size < FEWEST_SAMPLES:
        return SensorHealth(
            good=good, noise=None, resolution=None, coarse=False, longest_flat=None,
            flat_share=None, frozen=False, clipped=None, compression=None,
            basis=refusal(f"{pv.size} values of PV are too few", settings=settings),
        )  # fmt: skip
    op = signals.op[known]
    first, last = _longest_run(pv)
    length = last - first
    flat = length > max(FROZEN_SHARE * pv.size, FROZEN_SAMPLES) and _moves(op[first:last])
    noise = noise_level(pv)
    resolution = resolution_of(pv)
    coarse = resolution is not None and resolution > float(np.std(pv))
    return SensorHealth(
        good=good,
        noise=noise,
        resolution=resolution,
        coarse=coarse,
        longest_flat=float((length - 1) * signals.dt),
        flat_share=length / pv.size,
        frozen=flat and not coarse,
        clipped=_clipped(pv),
        compression=_compression(pv),
        basis=graded(share, settings=settings),
    )


def noise_level(pv: Real) -> float:
    r"""Estimate the white part of the noise from second differences.

    .. math:: \hat\sigma = 1.4826 \, median|\Delta^2 pv| / \sqrt 6

    Slow movement cancels; coloured noise is under-estimated, because only its white part shows.

    Parameters
    ----------
    pv : ndarray, shape (n,)
        Process variable without gaps, at least three samples. [PV]
    """
    every = max(pv.size // ENOUGH_DIFFERENCES, 1)
    second = pv[2::every] - 2 * pv[1:-1:every] + pv[:-2:every]
    return float(MAD_TO_SD * np.median(np.abs(second)) / np.sqrt(6))


def resolution_of(pv: Real) -> float | None:
    """Find the grid that all values lie on; None where there is none or one value alone.

    Parameters
    ----------
    pv : ndarray, shape (n,)
        Process variable without gaps. [PV]
    """
    values = np.unique(pv[:RESOLUTION_SAMPLES])
    if values.size < 2:
        return None
    gaps = np.diff(values)
    step = float(np.min(gaps))
    digits = np.spacing(float(np.max(np.abs(values))))
    if step <= 64 * digits or values.size > 0.5 * min(pv.size, RESOLUTION_SAMPLES):
        return None
    counts = gaps / step
    return step if bool(np.all(np.abs(counts - np.round(counts)) < 0.02)) else None


def _longest_run(values: Real) -> tuple[int, int]:
    """First and one past the last index of the longest run of one value."""
    edges = np.r_[0, np.flatnonzero(np.diff(values) != 0) + 1, values.size]
    longest = int(np.argmax(np.diff(edges)))
    return int(edges[longest]), int(edges[longest + 1])


def _moves(op: Real) -> bool:
    seen = op[np.isfinite(op)]
    return bool(seen.size > 1 and np.ptp(seen) > 0)


def _clipped(pv: Real) -> float:
    """Part of the samples at the extreme values, where PV rests there for runs of three."""
    part = 0
    for extreme in (float(np.max(pv)), float(np.min(pv))):
        there = pv == extreme
        rests = np.count_nonzero(there[2:] & there[1:-1] & there[:-2])
        # two runs at least; a rounded signal that touches its highest value once is not clipped
        starts = np.count_nonzero(there[1:] & ~there[:-1])
        if rests >= 2 and starts >= 2:
            part += int(np.count_nonzero(there))
    return float(min(part / pv.size, 1.0)) if np.ptp(pv) > 0 else 0.0


def _compression(pv: Real) -> float:
    """Samples a stored one: a sample on the straight line through its neighbours is not stored.

    Rounded signals hold straight lines too; what two steps in a row by chance make is small.
    """
    first = np.diff(pv)
    scale = float(np.max(np.abs(pv)))
    straight = (np.abs(np.diff(first)) <= 1e-9 * scale) & (first[1:] != 0)
    moving = max(int(np.count_nonzero(first[1:] != 0)), 1)
    stored = max(moving - int(np.count_nonzero(straight)), 1)
    return float(moving / stored)
