"""Closed-loop simulation of one loop: a digital PID around an exactly sampled process."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from loop.controller import PID
from loop.digital_pid import AntiWindup, OutputLimits, scan_laws
from loop.experiment import Experiment, Manual, Signal
from loop.process import Process
from loop.sampled_process import sampled
from loop.scanning import Course, Traces, scan_one
from loop.sensor_faults import SensorFault
from loop.signals import Real
from loop.valve import Valve


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """What a simulated loop did.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Instants of the scans. [s]
    sp : ndarray, shape (n,)
        Set point. [PV]
    pv : ndarray, shape (n,)
        Process variable as the sensor shows it, with noise and resolution. [PV]
    op : ndarray, shape (n,)
        Controller output, held until the next scan. [OP]
    true_pv : ndarray, shape (n,)
        Process variable without noise, at full resolution. [PV]
    position : ndarray, shape (n,)
        Position of the valve, equal to the output where it has no friction. [OP]
    """

    t: Real
    sp: Real
    pv: Real
    op: Real
    true_pv: Real
    position: Real

    @classmethod
    def of(cls, traces: Traces, experiment: Experiment) -> Self:
        """Add the values at rest to the traces of one loop."""
        return cls(
            t=experiment.t,
            sp=traces.sp + experiment.pv0,
            pv=traces.pv + experiment.pv0,
            op=traces.op + experiment.op0,
            true_pv=traces.true_pv + experiment.pv0,
            position=traces.position + experiment.op0,
        )


def simulate(
    process: Process,
    controller: PID,
    *,
    t_end: float,
    dt: float,
    sp: Signal | None = None,
    load: Signal = 0.0,
    output_load: Signal = 0.0,
    noise: float | Real = 0.0,
    rng: np.random.Generator | None = None,
    resolution: float = 0.0,
    limits: OutputLimits | None = None,
    anti_windup: AntiWindup = AntiWindup.BACK_CALCULATION,
    Tt: float | None = None,
    pv0: float = 0.0,
    op0: float = 0.0,
    valve: Valve | None = None,
    faults: Sequence[SensorFault] = (),
    pv_filter: float = 0.0,
    manual: Manual | None = None,
) -> Response:
    """Run a loop from rest.

    The controller runs every dt as `ScanLaw` says. Between scans its output holds and the process
    moves exactly, dead time of any length included.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    t_end, dt : float
        Length of the simulation and scan time. [s]
    sp : Signal, optional
        Set point: a value held from t = 0 on, a `Step` or `Ramp` from `pv0`, or one value a scan.
        It stays at `pv0` if not given. [PV]
    load : Signal
        Disturbance added to the output at the process input; it passes the dead time too. [OP]
    output_load : Signal
        Disturbance added to the process variable. [PV]
    noise : float or ndarray, shape (n,)
        Standard deviation of white measurement noise, which needs `rng`, or the noise itself. [PV]
    rng : numpy.random.Generator, optional
        Source of the noise.
    resolution : float
        Smallest change that the sensor shows, 0 for any. [PV]
    limits : OutputLimits, optional
        Limits of the output; none if not given.
    anti_windup : AntiWindup
        What the integral does at a limit.
    Tt : float, optional
        Tracking time of back-calculation; by `tracking_time` if not given. [s]
    pv0, op0 : float
        Steady state before t = 0. [PV], [OP]
    valve : Choudhury, Kano, He or DeadBand, optional
        Valve between output and process, at rest with its stem at the output; without friction if
        not given.
    faults : sequence of SensorFault
        Faults of the sensor, each on top of the one before.
    pv_filter : float
        Time constant of a first-order filter between the sensor and the law, 0 for none. [s]
    manual : Manual, optional
        Time in manual before the law takes over; none if not given.

    Raises
    ------
    LoopDiverged
        The loop grows without bound.
    ValueError
        A setting is impossible.
    """
    experiment = Experiment(
        t_end=t_end,
        dt=dt,
        sp=sp,
        load=load,
        output_load=output_load,
        noise=noise,
        rng=rng,
        resolution=resolution,
        limits=limits or OutputLimits(),
        anti_windup=anti_windup,
        Tt=Tt,
        pv0=pv0,
        op0=op0,
        valve=valve,
        faults=faults,
        pv_filter=pv_filter,
        manual=manual,
    )
    return run(process, controller, experiment)


def run(process: Process, controller: PID, experiment: Experiment) -> Response:
    """Run a loop from rest through an experiment, by the law of `simulate`.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    experiment : Experiment
        What is done to the loop; noise by its standard deviation is drawn here.

    Raises
    ------
    LoopDiverged
        The loop grows without bound.
    ValueError
        A setting is impossible.
    """
    plant = sampled([process], experiment.dt)
    law = scan_laws(
        [controller], experiment.dt, anti_windup=experiment.anti_windup, Tt=experiment.Tt
    )
    return Response.of(scan_one(plant, law, Course.of(experiment)), experiment)
