"""The 17 loops of the Tennessee Eastman plant as records, from the package `tep-studio`.

The plant is the modified Tennessee Eastman process under Ricker's decentralised control. Its
package is an optional dependency: `plants` in pyproject.toml.
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.util import find_spec
from typing import Protocol

import numpy as np

from loop.record import Mode, Record
from loop.signals import Real

START = datetime(2026, 1, 31, tzinfo=UTC)
# The controllers run every 0.0005 h; the historian keeps every fourth scan.
SCAN_HOURS = 0.0005
KEPT = 4
SAMPLE_TIME = SCAN_HOURS * KEPT * 3600
REACTOR_TEMPERATURE = "Reactor temperature"
SEPARATOR_TEMPERATURE = "Separator temperature"
G_IN_PRODUCT = "%G in product"  # its feedback is switched off in the package
# Sticking valves by disturbance number: the loop that acts on the valve.
STICKING = {
    14: (REACTOR_TEMPERATURE,),
    15: (SEPARATOR_TEMPERATURE,),
    # The recycle and steam valves of the group stand still in this control scheme.
    19: ("Sep flow", "Strip flow"),
}


# Places of the valves that loops act on, among the 12 of the plant.
STEMS = {
    "A feed": 2, "C feed": 3, "D feed": 0, "E feed": 1, "Purge": 5, "Sep flow": 6, "Strip flow": 7,
    REACTOR_TEMPERATURE: 9, SEPARATOR_TEMPERATURE: 10,
}  # fmt: skip
VALVE = (0.0, 100.0)
# The other loops set set points: from nothing to twice the usual ratio, or as the package limits.
OUTER_RANGES = {
    "Production rate": (70.0, 130.0),
    "Reactor level": (0.0, 120.0),
    "Reactor pressure": (0.0, 0.0067),
    "Separator level": (0.0, 0.5),
    "Stripper level": (0.0, 0.46),
    "yA control": (0.0, 0.005),
    "yAC control": (0.0, 0.19),
}


class Targets(Protocol):
    """Set points of the package's controllers."""

    production_rate: float
    reactor_level: float
    reactor_pressure: float
    reactor_temperature: float
    separator_level: float
    stripper_level: float
    pct_g: float
    ya: float
    yac: float


class Diagnostics(Protocol):
    """What the controllers of the package tell of one scan."""

    fp: float
    ratios: dict[str, float]
    setpoints: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EastmanRun:
    """One run of the plant.

    Attributes
    ----------
    records : tuple of Record
        The 17 loops, called as the package calls them.
    op_ranges : dict of str to tuple of float
        Lowest and highest OP of every loop.
    stems : dict of str to ndarray
        True positions of the valves that loops act on, at the same instants. [%]
    """

    records: tuple[Record, ...]
    op_ranges: dict[str, tuple[float, float]]
    stems: dict[str, Real]


def available() -> bool:
    """Whether the package is installed."""
    return find_spec("tep_studio") is not None


def eastman_run(
    fault: int | None, *, hours: float, settling: float = 1.0, seed: int = 1
) -> EastmanRun:
    """Run the plant in closed loop.

    Parameters
    ----------
    fault : int or None
        Number of the disturbance (IDV) that is on from the start; None for normal operation.
    hours : float
        Length of the records. [h]
    settling : float
        Time before them that is left out. [h]
    seed : int
        Seed of the measurement noise.

    Raises
    ------
    RuntimeError
        The plant shut itself down.
    """
    from tep_studio import RickerMultiLoopController, TennesseeEastmanProcess

    plant, control = TennesseeEastmanProcess(fixed_step=SCAN_HOURS), RickerMultiLoopController()
    measured, _ = plant.reset(seed=seed)
    control.reset(measured, time=0.0)
    disturbances = np.zeros(28)
    if fault is not None:
        disturbances[fault - 1] = 1.0
    rows, stems = [], []
    first = round(settling / SCAN_HOURS)
    for scan in range(first + round(hours / SCAN_HOURS)):
        outputs, told = control.compute_action(measured, time=plant.time)
        if scan >= first and (scan - first) % KEPT == 0:
            rows.append(_loops(measured, outputs, told, control.setpoints))
            stems.append(plant.state[38:50].copy())
        step = plant.advance(outputs, control_interval=SCAN_HOURS, disturbances=disturbances)
        measured = step.measurements
        if step.shutdown_status["terminated"]:
            raise RuntimeError(f"the plant shut down after {plant.time:.1f} h")
    return _run(np.array([list(row.values()) for row in rows]), [*rows[0]], np.array(stems))


def _loops(
    measured: Real, outputs: Real, told: Diagnostics, targets: Targets
) -> dict[str, tuple[float, float, float]]:
    """PV, SP and OP of every loop in one scan; the numbers are places in the package's lists."""
    r, fp = told.ratios, told.fp
    pv = measured
    a, c = float(pv[22]), float(pv[24])
    return {
        "A feed": (pv[0], r["r1"] * fp, outputs[2]),
        "C feed": (pv[3], r["r4"] * fp, outputs[3]),
        "D feed": (pv[1], r["r2"] * fp, outputs[0]),
        "E feed": (pv[2], r["r3"] * fp, outputs[1]),
        "Purge": (pv[9], r["r5"] * fp, outputs[5]),
        "Sep flow": (pv[13], r["r6"] * fp, outputs[6]),
        "Strip flow": (pv[16], r["r7"] * fp, outputs[7]),
        "Production rate": (pv[16], targets.production_rate, fp),
        "Reactor level": (pv[7], targets.reactor_level, told.setpoints["separator_temperature"]),
        "Reactor pressure": (pv[6], targets.reactor_pressure, r["r5"]),
        REACTOR_TEMPERATURE: (pv[8], targets.reactor_temperature, outputs[9]),
        "Separator level": (pv[11], targets.separator_level, r["r6"]),
        SEPARATOR_TEMPERATURE: (pv[10], told.setpoints["separator_temperature"], outputs[10]),
        "Stripper level": (pv[14], targets.stripper_level, r["r7"]),
        G_IN_PRODUCT: (pv[39], targets.pct_g, 0.0),
        "yA control": (100 * a / (a + c), targets.ya, r["r1"]),
        "yAC control": (a + c, targets.yac, r["r4"]),
    }


def _run(values: Real, tags: list[str], stems: Real) -> EastmanRun:
    """Make records of values, shape (n, 17, 3)."""
    t = np.arange(len(values)) * SAMPLE_TIME
    return EastmanRun(
        records=tuple(
            Record(
                t=t, pv=pv, sp=sp, op=op, start=START, tag=tag,
                mode=np.full(t.size, Mode.MAN if tag == G_IN_PRODUCT else Mode.AUTO, np.int8),
            )
            for tag, (pv, sp, op) in zip(tags, values.transpose(1, 2, 0), strict=True)
        ),
        op_ranges={
            tag: VALVE if tag in STEMS else OUTER_RANGES.get(tag, (0.0, 1.0)) for tag in tags
        },
        stems={tag: stems[:, place] for tag, place in STEMS.items()},
    )  # fmt: skip
