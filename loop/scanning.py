"""The scan loop itself, once in floats for one loop and once in arrays for many.

Both run in deviations from the initial rest.
"""

from collections.abc import Generator, Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np

from loop.control_law import LawLimits, ManyLaws, Smoothing, law_of_one
from loop.digital_pid import ScanLaw
from loop.errors import LoopDiverged
from loop.experiment import Experiment
from loop.process_motion import ManyMotions, motion_of_one
from loop.sampled_process import SampledProcesses
from loop.sensor_faults import Reading, SensorFault
from loop.signals import Real
from loop.valve import Valve

# Far beyond any plant in any unit, far below where floats overflow.
DIVERGED = 1e30


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """Everything a scan meets, as deviations from rest.

    Attributes
    ----------
    sp, load, disturbance, noise : ndarray, shape (n,) or (n, m)
        Set point, load at the process input, disturbance and noise of PV.
    by_hand : list of float or None
        Output in manual, none in automatic, for every scan. [OP]
    limits : LawLimits
        Limits of the output.
    valve : Valve, optional
        Valve between output and process.
    faults : tuple of SensorFault
        Faults of the sensor, each on top of the one before.
    resolution, pv0 : float
        Smallest change that the sensor shows and the PV at rest. [PV]
    pv_filter : float
        Time constant of the filter between the sensor and the law, 0 for none. [s]
    t : ndarray, shape (n,)
        Instants of the scans. [s]
    dt : float
        Scan time. [s]
    """

    sp: Real
    load: Real
    disturbance: Real
    noise: Real
    by_hand: list[float | None]
    limits: LawLimits
    valve: Valve | None
    faults: tuple[SensorFault, ...]
    resolution: float
    pv0: float
    pv_filter: float
    t: Real
    dt: float

    @classmethod
    def of(cls, experiment: Experiment, *, loops: int | None = None) -> Self:
        """Refer an experiment to rest; noise is drawn here, for each of `loops` if given.

        Raises
        ------
        ValueError
            A signal has neither one value a scan nor one a scan and loop.
        """
        t, dt = experiment.t, experiment.dt
        signals = {
            "sp": experiment.set_point(t) - experiment.pv0,
            "load": experiment.input_load(t),
            "output_load": experiment.output_disturbance(t),
            "noise": experiment.measurement_noise(t, loops),
        }
        for name, signal in signals.items():
            if signal.shape not in ((t.size,), (t.size, loops)):
                good = f"({t.size},)" if loops is None else f"({t.size},) or ({t.size}, {loops})"
                raise ValueError(f"{name} must have the shape {good}, got {signal.shape}")
        return cls(
            sp=signals["sp"],
            load=signals["load"],
            disturbance=signals["output_load"],
            noise=signals["noise"],
            by_hand=experiment.output_by_hand(t),
            limits=LawLimits.of(
                experiment.limits, experiment.anti_windup, op0=experiment.op0, dt=dt
            ),
            valve=experiment.valve,
            faults=tuple(experiment.faults),
            resolution=experiment.resolution,
            pv0=experiment.pv0,
            pv_filter=experiment.pv_filter,
            t=t,
            dt=dt,
        )

    def sensor(self) -> Reading | None:
        """Begin to read, in deviations from rest; none if the sensor has no fault."""
        readings = [fault.reading(self.t) for fault in self.faults]
        if not readings:
            return None

        def shown(k: int, m: Real) -> Real:
            m = m + self.pv0
            for reading in readings:
                m = reading(k, m)
            return m - self.pv0

        return shown

    def smoothing(self) -> Smoothing | None:
        """Begin to filter; none if there is no filter."""
        return Smoothing(self.pv_filter, self.dt) if self.pv_filter else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Traces:
    """What happened in every scan, shape (n,) or (n, m), deviations from rest.

    Attributes
    ----------
    true_pv, pv : ndarray
        PV without noise, and as the sensor shows it; the same array for many loops whose sensors
        show it as it is. [PV]
    sp : ndarray, shape (n,) or (n, m)
        Set point. [PV]
    op, position : ndarray
        Output, and position of the valve; the same array for a valve without friction. [OP]
    """

    true_pv: Real
    pv: Real
    sp: Real
    op: Real
    position: Real


