"""The least variance of the error that a PI or PID could reach on a loop, by its model and data."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.fft

from loop.controller import PID, Action
from loop.digital_pid import AntiWindup, scan_laws
from loop.errors import PoorExcitation
from loop.process import gain_sign
from loop.pulse_transfer import PulseTransfer, pulse_transfer
from loop.sampled_response import law_response
from loop.signals import Complex, Flags, Real
from monitoring.basis import Basis, Setting, graded, refusal
from monitoring.known_loop import KnownLoop
from monitoring.loop_signals import Stretch

Axes: TypeAlias = tuple[Real, Real, Real]
Places: TypeAlias = npt.NDArray[np.intp]

MOST_MS = 2.0
# Segments, each half over the next, and the least that one must hold.
SEGMENTS = 4
FEWEST_IN_SEGMENT = 64
# A segment must hold so many times the answer of the process, or slow disturbances are not seen.
SEGMENT_OVER_PACE = 10.0
# Samples that the answer of the process must last.
FEWEST_OF_PACE = 2.0
# Frequencies are put together as far as the loop does not change within a band.
BAND, TURN = 0.04, 0.25
COARSE_BANDS = 4
ROUNDS = 3
OTHERWISE = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class AchievableVariance:
    """The best a PI or PID could do, against what the loop does.

    Attributes
    ----------
    structure : str
        PI or PID.
    index : float or None
        Achievable over actual variance of the error: 1 for a loop that no PI (PID) could run with
        less variance, near 0 for one that leaves much to gain. Above 1 where the running
        controller is not bound to the limits set here. [-]
    low, high : float or None
        About a 95 % interval from the segments of the record. [-]
    achievable, actual : float or None
        Variance of the error with the best controller, and as it was. [PV^2]
    Kc, Ti, Td : float or None
        The controller that reaches it. [OP/PV], [s], [s]
    Ms : float or None
        Its peak of |1/(1 + L)|. [-]
    stated_over_actual : float or None
        Variance under the stated settings over the actual one: far from 1, other settings ran.
        Any model passes this; whether the model holds is another question. None without
        settings. [-]
    comparable : bool
        Fit for ranking: not averaging level, not saturated, not sticking.
    basis : Basis
        What this rests on.
    """

    structure: str
    index: float | None
    low: float | None
    high: float | None
    achievable: float | None
    actual: float | None
    Kc: float | None
    Ti: float | None
    Td: float | None
    Ms: float | None
    stated_over_actual: float | None
    comparable: bool
    basis: Basis


def achievable_variance(
    stretch: Stretch,
    known: KnownLoop,
    *,
    derivative: bool = False,
    Ms: float = MOST_MS,
    tau_c: float | None = None,
    marks: tuple[str, ...] = (),
) -> AchievableVariance:
    r"""Find the PI or PID of least error variance for the disturbance in the data (own method).

    With A y = B u + A d the sampled process, e = sp - y and u = C e,

    .. math:: x = A e + B u = A (sp - d), \qquad
              \sigma^2(C) = \frac{1}{2\pi}\int_{-\pi}^{\pi}
              \frac{\Phi_x(\omega)}{|A + B C|^2}\,d\omega

    where x follows from the recorded e and u whatever controller ran. The variance is minimised
    over the settings whose loop is stable with max |1/(1 + L)| <= Ms and, where a desired
    closed-loop time constant is stated, has |L| < 1 above 1/(tau_c + theta).

    Parameters
    ----------
    stretch : Stretch
        Controlled part of a record.
    known : KnownLoop
        Process model; its settings are only compared with what ran.
    derivative : bool
        PID with N = 10 instead of PI.
    Ms : float
        Largest peak of the sensitivity. [-]
    tau_c : float, optional
        Desired closed-loop time constant: no faster loop is considered. [s]
    marks : tuple of str
        Why the index must not be used for ranking, if so.
    """
    if not Ms > 1:
        raise ValueError(f"Ms must be above 1, got {Ms}")
    if tau_c is not None and not (np.isfinite(tau_c) and tau_c > 0):
        raise ValueError(f"tau_c must be positive, got {tau_c}")
    structure = "PID" if derivative else "PI"
    settings: tuple[Setting, ...] = (
        ("largest Ms", Ms),
        ("segments", float(2 * SEGMENTS - 1)),
        ("desired time constant, s", "none" if tau_c is None else tau_c),
    )
    try:
        bands = _bands(stretch, known)
        wish = _Wish(known=known, Ms=Ms, tau_c=tau_c)
    except PoorExcitation as reason:
        return AchievableVariance(
            structure=structure, index=None, low=None, high=None, achievable=None, actual=None,
            Kc=None, Ti=None, Td=None, Ms=None, stated_over_actual=None, comparable=False,
            basis=refusal(str(reason), share=stretch.share, settings=settings),
        )  # fmt: skip
    best = _search(bands, wish, derivative=derivative)
    if best is None:
        why = f"no {structure} is stable within Ms {Ms:g} on this model and wish"
        return AchievableVariance(
            structure=structure, index=None, low=None, high=None, achievable=None,
            actual=float(np.var(stretch.error)), Kc=None, Ti=None, Td=None, Ms=None,
            stated_over_actual=None, comparable=False,
            basis=refusal(why, share=stretch.share, settings=settings),
        )  # fmt: skip
    Kc, Ti, Td = best
    gain, peak = _gain_and_peak(bands, wish, best)
    achieved = bands.powers @ gain
    # The error behind the same windows: what they weigh less then cancels.
    index = float(np.mean(achieved) / np.mean(bands.errors))
    low, high = _interval(achieved, bands.errors, index)
    actual = float(np.var(stretch.error))
    stated = _stated_over_actual(bands, known)
    doubts: tuple[str, ...] = ()
    if low > 1:
        doubts = (f"less variance than any {structure} within Ms {Ms:g} has: the loop is tighter",)
    if stated is not None and abs(stated - 1) > OTHERWISE:
        doubts = (
            *doubts,
            f"the stated settings would give {stated:.2f} times this variance: others ran",
        )
    return AchievableVariance(
        structure=structure,
        index=index,
        low=low,
        high=high,
        achievable=index * actual,
        actual=actual,
        Kc=Kc,
        Ti=Ti,
        Td=Td,
        Ms=peak,
        stated_over_actual=stated,
        comparable=not marks,
        basis=graded(stretch.share, (*doubts, *marks), settings=settings),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wish:
    """Which settings are considered."""

    known: KnownLoop
    Ms: float
    tau_c: float | None

    @property
    def integrators(self) -> int:
        """Integrators of the loop, that of the controller included."""
        denominator = np.array(self.known.process.denominator)
        return int(denominator.size - np.flatnonzero(denominator)[-1])

    def unit(self, Ti: float, Td: float) -> PID:
        """Settings with a gain of one."""
        return PID(Kc=1.0, Ti=Ti, Td=Td, action=Action.for_gain(gain_sign(self.known.process)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Bands:
    """Spectrum of x in bands, one row a segment, and the process at the middle of each.

    `errors` is the variance of the error in every segment, behind the same window.
    """

    w: Real
    z: Complex
    A: Complex
    B: Complex
    powers: Real
    errors: Real
    dt: float

    def thinned(self) -> "_Bands":
        """Put neighbouring bands together, for the first look."""
        firsts = np.arange(0, self.w.size, COARSE_BANDS)
        middle = np.minimum(firsts + COARSE_BANDS // 2, self.w.size - 1)
        return _Bands(
            w=self.w[middle], z=self.z[middle], A=self.A[middle], B=self.B[middle],
            powers=np.add.reduceat(self.powers, firsts, axis=1), errors=self.errors, dt=self.dt,
        )  # fmt: skip


def _bands(stretch: Stretch, known: KnownLoop) -> _Bands:
    error, dt = stretch.error, stretch.dt
    if known.unstable:
        raise PoorExcitation("the model is unstable by itself")
    if known.pace < FEWEST_OF_PACE * dt:
        raise PoorExcitation(
            f"the process answers within {known.pace:.3g} s, too fast for samples every {dt:g} s"
        )
    length = error.size // SEGMENTS
    needed = max(FEWEST_IN_SEGMENT, SEGMENT_OVER_PACE * known.pace / dt)
    if length < needed:
        raise PoorExcitation(
            f"{error.size} samples are fewer than the {SEGMENTS * int(np.ceil(needed))} needed"
        )
    if not (np.ptp(error) > 0 and np.ptp(stretch.op) > 0):
        raise PoorExcitation("the error or the output does not move")
    transfer = pulse_transfer(known.process, dt)
    e = error - float(np.mean(error))
    first = max(transfer.a.size, transfer.b.size) - 1 + transfer.q
    x = _disturbance(e, stretch.op, transfer)[first:]
    parts, window = _segments(x, length)
    seen, _ = _segments(e[first:], length)
    w, powers = _spectrum(parts, window)
    width = np.minimum(BAND * w, TURN / (known.process.theta / dt + 1))
    firsts = _firsts(w, width)
    counts = np.diff(np.append(firsts, w.size))
    middle = np.add.reduceat(w, firsts) / counts
    z = np.exp(1j * middle)
    return _Bands(
        w=middle / dt, z=z, A=transfer.denominator(z), B=transfer.numerator(z),
        powers=np.add.reduceat(powers, firsts, axis=1),
        errors=np.mean((seen * window) ** 2, axis=1) / np.mean(window**2), dt=dt,
    )  # fmt: skip


def _disturbance(e: Real, op: Real, transfer: PulseTransfer) -> Real:
    """Compute x = A e + B u; its first samples rest on a past that is not known."""
    u = transfer.delayed(op - float(np.mean(op)))
    return np.asarray(np.convolve(e, transfer.a)[: e.size] + np.convolve(u, transfer.b)[: u.size])


def _segments(signal: Real, length: int) -> tuple[Real, Real]:
    """Segments, each half over the next, one a row, and a Hann window for them."""
    length = min(scipy.fft.next_fast_len(length, real=True), signal.size)
    starts = np.linspace(0, signal.size - length, 2 * SEGMENTS - 1).astype(int)
    return np.stack([signal[s : s + length] for s in starts]), np.hanning(length + 1)[:-1]


def _spectrum(parts: Real, window: Real) -> tuple[Real, Real]:
    """Frequencies in rad a sample, and the power at each, one row a segment."""
    n = window.size
    X = scipy.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window, axis=1)[:, 1:]
    powers = 2 * (X.real**2 + X.imag**2) / (n * float(window @ window))
    if n % 2 == 0:
        powers[:, -1] /= 2
    return 2 * np.pi * np.arange(1, powers.shape[1] + 1) / n, powers


def _firsts(w: Real, width: Real) -> Places:
    """First frequency of every band, each as wide as it may be."""
    firsts: list[int] = []
    k = 0
    while k < w.size:
        firsts.append(k)
        k = max(int(np.searchsorted(w, w[k] + width[k])), k + 1)
    return np.array(firsts, dtype=np.intp)


def _search(bands: _Bands, wish: _Wish, *, derivative: bool) -> tuple[float, float, float] | None:
    """Look over a grid, then over ever finer ones around the best."""
    P = bands.B / bands.A
    phase = np.unwrap(np.angle(P * gain_sign(wish.known.process)))
    beyond = np.flatnonzero(phase <= -np.pi)
    k = int(beyond[0]) if beyond.size else P.size - 1
    Ku, Pu = 1 / float(np.abs(P[k])), 2 * np.pi / float(bands.w[k])
    axes: Axes = (
        Ku * np.geomspace(1e-3, 2.0, 30),
        Pu * np.geomspace(0.1, 60.0, 18),
        Pu * np.r_[0.0, np.geomspace(0.02, 0.4, 5)] if derivative else np.zeros(1),
    )
    coarse = bands.thinned()
    best = _best_of(coarse, wish, axes)
    if best is None:
        best = _best_of(bands, wish, axes)
    if best is None:
        return None
    steps = [np.log(axis[-1] / axis[-2]) if axis.size > 1 else 0.0 for axis in axes]
    for _ in range(ROUNDS):
        fine: Axes = (
            best[0] * np.exp(np.linspace(-1, 1, 7) * steps[0]),
            best[1] * np.exp(np.linspace(-1, 1, 7) * steps[1]),
            np.unique(best[2] * np.exp(np.linspace(-1, 1, 5) * steps[2])),
        )
        best = _best_of(bands, wish, fine) or best
        steps = [step / 3 for step in steps]
    gain, peak = _gain_and_peak(bands, wish, best)
    # The first look may pass what the full bands refuse.
    return best if peak <= wish.Ms and np.all(np.isfinite(gain)) else None


def _best_of(bands: _Bands, wish: _Wish, axes: Axes) -> tuple[float, float, float] | None:
    """Settings of least variance on a grid; None where none passes."""
    Kc, Ti, Td = axes
    pairs = [(T, D) for T in Ti.tolist() for D in Td.tolist()]
    law = scan_laws(
        [wish.unit(T, D) for T, D in pairs], bands.dt, anti_windup=AntiWindup.NONE, Tt=None
    )
    BC = bands.B * law_response(law, bands.z)
    power = bands.powers.mean(axis=0)
    least, found = np.inf, None
    for k in Kc.tolist():
        closed = bands.A + k * BC
        good = _passes(bands, wish, k * BC / bands.A)
        if not good.any():
            continue
        variance = np.where(good, (power / (closed.real**2 + closed.imag**2)).sum(axis=1), np.inf)
        i = int(np.argmin(variance))
        if variance[i] < least:
            least, found = float(variance[i]), (k, *pairs[i])
    return found


def _passes(bands: _Bands, wish: _Wish, L: Complex) -> Flags:
    """Stable, within Ms and no faster than wished; one flag a row of L."""
    back = 1 + L
    good = np.min(np.abs(back), axis=1) >= 1 / wish.Ms
    # 1 + L of a stable loop comes from -90° for every integrator of L and turns to the real axis
    # without passing around 0; each unstable pair of poles adds a turn.
    turned = np.angle(back[:, 1:] / back[:, :-1]).sum(axis=1)
    start = np.angle(back[:, -1]) - turned
    good &= np.abs(start + wish.integrators * np.pi / 2) < np.pi
    if wish.tau_c is not None:
        fast = bands.w > 1 / (wish.tau_c + wish.known.process.theta)
        good &= np.all(np.abs(L[:, fast]) < 1, axis=1)
    return np.asarray(good)


def _gain_and_peak(
    bands: _Bands, wish: _Wish, settings: tuple[float, float, float]
) -> tuple[Real, float]:
    """|1/(A + B C)|^2 in every band, and the peak of |1/(1 + L)|."""
    Kc, Ti, Td = settings
    law = scan_laws([wish.unit(Ti, Td)], bands.dt, anti_windup=AntiWindup.NONE, Tt=None)
    closed = bands.A + Kc * bands.B * law_response(law, bands.z)[0]
    return 1 / np.abs(closed) ** 2, float(np.max(np.abs(bands.A / closed)))


def _stated_over_actual(bands: _Bands, known: KnownLoop) -> float | None:
    """Variance under the stated settings over the actual one."""
    if known.controller is None:
        return None
    law = scan_laws([known.controller], bands.dt, anti_windup=AntiWindup.NONE, Tt=None)
    closed = bands.A + bands.B * law_response(law, bands.z)[0]
    return float(np.sum(bands.powers / np.abs(closed) ** 2) / np.sum(bands.errors))


def _interval(achieved: Real, errors: Real, index: float) -> tuple[float, float]:
    """Interval of about 95 % of a ratio of means over the segments, of which half overlap."""
    spread = float(np.std(achieved - index * errors, ddof=1) / np.mean(errors))
    # Student's t for three degrees of freedom; 7 segments count as 4.
    half = 3.2 * spread / np.sqrt(SEGMENTS)
    return max(index - half, 0.0), index + half
