"""A small simulated plant: six loops with known processes, for the demo and for tests.

Everything follows from a seed. Because the true process of every loop is known, an answer of the
product can be compared with it, which no recorded plant allows.
"""

import zlib
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from loop.controller import PID, Action
from loop.digital_pid import OutputLimits
from loop.disturbances import coloured_noise, sudden_moves
from loop.open_loop import process_output
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator
from loop.record import Mode, Record
from loop.relay_feedback import Relay, simulate_relay
from loop.sampled_process import scans_in
from loop.signals import Real
from loop.simulation import simulate


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedLoop:
    """One loop of a simulated plant.

    Attributes
    ----------
    tag, description, area : str
        Name of the loop, what it controls and where it stands.
    pv_unit : str
        Unit of the process variable; the output is in percent.
    pv_range, op_range : tuple of float
        Lowest and highest PV and OP. [PV], [OP]
    process : Process
        The true process.
    controller : PID
        The controller that runs today.
    pv0, op0 : float
        Normal operating point. [PV], [OP]
    scan_time : float
        Scan time of the controller and sample time of the records. [s]
    noise : float
        Standard deviation of the measurement noise. [PV]
    resolution : float
        Smallest change that the sensor shows. [PV]
    step : float
        Size of the moves in a step test. [OP]
    hold : float
        Time between the moves of a step test. [s]
    """

    tag: str
    description: str
    area: str
    pv_unit: str
    pv_range: tuple[float, float]
    op_range: tuple[float, float] = (0.0, 100.0)
    process: FOPDT | SOPDT | IPDT | DoubleIntegrator
    controller: PID
    pv0: float
    op0: float
    scan_time: float
    noise: float
    resolution: float
    step: float
    hold: float

    @property
    def limits(self) -> OutputLimits:
        """Limits of the controller output."""
        return OutputLimits(low=self.op_range[0], high=self.op_range[1])


PLANT = (
    SimulatedLoop(
        tag="FIC-101",
        description="Feed flow to the column",
        area="Unit 100",
        pv_unit="m3/h",
        pv_range=(0.0, 80.0),
        process=FOPDT(K=0.8, tau=2.6, theta=0.7),
        controller=PID(Kc=0.9, Ti=2.6),
        pv0=40.0,
        op0=48.0,
        scan_time=0.5,
        noise=0.12,
        resolution=0.01,
        step=5.0,
        hold=40.0,
    ),
    SimulatedLoop(
        tag="PIC-102",
        description="Column top pressure",
        area="Unit 100",
        pv_unit="bar",
        pv_range=(0.0, 10.0),
        process=FOPDT(K=-0.05, tau=28.0, theta=4.5),
        controller=PID(Kc=45.0, Ti=28.0, action=Action.DIRECT),
        pv0=4.2,
        op0=35.0,
        scan_time=1.0,
        noise=0.004,
        resolution=0.001,
        step=4.0,
        hold=240.0,
    ),
    SimulatedLoop(
        tag="LIC-103",
        description="Reflux drum level",
        area="Unit 100",
        pv_unit="%",
        pv_range=(0.0, 100.0),
        process=IPDT(K=-0.006, theta=8.0),
        controller=PID(Kc=2.0, Ti=400.0, action=Action.DIRECT),
        pv0=50.0,
        op0=52.0,
        scan_time=2.0,
        noise=0.08,
        resolution=0.02,
        step=6.0,
        hold=200.0,
    ),
    SimulatedLoop(
        tag="TIC-201",
        description="Heater outlet temperature",
        area="Unit 200",
        pv_unit="degC",
        pv_range=(50.0, 250.0),
        process=FOPDT(K=2.0, tau=120.0, theta=30.0),
        controller=PID(Kc=0.45, Ti=135.0, Td=13.3, tauF=12.0),
        pv0=160.0,
        op0=45.0,
        scan_time=2.0,
        noise=0.12,
        resolution=0.02,
        step=5.0,
        hold=900.0,
    ),
    SimulatedLoop(
        tag="TIC-202",
        description="Jacket temperature, tuned far too slow",
        area="Unit 200",
        pv_unit="degC",
        pv_range=(0.0, 150.0),
        process=SOPDT(K=0.9, tau1=150.0, tau2=25.0, theta=20.0),
        controller=PID(Kc=0.35, Ti=900.0),
        pv0=82.0,
        op0=38.0,
        scan_time=5.0,
        noise=0.06,
        resolution=0.02,
        step=6.0,
        hold=1200.0,
    ),
    SimulatedLoop(
        tag="TIC-203",
        description="Reactor cooling, tuned so tight that it oscillates",
        area="Unit 200",
        pv_unit="degC",
        pv_range=(0.0, 120.0),
        process=FOPDT(K=-0.7, tau=95.0, theta=22.0),
        controller=PID(Kc=7.4, Ti=70.0, action=Action.DIRECT),
        pv0=64.0,
        op0=55.0,
        scan_time=2.0,
        noise=0.05,
        resolution=0.01,
        step=6.0,
        hold=600.0,
    ),
)


