"""One box of plants around one loop, and the plants of it that were tried."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import product
from types import MappingProxyType
from typing import Self, TypeAlias

import numpy as np

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID
from loop.errors import UnstableLoop
from loop.margin_batch import batch_margins
from loop.margins import Margins, margins
from loop.process import LARGEST, Process, TransferFunction
from loop.signals import Real
from loop.swing import swing_margins, swings_of
from tuning.box_bounds import MARGINS, TURN, least_angle
from tuning.box_search import Search
from tuning.profiles import Profile
from tuning.uncertain_loop import Errors, UncertainLoop, error_sizes

NAMES = tuple(item.name for item in fields(Margins))
UNSTABLE = Margins(gain=0.0, gain_reduction=0.0, phase=0.0, delay=0.0, Ms=math.inf, Mt=math.inf)
Tried: TypeAlias = list[tuple[Process, Margins]]


def plant_words(plant: Process) -> str:
    """Parameters of a plant in one line."""
    if isinstance(plant, TransferFunction):
        n, d = (" ".join(f"{a:.6g}" for a in p) for p in (plant.numerator, plant.denominator))
        return f"numerator {n}, denominator {d}, theta = {plant.theta:.6g}"
    names = ("K", "tau", "tau1", "tau2", "theta")
    return ", ".join(f"{n} = {getattr(plant, n):.6g}" for n in names if hasattr(plant, n))


def badness_of(found: Margins) -> Real:
    """Turn margins into badness, in the order of `MARGINS`, shape (5,)."""
    with np.errstate(divide="ignore"):
        inverse = 1 / np.array([found.gain, math.radians(found.phase), found.delay])
    return np.concatenate([[found.Ms, found.Mt], inverse])


def margins_of(badness: Real) -> dict[str, float]:
    """Turn badness, shape (5,), into values by name."""
    with np.errstate(divide="ignore"):
        gain, phase, delay = (float(x) for x in 1 / badness[2:])
    return {
        "gain": gain,
        "phase": math.degrees(phase),
        "delay": delay,
        "Ms": float(badness[0]),
        "Mt": float(badness[1]),
    }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoxCase:
    """One box around one loop.

    Attributes
    ----------
    process, controller : Process, PID
        The model, middle of the box, and the settings.
    sizes : mapping of str to float
        Relative error of each parameter. [-]
    sample_time : float
        Scan time. [s]
    loop : UncertainLoop
        The loop with its intervals.
    """

    process: Process
    controller: PID
    sizes: Mapping[str, float]
    sample_time: float
    loop: UncertainLoop

    @classmethod
    def of(cls, process: Process, controller: PID, errors: Errors, sample_time: float) -> Self:
        """Put a box around a loop.

        Raises
        ------
        ValueError
            An error, a name or the scan time is impossible.
        """
        if not 0 <= sample_time <= LARGEST:
            raise ValueError(f"sample_time must lie within 0 and {LARGEST:g} s, got {sample_time}")
        sizes = error_sizes(process, errors)
        loop = UncertainLoop.of(process, controller, sizes, sample_time / 2)
        return cls(
            process=process,
            controller=controller,
            sizes=MappingProxyType(sizes),
            sample_time=sample_time,
            loop=loop,
        )

    def limits(self, profile: Profile) -> Real:
        """Badness that a profile allows, shape (5,)."""
        longest = self.loop.theta_high - self.loop.hold
        ratio = profile.delay_over_theta or 0.0
        delay = 1 / (ratio * longest) if ratio * longest > 0 else math.inf
        Mt = math.inf if profile.Mt is None else profile.Mt
        return np.array([profile.Ms, Mt, 1 / profile.gain, 1 / math.radians(profile.phase), delay])

    def seeds(self) -> Tried:
        """Margins at the model, and where it is stable at the corners."""
        model = self.judged(self.process)
        if model[1] is UNSTABLE:
            return [model]
        loop = self.loop
        sides = [(loop.gain_low, loop.gain_high), *zip(loop.low[1:], loop.high[1:], strict=True)]
        dead = (loop.theta_low, loop.theta_high)
        corners = product(*(sorted({float(end) for end in side}) for side in (*sides, dead)))
        plants = [
            loop.plant(self.process, gain, np.array([0.0, *f]), theta)
            for gain, *f, theta in corners
        ]
        return [model, *self.all_judged(plants)]

    def judged(self, plant: Process) -> tuple[Process, Margins]:
        """A plant with its margins, `UNSTABLE` where it has none."""
        try:
            return plant, margins(plant, self.controller, sample_time=self.sample_time)
        except UnstableLoop:
            return plant, UNSTABLE

    def all_judged(self, plants: list[Process]) -> Tried:
        """Judge many plants, in one batch where the process is lags and integrators or a swing."""
        if not plants:
            return []
        swings, controller = swings_of(plants), PIDBatch.of(self.controller)
        if swings is not None:
            found = swing_margins(swings, controller, sample_time=self.sample_time)
        elif isinstance(self.process, TransferFunction):
            return [self.judged(plant) for plant in plants]
        else:
            rows = [
                ProcessBatch.of(plant)
                for plant in plants
                if not isinstance(plant, TransferFunction)
            ]
            columns = (np.array([getattr(r, f.name) for r in rows]) for f in fields(ProcessBatch))
            found = batch_margins(ProcessBatch(*columns), controller, sample_time=self.sample_time)
        table = [getattr(found, f.name).tolist() for f in fields(Margins)]
        return [
            (plant, Margins(**dict(zip(NAMES, row, strict=True))) if stable else UNSTABLE)
            for plant, stable, *row in zip(plants, found.stable.tolist(), *table, strict=True)
        ]

    def broken(self, tried: Tried, limits: Real) -> tuple[Process, Margins] | None:
        """The plant that breaks a limit by most; an unstable one outranks all."""
        worst, over = None, 1.0
        for plant, found in tried:
            beyond = math.inf if found is UNSTABLE else float((badness_of(found) / limits).max())
            if beyond > over:
                worst, over = (plant, found), beyond
        return worst

    def met(self, search: Search) -> tuple[Tried, Process | None]:
        """The plants behind the worst points of a search, judged anew; and an unstable one."""
        plants = []
        for name, point in zip(MARGINS, search.points, strict=True):
            if not np.any(np.isnan(point)):
                plants.append(self._plant_at(name, point))
        judged = self.all_judged(plants)
        # Where L passes -1 to within rounding the plant is on the limit, whatever the count says.
        limit = self._plant_at("Ms", search.points[0]) if math.isinf(search.found[0]) else None
        unstable = next((plant for plant, found in judged if found is UNSTABLE), limit)
        return [pair for pair in judged if pair[1] is not UNSTABLE], unstable

    def _plant_at(self, name: str, point: Real) -> Process:
        """The plant that is worst at one frequency and one set of time constants."""
        loop = self.loop
        there = loop.enclose(point[None], point[None])
        low, high = float(there.phase_low[0]), float(there.phase_high[0])
        w, size = float(there.w_high[0]), math.exp(0.5 * (there.log_low[0] + there.log_high[0]))
        delta = float(least_angle(there.phase_low, there.phase_high)[0])
        if delta == 0:
            theta = loop.theta_low + math.fmod(math.fmod(high + math.pi, TURN) + TURN, TURN) / w
        else:
            below = math.fmod(math.fmod(low + math.pi, TURN) + TURN, TURN)
            theta = loop.theta_high if below <= delta * (1 + 1e-9) else loop.theta_low
        unit = 1 / size
        least, most = loop.gain_low, loop.gain_high
        gain = {
            "Ms": min(max(math.cos(delta), least * size), most * size) * unit,
            "Mt": unit / min(max(math.cos(delta), unit / most), unit / least),
            "gain": most,
        }.get(name, unit)
        if name == "delay":
            theta = loop.theta_high
        gain = min(max(gain, least), most)
        theta = min(max(theta, loop.theta_low), loop.theta_high)
        return loop.plant(self.process, gain, point, theta)
