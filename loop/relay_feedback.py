"""Simulated relay test: a relay with hysteresis drives the loop into a limit cycle."""

import math
from dataclasses import dataclass
from operator import mul

import numpy as np

from loop.controller import Action
from loop.errors import LoopDiverged
from loop.experiment import Experiment
from loop.process import Process
from loop.sampled_process import sampled
from loop.scanning import DIVERGED
from loop.simulation import Response


@dataclass(frozen=True, slots=True, kw_only=True)
class Relay:
    """Relay with hysteresis around the set point.

    Attributes
    ----------
    amplitude : float
        Distance of both outputs from their middle. [OP]
    hysteresis : float
        Distance from the set point at which the relay switches. [PV]
    bias : float
        Distance of the middle of the outputs from the output at rest. [OP]
    action : Action
        Reverse (high while PV is low) for a positive process gain, direct for a negative one.
    """

    amplitude: float
    hysteresis: float = 0.0
    bias: float = 0.0
    action: Action = Action.REVERSE

    def __post_init__(self) -> None:
        if not 0 < self.amplitude < math.inf:
            raise ValueError(f"amplitude must be positive, got {self.amplitude}")
        if not 0 <= self.hysteresis < math.inf:
            raise ValueError(f"hysteresis must be 0 or positive, got {self.hysteresis}")
        if not abs(self.bias) < self.amplitude:
            raise ValueError(
                f"bias must be smaller than the amplitude {self.amplitude}, got {self.bias}: "
                "with both outputs on one side of rest there is no cycle"
            )


def simulate_relay(
    process: Process,
    relay: Relay,
    *,
    t_end: float,
    dt: float,
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
    resolution: float = 0.0,
    pv0: float = 0.0,
    op0: float = 0.0,
) -> Response:
    """Run a relay test from rest, the set point at `pv0`; the relay starts high.

    The relay looks once a scan and switches when the measured error has passed the hysteresis;
    between scans the process moves exactly.

    Parameters
    ----------
    process : Process
        Process model.
    relay : Relay
        Relay settings.
    t_end, dt : float
        Length of the test and scan time. [s]
    noise : float
        Standard deviation of white measurement noise, which needs `rng`. [PV]
    rng : numpy.random.Generator, optional
        Source of the noise.
    resolution : float
        Smallest change that the sensor shows, 0 for any. [PV]
    pv0, op0 : float
        Steady state before the test. [PV], [OP]

    Raises
    ------
    LoopDiverged
        The relay cannot hold an unstable process.
    ValueError
        A setting is impossible.
    """
    experiment = Experiment(
        t_end=t_end, dt=dt, noise=noise, rng=rng, resolution=resolution, pv0=pv0, op0=op0
    )
    t = experiment.t
    plant = sampled([process], dt)
    D, C = float(plant.D[0]), plant.C[0].tolist()
    states = list(zip(*(a[0].tolist() for a in (plant.Phi, plant.late, plant.early)), strict=True))
    x, high = [0.0] * len(C), True
    moves, true_pv, pv = [0.0] * (int(plant.q[0]) + 1), [], []
    for k, disturbance in enumerate(experiment.measurement_noise(t).tolist()):
        y = sum(map(mul, C, x)) + D * moves[k]
        m = y + disturbance
        if not -DIVERGED < m < DIVERGED:
            raise LoopDiverged(k * dt)
        if resolution:
            m = round((m + pv0) / resolution) * resolution - pv0
        error = -relay.action.sign * m
        if abs(error) > relay.hysteresis:
            high = error > 0
        moves.append(relay.bias + (relay.amplitude if high else -relay.amplitude))
        x = [
            sum(map(mul, row, x)) + late * moves[k] + early * moves[k + 1]
            for row, late, early in states
        ]
        true_pv.append(y)
        pv.append(m)
    return Response(
        t=t,
        sp=np.full(t.size, pv0),
        pv=np.array(pv) + pv0,
        op=np.array(moves[-t.size :]) + op0,
        true_pv=np.array(true_pv) + pv0,
        position=np.array(moves[-t.size :]) + op0,
    )
