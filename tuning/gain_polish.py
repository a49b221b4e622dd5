"""The gain at which settings just keep their limits, by the exact margins of every plant."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID
from loop.errors import UnstableLoop
from loop.margin_batch import batch_margins
from loop.margins import Margins, margins
from loop.process import Process, TransferFunction
from loop.response import control_sensitivity, frequency_grid
from loop.signals import Flags, Real
from loop.swing import swing_margins, swings_of
from tuning.loop_limits import LoopLimits

# Gains looked at around a first guess, and how often the last stretch is divided.
SPAN = np.linspace(1.03, 0.9, 40)
DEEP = np.geomspace(0.9, 0.3, 40)
AGAIN, INSIDE = 2, 24


@dataclass(frozen=True, slots=True, kw_only=True)
class Judge:
    """Plants and the limits that must hold on them.

    Attributes
    ----------
    plants : tuple of Process
        Plants.
    limits : LoopLimits
        What to keep.
    sample_time : float
        Scan time. [s]
    allowed : float
        Part of the plants that may miss the limits. [-]
    model : Process, optional
        Where the effort is limited; the first plant if not given.
    """

    plants: tuple[Process, ...]
    limits: LoopLimits
    sample_time: float
    allowed: float = 0.0
    model: Process | None = None

    def with_plant(self, plant: Process) -> "Judge":
        """One more plant."""
        return replace(self, plants=(*self.plants, plant))

    def keeps(self, pid: PID, gains: Real) -> Flags:
        """Whether the limits hold with each gain, shape (n,)."""
        missed = np.mean(~self.holds(pid, gains), axis=1)
        return np.asarray((missed <= self.allowed + 1e-12) & self._keeps_effort(pid, gains))

    def severity(self, pid: PID) -> Real:
        """How far each plant misses its limits, as a ratio above 1 where it does, shape (p,)."""
        found = batch_margins(stacked(self.plants), PIDBatch.of(pid), sample_time=self.sample_time)
        limits = self.limits
        with np.errstate(divide="ignore", invalid="ignore"):
            over = np.stack(
                [
                    found.Ms / limits.Ms,
                    found.Mt / limits.Mt,
                    limits.gain / found.gain,
                    limits.phase / found.phase,
                    limits.delay_over_theta
                    * np.array([plant.theta for plant in self.plants])
                    / found.delay,
                ]
            )
        return np.asarray(np.where(found.stable, np.nan_to_num(over).max(axis=0), np.inf))

    def holds(self, pid: PID, gains: Real) -> Flags:
        """Whether margins hold for each gain and plant, shape (n, p)."""
        theta = np.array([plant.theta for plant in self.plants])
        swings = swings_of(self.plants)
        if swings is None and any(isinstance(plant, TransferFunction) for plant in self.plants):
            rows = [[self._one(plant, pid, float(Kc)) for plant in self.plants] for Kc in gains]
            return np.array(rows)
        controllers = PIDBatch(
            Kc=gains[:, None],
            Ti=np.asarray(pid.Ti),
            Td=np.asarray(pid.Td),
            N=np.asarray(pid.N),
            sign=np.asarray(pid.action.sign),
        )
        found = (
            batch_margins(stacked(self.plants), controllers, sample_time=self.sample_time)
            if swings is None
            else swing_margins(swings, controllers, sample_time=self.sample_time)
        )
        limits = self.limits
        return np.asarray(
            found.stable
            & (found.Ms <= limits.Ms)
            & (found.Mt <= limits.Mt)
            & (found.gain >= limits.gain)
            & (found.phase >= limits.phase)
            & (found.delay >= limits.delay_over_theta * theta)
        )

    def _one(self, plant: Process, pid: PID, Kc: float) -> bool:
        try:
            found = margins(plant, replace(pid, Kc=Kc), sample_time=self.sample_time)
        except UnstableLoop:
            return False
        return keeps_limits(found, self.limits, plant.theta)

    def _keeps_effort(self, pid: PID, gains: Real) -> Flags:
        limit = self.limits.effort
        if limit == np.inf:
            return np.ones(gains.size, dtype=bool)
        model = self.model or self.plants[0]
        w = frequency_grid(model, replace(pid, Kc=float(gains[0])), 300)
        peaks = [
            np.abs(control_sensitivity(model, replace(pid, Kc=float(Kc)), w)).max() for Kc in gains
        ]
        return np.asarray(np.array(peaks) <= limit)


def keeps_limits(found: Margins, limits: LoopLimits, theta: float) -> bool:
    """Whether the margins of one loop keep the limits; the effort is not looked at."""
    return (
        found.Ms <= limits.Ms
        and found.Mt <= limits.Mt
        and found.gain >= limits.gain
        and found.phase >= limits.phase
        and found.delay >= limits.delay_over_theta * theta
    )


def stacked(plants: Sequence[Process]) -> ProcessBatch:
    """Plants of lags and integrators as one batch, shape (p,)."""
    rows = [ProcessBatch.of(p) for p in plants if not isinstance(p, TransferFunction)]
    names = ("K", "tau1", "tau2", "integrators", "theta")
    return ProcessBatch(*(np.array([getattr(row, name) for row in rows]) for name in names))


def polished_gain(pid: PID, judge: Judge) -> float | None:
    """The largest gain near that of `pid` that keeps every limit; None where there is none.

    Parameters
    ----------
    pid : PID
        Settings whose gain is right to some percent.
    judge : Judge
        Plants and limits.
    """
    general = any(isinstance(plant, TransferFunction) for plant in judge.plants)
    for span in (SPAN, DEEP):
        gains = pid.Kc * (span[:: 4 if general else 1])
        good = judge.keeps(pid, gains)
        if good.any():
            break
    else:
        return None
    first = int(np.argmax(good))
    best, above = float(gains[first]), float(gains[max(first - 1, 0)])
    for _ in range(AGAIN if first else 0):
        gains = np.linspace(above, best, (6 if general else INSIDE) + 1)
        first = int(np.argmax(np.append(judge.keeps(pid, gains[1:-1]), True))) + 1
        best, above = float(gains[first]), float(gains[first - 1])
    return best
