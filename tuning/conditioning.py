"""Scan time, filter on PV and anti-alias filter: what each costs in margin, and what it saves."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from loop.controller import PID
from loop.crossovers import gain_cuts
from loop.factors import FactoredLoop
from loop.margins import Margins, margins
from loop.process import Process
from tuning.filtered_loop import with_pv_filter
from tuning.output_movement import OutputMovement, output_movement

# A loop of 60 deg keeps 50 with two details of this cost, and few notice one.
PHASE_COST = 5.0


def crossover(process: Process, pid: PID) -> float:
    """Find the highest gain crossover, where a delay costs most. [rad/s]

    Raises
    ------
    ValueError
        |L| is nowhere 1, so that no delay costs phase margin.
    """
    wc = gain_cuts(FactoredLoop.of(process, pid)).wc
    if not wc.size:
        raise ValueError("the gain of the loop is nowhere 1, so a delay costs no phase margin")
    return float(wc.max())


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanCost:
    """What a scan time costs.

    Attributes
    ----------
    scan_time, computation : float
        Scan time, and delay from reading PV to writing the output. [s]
    wc : float
        Gain crossover. [rad/s]
    phase_cost : float
        Phase that the delay takes at wc, wc (scan_time/2 + computation). [deg]
    continuous, scanned : Margins
        Margins without and with that delay.
    scans_a_filter : float
        Scans within the time constant Td/N of the derivative filter, infinite without a
        derivative; below 1 the derivative is no longer what N says. [-]
    """

    scan_time: float
    computation: float
    wc: float
    phase_cost: float
    continuous: Margins
    scanned: Margins
    scans_a_filter: float


def scan_cost(
    process: Process, pid: PID, *, scan_time: float, computation: float = 0.0
) -> ScanCost:
    """Work out what a scan time costs: the hold delays by half of it, the computation by all.

    Parameters
    ----------
    process : Process
        Process model.
    pid : PID
        Controller settings.
    scan_time : float
        Scan time. [s]
    computation : float
        Delay from reading PV to writing the output. [s]

    Raises
    ------
    UnstableLoop
        The loop is unstable, with or without that delay.
    ValueError
        A time is negative, or the gain of the loop is nowhere 1.
    """
    if not (0 <= scan_time < math.inf and 0 <= computation < math.inf):
        raise ValueError(
            f"scan_time and computation must not be negative, got {scan_time} and {computation}"
        )
    wc = crossover(process, pid)
    later = replace(process, theta=process.theta + computation)
    return ScanCost(
        scan_time=scan_time,
        computation=computation,
        wc=wc,
        phase_cost=math.degrees(wc * (scan_time / 2 + computation)),
        continuous=margins(process, pid),
        scanned=margins(later, pid, sample_time=scan_time),
        scans_a_filter=pid.filter_time / scan_time if pid.Td and scan_time else math.inf,
    )


def longest_scan_time(
    process: Process, pid: PID, *, phase_cost: float = PHASE_COST, computation: float = 0.0
) -> float:
    """Find the scan time whose delay costs so much phase, h = 2 (cost/wc - computation). [s]

    Parameters
    ----------
    process : Process
        Process model.
    pid : PID
        Controller settings.
    phase_cost : float
        Phase at the gain crossover that may be lost. [deg]
    computation : float
        Delay from reading PV to writing the output. [s]

    Raises
    ------
    ValueError
        The computation alone costs as much, or the gain of the loop is nowhere 1.
    """
    if not 0 < phase_cost < 90:
        raise ValueError(f"phase_cost must lie between 0 and 90 deg, got {phase_cost}")
    wc = crossover(process, pid)
    left = math.radians(phase_cost) / wc - computation
    if not left > 0:
        raise ValueError(
            f"the computation of {computation:.4g} s alone costs "
            f"{math.degrees(wc * computation):.3g} deg at {wc:.4g} rad/s; "
            f"{phase_cost:.3g} deg are allowed"
        )
    return 2 * left


@dataclass(frozen=True, slots=True, kw_only=True)
class PVFilter:
    """A first-order filter on PV, with its price.

    Attributes
    ----------
    time : float
        Time constant, 0 for no filter. [s]
    enough : bool
        Whether the travel asked for is reached, if any was.
    phase_cost : float
        Phase that it takes at the gain crossover, atan(wc time). [deg]
    before, after : OutputMovement
        What the noise does to the output without and with it.
    without, within : Margins
        Margins of the scanned loop without and with it.
    """

    time: float
    enough: bool
    phase_cost: float
    before: OutputMovement
    after: OutputMovement
    without: Margins
    within: Margins


def choose_pv_filter(
    process: Process,
    pid: PID,
    *,
    scan_time: float,
    noise: float,
    travel: float | None = None,
    phase_cost: float = PHASE_COST,
) -> PVFilter:
    """Find the fastest filter on PV that keeps the output's travel from noise within a limit.

    Where the filter that costs the allowed phase is not enough, that one is the answer, and
    `enough` says so: then the controller must become slower, or the sensor better.

    Parameters
    ----------
    process : Process
        Process model.
    pid : PID
        Controller settings.
    scan_time : float
        Scan time. [s]
    noise : float
        Standard deviation of the measured white noise. [PV]
    travel : float, optional
        Sum of the output's moves in a day that noise may cause; if not given, the filter that
        costs the allowed phase is the answer. [OP/day]
    phase_cost : float
        Phase at the gain crossover that the filter may cost. [deg]

    Raises
    ------
    UnstableLoop
        The loop is unstable, with or without the filter.
    ValueError
        A number is impossible, or the gain of the loop is nowhere 1.
    """
    if travel is not None and not travel > 0:
        raise ValueError(f"travel must be positive, got {travel}")
    if not 0 < phase_cost < 90:
        raise ValueError(f"phase_cost must lie between 0 and 90 deg, got {phase_cost}")
    wc = crossover(process, pid)
    slowest = math.tan(math.radians(phase_cost)) / wc

    def moved(time: float) -> OutputMovement:
        return output_movement(process, pid, scan_time=scan_time, noise=noise, pv_filter=time)

    before = moved(0.0)
    if travel is not None and before.travel <= travel:
        time, after = 0.0, before
    else:
        time, after = slowest, moved(slowest)
    if travel is not None and time and after.travel < travel:
        limit = travel
        time = _fastest(lambda candidate: moved(candidate).travel <= limit, slowest)
        after = moved(time)
    return PVFilter(
        time=time,
        enough=travel is None or after.travel <= travel,
        phase_cost=math.degrees(math.atan(wc * time)),
        before=before,
        after=after,
        without=margins(process, pid, sample_time=scan_time),
        within=margins(*with_pv_filter(process, pid, time), sample_time=scan_time),
    )


def _fastest(enough: Callable[[float], bool], slowest: float) -> float:
    """Halve the stretch in which the filter becomes enough, to a thousandth of the slowest."""
    fast, slow = 0.0, slowest
    while slow - fast > 1e-3 * slowest:
        middle = (fast + slow) / 2
        fast, slow = (fast, middle) if enough(middle) else (middle, slow)
    return slow


@dataclass(frozen=True, slots=True, kw_only=True)
class AntiAlias:
    """An analogue filter ahead of the sampling.

    Attributes
    ----------
    order : int
        1 for one lag, 2 for a Butterworth filter. [-]
    w0 : float
        Corner frequency. [rad/s]
    attenuation : float
        Gain at the Nyquist frequency pi/scan_time. [-]
    phase_cost : float
        Phase that it takes at the gain crossover. [deg]
    """

    order: int
    w0: float
    attenuation: float
    phase_cost: float


def anti_alias(
    process: Process, pid: PID, *, scan_time: float, attenuation: float = 0.1, order: int = 2
) -> AntiAlias:
    """Lay out the filter that keeps what is faster than half the scan rate out of the samples.

    |G(j pi/h)| = 1/sqrt(1 + (pi/(h w0))^(2 order)) gives w0. Its phase at wc is atan x for one
    lag and atan2(sqrt(2) x, 1 - x^2) for two, x = wc/w0. A digital filter behind the sampling
    cannot do this: a swing of frequency f looks like one of |f - k/h|, k the nearest whole number.

    Parameters
    ----------
    process : Process
        Process model.
    pid : PID
        Controller settings.
    scan_time : float
        Scan time. [s]
    attenuation : float
        Gain wanted at the Nyquist frequency. [-]
    order : int
        1 for one lag, 2 for a Butterworth filter. [-]

    Raises
    ------
    ValueError
        A number is impossible, or the gain of the loop is nowhere 1.
    """
    if not 0 < scan_time < math.inf:
        raise ValueError(f"scan_time must be positive, got {scan_time}")
    if not 0 < attenuation < 1 or order not in (1, 2):
        raise ValueError(
            f"attenuation must lie between 0 and 1 and order be 1 or 2, got {attenuation} "
            f"and {order}"
        )
    w0 = math.pi / scan_time / (attenuation**-2 - 1) ** (0.5 / order)
    x = crossover(process, pid) / w0
    lag = math.atan(x) if order == 1 else math.atan2(math.sqrt(2) * x, 1 - x * x)
    return AntiAlias(order=order, w0=w0, attenuation=attenuation, phase_cost=math.degrees(lag))


def folded_frequency(frequency: float, scan_time: float) -> float:
    """Frequency at which a swing appears in the samples. [rad/s]

    Parameters
    ----------
    frequency : float
        Frequency of the swing. [rad/s]
    scan_time : float
        Sample time. [s]
    """
    rate = 2 * math.pi / scan_time
    return abs(frequency - rate * round(frequency / rate))
