"""Frequency response of a process from a chirp, sine steps or a multisine, with its confidence.

The local polynomial method [1]_: over a few neighbouring lines of the spectrum the response and the
transient, which is what leaks in from before and after the record, are both smooth, and so both are
fitted by a parabola in frequency. What is left over tells the noise, and with it the coherence and
the confidence of every point.

References
----------
.. [1] R. Pintelon, J. Schoukens, G. Vandersteen, and K. Barbé, "Estimation of nonparametric noise
   and FRF models for multivariable systems - Part I: Theory," Mech. Syst. Signal Process., vol. 24,
   no. 3, pp. 573-595, 2010. doi:10.1016/j.ymssp.2009.08.009 (cited from memory)
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft, rfftfreq

from identification.held_input import Indices
from loop.errors import PoorExcitation
from loop.record import Record
from loop.signals import Complex, Flags, Real

# Parabolas in frequency, for the response and the transient: six unknowns.
ORDER = 2
UNKNOWNS = 2 * (ORDER + 1)
# Lines on either side at least, and lines with power of OP among them at least.
NARROWEST, WITH_POWER = 5, 5
# Lines whose amplitude is below this part of the largest carry nothing.
EXCITED = 0.01
# A point that noise may move by a quarter of itself is left out.
HIDDEN = 0.25
# Beyond a quarter of the sampling frequency the hold of the output is no longer taken out well.
HIGHEST = 0.25
FEWEST_SAMPLES = 100
# Uneven samples have no spectrum.
EVEN = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrequencyResponse:
    """Points of the frequency response of a process.

    Attributes
    ----------
    w : ndarray, shape (n,)
        Frequencies, ascending. [rad/s]
    G : ndarray of complex, shape (n,)
        Response. [PV/OP]
    sd : ndarray, shape (n,)
        Standard deviation of the error of G, as a complex number: that of its size and, over |G|,
        of its angle are 1/sqrt(2) of it. [PV/OP]
    coherence : ndarray, shape (n,)
        Part of PV's power near that line that follows OP linearly. [-]
    stride : int
        Points so far apart rest on different lines.
    """

    w: Real
    G: Complex
    sd: Real
    coherence: Real
    stride: int


def frequency_response(record: Record) -> FrequencyResponse:
    """Estimate the frequency response in open loop from all lines that the output excites.

    G(j w) of the process itself: the hold of the output between samples, (1 - e^(-j w h))/(j w h),
    is taken out.

    Parameters
    ----------
    record : Record
        Output moved over many frequencies in manual; even samples, no gaps, PV at rest before or
        not.

    Raises
    ------
    PoorExcitation
        Samples are few, uneven or missing, or the output excites too few lines.
    """
    h = _spacing(record)
    n = len(record)
    U, Y = rfft(record.op - record.op.mean()), rfft(record.pv - record.pv.mean())
    w = 2 * math.pi * rfftfreq(n, h)
    usable = (w > 0) & (w <= HIGHEST * 2 * math.pi / h)
    excited = usable & (np.abs(U) > EXCITED * np.max(np.abs(U[usable])))
    half, gap, centres = _windows(excited)
    G, variance, coherence = _local(U, Y, centres, half)
    hold = -np.expm1(-1j * w[centres] * h) / (1j * w[centres] * h)
    G, sd = G / hold, np.sqrt(variance) / np.abs(hold)
    shown = sd < HIDDEN * np.abs(G)
    if np.count_nonzero(shown) < WITH_POWER:
        raise PoorExcitation(
            f"Only {np.count_nonzero(shown)} points of the response stand out of the noise; move "
            "OP further, or record longer."
        )
    return FrequencyResponse(
        w=w[centres][shown],
        G=G[shown],
        sd=sd[shown],
        coherence=coherence[shown],
        stride=math.ceil((2 * half + 1) / gap),
    )


def _spacing(record: Record) -> float:
    """Even spacing of the samples. [s]"""
    if len(record) < FEWEST_SAMPLES:
        raise PoorExcitation(
            f"A frequency response needs at least {FEWEST_SAMPLES} samples, got {len(record)}."
        )
    if not (np.all(np.isfinite(record.pv)) and np.all(np.isfinite(record.op))):
        raise PoorExcitation("A frequency response needs PV and OP without gaps; cut them out.")
    steps = np.diff(record.t)
    h = float(record.t[-1] - record.t[0]) / steps.size
    if float(np.max(np.abs(steps - h))) > EVEN * h:
        raise PoorExcitation("A frequency response needs even samples; resample the record first.")
    if np.ptp(record.op) == 0 or np.ptp(record.pv) == 0:
        raise PoorExcitation("PV or OP stands still, so there is no response to read.")
    return h


def _windows(excited: Flags) -> tuple[int, int, Indices]:
    """Half-width of a window with enough excited lines, their spacing, where it can stand."""
    lines = np.flatnonzero(excited)
    if lines.size < WITH_POWER:
        raise PoorExcitation(
            f"OP excites {lines.size} lines of the spectrum only; a frequency response needs at "
            f"least {WITH_POWER}. Move OP over more frequencies, or record longer."
        )
    # A multisine leaves gaps between its lines, which the window has to bridge.
    gap = int(np.median(np.diff(lines)))
    half = max(NARROWEST, math.ceil(gap * WITH_POWER / 2))
    counts = np.convolve(excited, np.ones(2 * half + 1), mode="same")
    inside = (lines >= half) & (lines < excited.size - half) & (counts[lines] >= WITH_POWER)
    if not np.any(inside):
        raise PoorExcitation(
            "OP excites lines of the spectrum that lie too far apart or too low; record longer."
        )
    return half, gap, lines[inside]


def _local(U: Complex, Y: Complex, centres: Indices, half: int) -> tuple[Complex, Real, Real]:
    """Response, its variance and the coherence at every centre, by local parabolas."""
    r = np.arange(-half, half + 1)
    powers = (r / half)[:, None] ** np.arange(ORDER + 1)
    at = centres[:, None] + r
    u, y = U[at], Y[at]
    scale = np.sqrt(np.mean(np.abs(u) ** 2, axis=1))
    columns = np.concatenate(
        [u[:, :, None] / scale[:, None, None] * powers, np.broadcast_to(powers, (*at.shape, 3))],
        axis=2,
    )
    q, triangle = np.linalg.qr(columns)
    projected = np.einsum("kij,ki->kj", q.conj(), y)
    inverse = np.linalg.inv(triangle + 1e-12 * np.eye(UNKNOWNS))
    found = np.einsum("kij,kj->ki", inverse, projected)
    left = y - np.einsum("kij,kj->ki", q, projected)
    noise = np.sum(np.abs(left) ** 2, axis=1) / (2 * half + 1 - UNKNOWNS)
    # The few lines of one window tell the noise badly; its neighbours have the same.
    width = 2 * half + 1
    noise = np.convolve(np.pad(noise, half, mode="edge"), np.ones(width) / width, mode="valid")
    G = found[:, 0] / scale
    variance = noise * np.sum(np.abs(inverse[:, 0]) ** 2, axis=1) / scale**2
    signal = np.abs(G * u[:, half]) ** 2
    return G, variance, signal / np.maximum(signal + noise, 1e-300)