def scan_one(plant: SampledProcesses, law: ScanLaw, course: Course) -> Traces:
    """Run one loop in plain floats.

    Raises
    ------
    LoopDiverged
        The loop grows without bound.
    """
    scans, move = one_loop(law, course), motion_of_one(plant)
    u = next(scans)
    try:
        while True:
            u = scans.send(move(u))
    except StopIteration as end:
        traces: Traces = end.value
        return traces


def one_loop(
    law: ScanLaw, course: Course, remote_sp: Iterable[float] | None = None
) -> Generator[float, float, Traces]:
    """Run everything of one loop but its process: sensor, law, valve.

    It gives the input of the process for every scan, takes the output of the process at the next
    one, and returns the traces.

    Parameters
    ----------
    law : ScanLaw
        Numbers of the law; the first controller runs.
    course : Course
        What happens to the loop.
    remote_sp : iterable of float, optional
        Set point from elsewhere, taken once a scan, instead of that of the course. [PV]

    Raises
    ------
    LoopDiverged
        The loop grows without bound.
    """
    scan, sensor, smoothing = law_of_one(law, course.limits), course.sensor(), course.smoothing()
    stem = course.valve.one_stem() if course.valve else None
    resolution, pv0 = course.resolution, course.pv0
    true_pv, pv, sp, op, position = [], [], [], [], []
    follows = remote_sp is not None
    signals = (course.load, course.disturbance, course.noise)
    set_points = course.sp.tolist() if remote_sp is None else remote_sp
    x = 0.0
    rows = zip(*(signal.tolist() for signal in signals), course.by_hand, set_points, strict=False)
    for k, (load, disturbance, noise, by_hand, r) in enumerate(rows):
        y = x + disturbance
        m = y + noise
        if not -DIVERGED < m < DIVERGED:
            raise LoopDiverged(k * course.dt)
        if sensor:
            m = float(sensor(k, np.asarray(m)))
        if resolution:
            m = round((m + pv0) / resolution) * resolution - pv0
        u = scan(r, smoothing.of_one(m) if smoothing else m, by_hand)
        true_pv.append(y)
        pv.append(m)
        op.append(u)
        if follows:
            sp.append(r)
        if stem:
            u = stem(u)
            position.append(u)
        x = yield u + load
    outputs = np.array(op)
    return Traces(
        true_pv=np.array(true_pv),
        pv=np.array(pv),
        sp=np.array(sp) if follows else course.sp,
        op=outputs,
        position=np.array(position) if stem else outputs,
    )


def scan_many(plant: SampledProcesses, law: ScanLaw, course: Course) -> Traces:
    """Run m loops at once; one that diverges runs on to infinity without stopping the others."""
    scans, loops = course.sp.shape[0], law.kP.size
    laws, motions = ManyLaws(law, course.limits), ManyMotions(plant, scans)
    stems = course.valve.stem(np.zeros(loops)) if course.valve else None
    sensor, smoothing = course.sensor(), course.smoothing()
    # A sensor that shows what is there needs no trace of its own.
    shown = bool(np.any(course.noise)) or sensor is not None or course.resolution > 0
    true_pv, op = (np.empty((scans, loops)) for _ in range(2))
    pv = np.empty((scans, loops)) if shown else true_pv
    position = np.empty((scans, loops)) if stems else op
    signals = (course.sp, course.load, course.disturbance, course.noise)
    rows = zip(true_pv, pv, op, position, *map(_rows, signals), course.by_hand, strict=True)
    with np.errstate(over="ignore", invalid="ignore"):
        for k, (y, m, u, stem, r, load, disturbance, noise, by_hand) in enumerate(rows):
            motions.read(disturbance, y)
            if shown:
                np.add(y, noise, out=m)
            if sensor:
                m[:] = sensor(k, m)
            if course.resolution:
                steps = np.round((m + course.pv0) / course.resolution)
                np.subtract(steps * course.resolution, course.pv0, out=m)
            laws.scan(r, smoothing.of_many(m) if smoothing else m, by_hand, u)
            if stems:
                stem[:] = stems.step(u)
            motions.move(stem, load)
    return Traces(true_pv=true_pv, pv=pv, sp=course.sp, op=op, position=position)


def _rows(signal: Real) -> Iterable[Real]:
    """One row a scan; what all loops share goes as plain numbers, which numpy adds faster."""
    return signal.tolist() if signal.ndim == 1 else signal
