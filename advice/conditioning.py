"""The details around settings: scan time, filters, N, b, Tt, and what noise does to the output.

The command line, the REST service and a notebook all call this:

    from advice.conditioning import Wanted, conditioning
    found = conditioning(process, pid, Wanted(scan_time=2.0, noise=0.1))
"""

import math
from dataclasses import dataclass

import numpy as np

from advice.horizon import horizon
from loop.controller import PID
from loop.digital_pid import tracking_time
from loop.errors import UnstableLoop
from loop.margins import Margins, margins
from loop.process import Process
from loop.record import Record
from monitoring.sensor import noise_level, resolution_of
from tuning.conditioning import (
    PHASE_COST,
    AntiAlias,
    PVFilter,
    ScanCost,
    anti_alias,
    choose_pv_filter,
    crossover,
    folded_frequency,
    longest_scan_time,
    scan_cost,
)
from tuning.loop_details import (
    FilterRatio,
    WeightChoice,
    choose_set_point_weight,
    filter_ratios,
)

FEWEST_SAMPLES = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What the details have to do; what is left out is not asked.

    Attributes
    ----------
    scan_time : float or None
        Scan time of the controller; the longest that costs `phase_cost` if not given. [s]
    computation : float
        Delay from reading PV to writing the output. [s]
    noise : float or None
        Standard deviation of the sensor's white noise. [PV]
    travel : float or None
        Sum of the output's moves in a day that noise may cause. [OP/day]
    phase_cost : float
        Phase at the gain crossover that a scan, and again a filter, may cost. [deg]
    overshoot : float
        Overshoot of a set-point step that may be. [%]
    attenuation : float
        Gain of the anti-alias filter at half the scan rate. [-]
    order : int
        Order of the anti-alias filter, 1 or 2. [-]
    swing : float or None
        Frequency of a swing to look for in the samples. [rad/s]
    """

    scan_time: float | None = None
    computation: float = 0.0
    noise: float | None = None
    travel: float | None = None
    phase_cost: float = PHASE_COST
    overshoot: float = 5.0
    attenuation: float = 0.1
    order: int = 2
    swing: float | None = None

    def __post_init__(self) -> None:
        if self.scan_time is not None and not 0 < self.scan_time < math.inf:
            raise ValueError(f"scan_time must be positive, got {self.scan_time}")
        if self.noise is not None and not 0 < self.noise < math.inf:
            raise ValueError(f"noise must be positive, got {self.noise}")
        if self.travel is not None and self.noise is None:
            raise ValueError("travel needs noise: without noise nothing moves the output")
        if self.swing is not None and not 0 < self.swing < math.inf:
            raise ValueError(f"swing must be positive, got {self.swing}")


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredNoise:
    """The noise of a sensor, from routine data.

    Attributes
    ----------
    sd : float
        Standard deviation of its white part, and no less than the rounding has. [PV]
    resolution : float or None
        Smallest change that the sensor shows; None where none is seen. [PV]
    samples : int
        Samples it was measured on. [-]
    """

    sd: float
    resolution: float | None
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Conditioning:
    """The details around one controller; what has no answer is None, and a note says why.

    Attributes
    ----------
    process, pid : Process, PID
        The loop.
    wanted : Wanted
        What was asked.
    margins : Margins
        Margins of the continuous loop.
    wc : float
        Highest gain crossover. [rad/s]
    longest : float or None
        Longest scan time within the allowed cost. [s]
    scan_time : float or None
        Scan time that the rest rests on: the stated one, or the longest. [s]
    scan : ScanCost or None
        What it costs.
    pv_filter : PVFilter or None
        Filter on PV against the noise, with the movement of the output without and with it.
    ratios : tuple of FilterRatio
        Margins and movement for the usual N; empty without a derivative or noise.
    weight : WeightChoice or None
        Set-point weight b for the overshoot that may be.
    Tt : float or None
        Tracking time of back-calculation; None without integral action. [s]
    anti_alias : AntiAlias or None
        Filter ahead of the sampling.
    folded : float or None
        Where the swing appears in the samples. [rad/s]
    notes : tuple of str
        Why a part is missing, and what to mind.
    """

    process: Process
    pid: PID
    wanted: Wanted
    margins: Margins
    wc: float
    longest: float | None
    scan_time: float | None
    scan: ScanCost | None
    pv_filter: PVFilter | None
    ratios: tuple[FilterRatio, ...]
    weight: WeightChoice | None
    Tt: float | None
    anti_alias: AntiAlias | None
    folded: float | None
    notes: tuple[str, ...]


def measured_noise(record: Record) -> MeasuredNoise:
    """Measure the white part of the sensor's noise in routine data.

    Parameters
    ----------
    record : Record
        Routine data; gaps are left out.

    Raises
    ------
    ValueError
        There are fewer than 20 samples of PV, or they never change.
    """
    pv = record.pv[np.isfinite(record.pv)]
    if pv.size < FEWEST_SAMPLES:
        raise ValueError(
            f"noise is measured on {FEWEST_SAMPLES} samples of PV or more, got {pv.size}"
        )
    resolution = resolution_of(pv)
    # Rounding to a grid has a spread of its own, which a coarse sensor hides from the estimate.
    rounding = 0.0 if resolution is None else resolution / math.sqrt(12)
    sd = max(noise_level(pv), rounding)
    if not sd:
        raise ValueError("PV shows no noise: it never changes, or lies on straight lines")
    return MeasuredNoise(sd=sd, resolution=resolution, samples=int(pv.size))


def conditioning(process: Process, pid: PID, wanted: Wanted | None = None) -> Conditioning:
    """Work out the details around one controller.

    Parameters
    ----------
    process : Process
        Process model.
    pid : PID
        Controller settings.
    wanted : Wanted, optional
        What the details have to do.

    Raises
    ------
    UnstableLoop
        The loop is unstable before any detail.
    ValueError
        A number cannot be, or the gain of the loop is nowhere 1.
    """
    asked = wanted or Wanted()
    known, wc = margins(process, pid), crossover(process, pid)
    notes: list[str] = []
    longest = _longest(process, pid, asked, notes)
    h = asked.scan_time or longest
    scan = None if h is None else _scan(process, pid, asked, h, notes)
    sound = scan is not None
    return Conditioning(
        process=process,
        pid=pid,
        wanted=asked,
        margins=known,
        wc=wc,
        longest=longest,
        scan_time=h,
        scan=scan,
        pv_filter=_filter(process, pid, asked, h, notes) if h and sound else None,
        ratios=_ratios(process, pid, asked, h, notes) if h and sound else (),
        weight=_weight(process, pid, asked, notes),
        Tt=tracking_time(pid) if pid.Ti < math.inf else None,
        anti_alias=None
        if h is None
        else anti_alias(
            process, pid, scan_time=h, attenuation=asked.attenuation, order=asked.order
        ),
        folded=None if h is None or asked.swing is None else folded_frequency(asked.swing, h),
        notes=tuple(notes),
    )


def _longest(process: Process, pid: PID, asked: Wanted, notes: list[str]) -> float | None:
    try:
        return longest_scan_time(
            process, pid, phase_cost=asked.phase_cost, computation=asked.computation
        )
    except ValueError as reason:
        if not 0 < asked.phase_cost < 90 or not 0 <= asked.computation < math.inf:
            raise
        notes.append(f"No scan time is short enough: {reason}.")
        return None


def _scan(process: Process, pid: PID, asked: Wanted, h: float, notes: list[str]) -> ScanCost | None:
    try:
        cost = scan_cost(process, pid, scan_time=h, computation=asked.computation)
    except UnstableLoop:
        notes.append(f"Scanned every {h:.4g} s the loop is unstable.")
        return None
    if cost.scans_a_filter < 1:
        notes.append(
            f"The derivative filter Td/N of {pid.filter_time:.3g} s is shorter than a scan: "
            "the derivative is no longer what N says."
        )
    return cost


def _filter(
    process: Process, pid: PID, asked: Wanted, h: float, notes: list[str]
) -> PVFilter | None:
    if asked.noise is None:
        return None
    try:
        return choose_pv_filter(
            process, pid, scan_time=h, noise=asked.noise, travel=asked.travel,
            phase_cost=asked.phase_cost,
        )  # fmt: skip
    except UnstableLoop:
        notes.append(f"A filter on PV that costs {asked.phase_cost:.3g}° loses the loop.")
        return None
    except ValueError as reason:
        if asked.travel is not None and not asked.travel > 0:
            raise
        notes.append(f"No movement of the output was found: {reason}.")
        return None


def _ratios(
    process: Process, pid: PID, asked: Wanted, h: float, notes: list[str]
) -> tuple[FilterRatio, ...]:
    if asked.noise is None or not pid.Td:
        return ()
    try:
        return filter_ratios(process, pid, scan_time=h, noise=asked.noise)
    except UnstableLoop:
        notes.append("With one of the usual filter ratios N from 2 to 20 the loop is unstable.")
        return ()
    except ValueError as reason:
        notes.append(f"The filter ratios were not compared: {reason}.")
        return ()


def _weight(process: Process, pid: PID, asked: Wanted, notes: list[str]) -> WeightChoice | None:
    if pid.Ti == math.inf:
        return None  # without integral action b changes where PV comes to rest
    t_end, dt = horizon(process, [pid])
    try:
        return choose_set_point_weight(
            process, pid, most_overshoot=asked.overshoot, scan_time=dt, t_end=t_end
        )
    except ValueError as reason:
        if not 0 <= asked.overshoot < math.inf:
            raise
        notes.append(f"No set-point weight was found: {reason}.")
        return None