def step_test(loop: SimulatedLoop, *, seed: int = 1, start: datetime | None = None) -> Record:
    """Record a step test in manual: rest, up, back, down, back, each held for `loop.hold`.

    Parameters
    ----------
    loop : SimulatedLoop
        Loop to test.
    seed : int
        Seed of the noise.
    start : datetime, optional
        Instant of the first sample in UTC.
    """
    t = np.arange(0.0, 5 * loop.hold, loop.scan_time)
    moves = np.array([0.0, 1.0, 0.0, -1.0, 0.0])[np.minimum(t // loop.hold, 4).astype(int)]
    op = loop.op0 + loop.step * moves
    quiet = process_output(loop.process, t, op, pv0=loop.pv0)
    noisy = quiet + _random(loop, seed).normal(0.0, loop.noise, t.size)
    pv = np.round(noisy / loop.resolution) * loop.resolution
    return _record(
        loop, t=t, sp=np.full(t.size, loop.pv0), pv=pv, op=op, mode=Mode.MAN, start=start
    )


def routine_operation(
    loop: SimulatedLoop, *, duration: float, seed: int = 1, start: datetime | None = None
) -> Record:
    """Record normal operation in automatic: set-point moves, drifting and sudden loads, noise.

    Parameters
    ----------
    loop : SimulatedLoop
        Loop to watch.
    duration : float
        Length of the record. [s]
    seed : int
        Seed of moves, loads and noise.
    start : datetime, optional
        Instant of the first sample in UTC.

    Raises
    ------
    ValueError
        The duration is shorter than one scan.
    """
    if not duration >= loop.scan_time:
        raise ValueError(
            f"duration must be at least one scan of {loop.scan_time} s, got {duration}"
        )
    rng = _random(loop, seed)
    t = np.arange(scans_in(duration, loop.scan_time)) * loop.scan_time
    span = loop.pv_range[1] - loop.pv_range[0]
    sp = loop.pv0 + sudden_moves(t, every=8 * loop.hold, size=0.02 * span, rng=rng)
    load = sudden_moves(t, every=5 * loop.hold, size=0.6 * loop.step, rng=rng)
    load += coloured_noise(t, memory=loop.hold, size=0.1 * loop.step, rng=rng)
    run = simulate(
        loop.process,
        loop.controller,
        t_end=duration,
        dt=loop.scan_time,
        sp=sp,
        load=load,
        noise=loop.noise,
        rng=rng,
        resolution=loop.resolution,
        limits=loop.limits,
        pv0=loop.pv0,
        op0=loop.op0,
    )
    return _record(loop, t=run.t, sp=run.sp, pv=run.pv, op=run.op, mode=Mode.AUTO, start=start)


def relay_test(
    loop: SimulatedLoop, *, cycles: int = 6, seed: int = 1, start: datetime | None = None
) -> Record:
    """Record a relay test of at least so many cycles, switched outside the noise.

    Parameters
    ----------
    loop : SimulatedLoop
        Loop to test.
    cycles : int
        Cycles to wait for.
    seed : int
        Seed of the noise.
    start : datetime, optional
        Instant of the first sample in UTC.
    """
    theta = loop.process.theta + loop.scan_time
    # Four dead times make the longest half cycle a relay without hysteresis can need; hysteresis
    # and lags stretch it, which the factor 2 covers for this plant.
    run = simulate_relay(
        loop.process,
        Relay(
            amplitude=loop.step,
            hysteresis=4 * loop.noise,
            bias=0.2 * loop.step,
            action=loop.controller.action,
        ),
        t_end=cycles * 16 * theta,
        dt=loop.scan_time,
        noise=loop.noise,
        rng=_random(loop, seed),
        resolution=loop.resolution,
        pv0=loop.pv0,
        op0=loop.op0,
    )
    return _record(loop, t=run.t, sp=run.sp, pv=run.pv, op=run.op, mode=Mode.AUTO, start=start)


def _random(loop: SimulatedLoop, seed: int) -> np.random.Generator:
    """Own source of randomness for every loop, the same on every machine."""
    return np.random.default_rng([seed, zlib.crc32(loop.tag.encode())])


def _record(
    loop: SimulatedLoop,
    *,
    t: Real,
    sp: Real,
    pv: Real,
    op: Real,
    mode: Mode,
    start: datetime | None,
) -> Record:
    return Record(
        t=t,
        sp=sp,
        pv=pv,
        op=op,
        mode=np.full(t.size, mode, dtype=np.int8),
        start=start,
        tag=loop.tag,
        pv_unit=loop.pv_unit,
        op_unit="%",
    )
