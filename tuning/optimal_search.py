"""The search for the times of a controller: the largest gain at each, the least area of all."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Self, TypeAlias, get_args

import numpy as np

from loop.controller import PID, Action
from loop.errors import RuleNotApplicable
from loop.margins import Margins, margins
from loop.process import LARGEST, Process, gain_sign, static_gain
from loop.signals import Real
from tuning.error_area import Entry, Shapes, error_areas
from tuning.gain_limit import largest_gains
from tuning.gain_polish import Judge, polished_gain
from tuning.loop_limits import LoopLimits
from tuning.plant_set import PlantSet, fastest

Structure: TypeAlias = Literal["PI", "PID"]
Objective: TypeAlias = Literal["load", "IE", "set point", "trade-off"]
References: TypeAlias = tuple[float, float] | None
# Objective by shapes and gains, on so many points of the series.
Areas: TypeAlias = Callable[[Shapes, Real, int], Real]

# Integral times in units of 1/fastest, and derivative over integral times, that are looked at.
TI, TD = (0.15, 120.0), (0.02, 0.9)
FIRST = {"PI": (28, 1), "PID": (13, 7)}
THEN = {"PI": (9, 1), "PID": (5, 5)}
ZOOMS, SHRINK = {"PI": 4, "PID": 6}, {"PI": 2 / 9, "PID": 0.5}
# Parts of the largest gain: where the limits are wide, less gain can have less area.
PARTS = (1.0, 0.93, 0.82, 0.65)
LOOK, LAST_LOOK, MEASURE = 384, 2048, 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimalSettings:
    """Settings of least error area under limits.

    Attributes
    ----------
    pid : PID
        Settings.
    objective : str
        "load" (IAE after a load step), "IE", "set point" (IAE after a step at the process output,
        or of the set point with b = 1 and c = 1) or "trade-off".
    value : float
        The objective: IAE or IE at the unit step, or J. [PV s/OP], [s] or [-]
    load_IAE, load_IE : float
        After a step of 1 OP at the process input. [PV s/OP]
    output_IAE : float
        After a unit step at the process output. [s]
    margins : Margins
        At the model.
    limits : LoopLimits
        What the settings keep.
    """

    pid: PID
    objective: Objective
    value: float
    load_IAE: float
    load_IE: float
    output_IAE: float
    margins: Margins
    limits: LoopLimits


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """One search for the times of a controller.

    Attributes
    ----------
    process : Process
        The model, on which areas are measured.
    limits : LoopLimits
        What to keep.
    structure : str
        PI or PID.
    N : float
        Derivative filter ratio. [-]
    sample_time : float
        Scan time. [s]
    speed : float
        Frequency that scales the search. [rad/s]
    """

    process: Process
    limits: LoopLimits
    structure: Structure
    N: float
    sample_time: float
    speed: float

    @classmethod
    def of(
        cls,
        process: Process,
        limits: LoopLimits,
        structure: Structure,
        N: float,
        sample_time: float,
    ) -> Self:
        """Check what was asked for and scale the search.

        Raises
        ------
        RuleNotApplicable
            Nothing in the model bounds the gain.
        ValueError
            The structure, N or the scan time is impossible.
        """
        if structure not in get_args(Structure):
            raise ValueError(f"structure must be PI or PID, got {structure}")
        if not 1 <= N <= LARGEST:
            raise ValueError(f"N must lie within 1 and {LARGEST:g}, got {N}")
        if not 0 <= sample_time <= LARGEST:
            raise ValueError(f"sample_time must lie within 0 and {LARGEST:g} s, got {sample_time}")
        speed = fastest(process, sample_time / 2)
        if speed is None:
            raise RuleNotApplicable(
                f"Optimal {structure}",
                "the model has neither dead time nor lag enough to bound the gain; "
                "give its dead time",
            )
        return cls(
            process=process,
            limits=limits,
            structure=structure,
            N=N,
            sample_time=sample_time,
            speed=speed,
        )

    @property
    def hold(self) -> float:
        """Half the scan time. [s]"""
        return self.sample_time / 2

    @property
    def title(self) -> str:
        """Name in a sentence."""
        return f"Optimal {self.structure}"

    def best(
        self, plants: PlantSet, objective: Objective, references: References = None
    ) -> tuple[PID, tuple[float, float]]:
        """Settings of least objective, and the references of both areas.

        Parameters
        ----------
        plants : PlantSet
            Plants that must keep the limits.
        objective : str
            What to minimise.
        references : tuple of float, optional
            IAE_out* and IAE_in* of the trade-off; found first if not given.

        Raises
        ------
        RuleNotApplicable
            No settings keep the limits.
        ValueError
            There is no such objective.
        """
        out, into = self._areas("output"), self._areas("input")
        match objective:
            case "load":
                return self._zoom(plants, into), (1.0, 1.0)
            case "set point":
                return self._zoom(plants, out), (1.0, 1.0)
            case "IE":
                return self._zoom(plants, lambda shapes, Kc, _: shapes.Ti / Kc), (1.0, 1.0)
            case "trade-off":
                least_out, least_in = references or self._least(plants)

                def mean(shapes: Shapes, Kc: Real, points: int) -> Real:
                    first, second = out(shapes, Kc, points), into(shapes, Kc, points)
                    return 0.5 * (first / least_out + second / least_in)

                return self._zoom(plants, mean), (least_out, least_in)
        raise ValueError(f"objective must be one of {', '.join(get_args(Objective))}")

    def _least(self, plants: PlantSet) -> tuple[float, float]:
        """Least areas after steps at the output and at the input, each by settings of its own."""
        entries: tuple[Entry, Entry] = ("output", "input")
        found = [self.area(self._zoom(plants, self._areas(e)), e) for e in entries]
        if math.isinf(static_gain(self.process)) and self.process.denominator[-2]:
            alone = Shapes(Ti=np.full(1, np.inf), Td=np.zeros(1), N=self.N)
            Kc = largest_gains(plants, alone, self.limits)
            if Kc[0] > 0:
                found[0] = min(found[0], float(self._areas("output")(alone, Kc, MEASURE)[0]))
        return found[0], found[1]

    def area(self, pid: PID, entry: Entry) -> float:
        """IAE of one loop, finely. [PV s/OP] or [s]"""
        shapes = Shapes(Ti=np.array([pid.Ti]), Td=np.array([pid.Td]), N=pid.N)
        return float(self._areas(entry)(shapes, np.array([pid.Kc]), MEASURE)[0])

    def settle(
        self, best: tuple[PID, tuple[float, float]], judge: Judge, objective: Objective
    ) -> OptimalSettings:
        """Bring the gain exactly to the limits and measure.

        Raises
        ------
        RuleNotApplicable
            No gain near the one found keeps the limits.
        """
        pid, (out_least, in_least) = best
        gain = polished_gain(pid, judge)
        if gain is None:
            raise RuleNotApplicable(self.title, "no settings were found that keep the limits")
        pid = with_gain(pid, gain)
        load, out = self.area(pid, "input"), self.area(pid, "output")
        values = {
            "load": load,
            "IE": pid.Ti / pid.Kc,
            "set point": out,
            "trade-off": 0.5 * (out / out_least + load / in_least),
        }
        return OptimalSettings(
            pid=pid,
            objective=objective,
            value=values[objective],
            load_IAE=load,
            load_IE=pid.Ti / pid.Kc,
            output_IAE=out,
            margins=margins(self.process, pid, sample_time=self.sample_time),
            limits=self.limits,
        )

    def _areas(self, entry: Entry) -> Areas:
        sign = Action.for_gain(gain_sign(self.process)).sign
        K = abs(static_gain(self.process))

        def areas(shapes: Shapes, Kc: Real, points: int) -> Real:
            slowest = np.where(np.isinf(shapes.Ti), 0.0, shapes.Ti) * (1 + 1 / (K * Kc))
            horizon = 6 * slowest + 30 / self.speed
            return error_areas(
                self.process,
                shapes,
                sign * Kc,
                horizon,
                entry=entry,
                hold=self.hold,
                points=points,
            )

        return areas

    def _zoom(self, plants: PlantSet, objective: Areas) -> PID:
        """Close in on the best times, on grids in ln Ti and ln Td/Ti."""
        low, high = np.log(TI), np.log(TD)
        n, k = FIRST[self.structure]
        Ti_grid: Real = np.linspace(low[0], low[1], n) - math.log(self.speed)
        Td_grid: Real = np.full(1, -np.inf)
        if self.structure == "PID":
            Td_grid = np.linspace(high[0], high[1], k)
        steps = [float(np.ptp(low)) / (n - 1), float(np.ptp(high)) / max(k - 1, 1)]
        parts: Real = np.ones(1)
        least, x = np.inf, (0.0, 0.0, 1.0, 1.0)
        for zoom in range(ZOOMS[self.structure] + 1):
            a, b = (grid.ravel() for grid in np.meshgrid(Ti_grid, Td_grid, indexing="ij"))
            shapes = Shapes(Ti=np.exp(a), Td=np.exp(a + b), N=self.N)
            most = largest_gains(plants, shapes, self.limits)
            good = np.flatnonzero(most > 0)
            if zoom == 0 and not good.size:
                raise RuleNotApplicable(
                    self.title,
                    f"no settings keep Ms at {self.limits.Ms:g} and the other limits",
                )
            row, part = np.repeat(good, parts.size), np.tile(parts, good.size)
            some = Shapes(Ti=shapes.Ti[row], Td=shapes.Td[row], N=self.N)
            last = zoom == ZOOMS[self.structure]
            if last:
                least = np.inf  # on a finer series, beside which the values so far are rough
            values = objective(some, most[row] * part, LAST_LOOK if last else LOOK)
            if values.size and values.min() < least:
                i = int(np.argmin(values))
                least = float(values[i])
                x = (float(a[row[i]]), float(b[row[i]]), float(part[i]), float(most[row[i]]))
            n, k = THEN[self.structure]
            steps = [step * SHRINK[self.structure] for step in steps] if zoom else steps
            Ti_grid = x[0] + steps[0] * np.linspace(-1, 1, n)
            if self.structure == "PID":
                Td_grid = np.minimum(x[1] + steps[1] * np.linspace(-1, 1, k), 0.0)
            parts = _parts(zoom, x[2])
        return PID(
            Kc=x[3] * x[2],
            Ti=math.exp(x[0]),
            Td=math.exp(x[0] + x[1]) if self.structure == "PID" else 0.0,
            N=self.N,
            action=Action.for_gain(gain_sign(self.process)),
        )


def _parts(zoom: int, best: float) -> Real:
    """Parts of the largest gain to look at next: the limit alone where it was the best."""
    if zoom == 0:
        return np.array(PARTS)
    if best == 1.0:
        return np.ones(1)
    return np.unique(np.minimum(best + 0.1 * 0.5**zoom * np.array([-1.0, 0.0, 1.0]), 1.0))


def with_gain(pid: PID, Kc: float) -> PID:
    """The same times with another gain."""
    return PID(Kc=Kc, Ti=pid.Ti, Td=pid.Td, N=pid.N, action=pid.action)
