"""A knob from calm to fast: the front of robustness against load area, and a choice on it.

Every point is optimal: no settings of the same structure have less load area at the same Ms.
"""

from dataclasses import dataclass

import numpy as np

from loop.controller import DEFAULT_N
from loop.errors import RuleNotApplicable
from loop.process import Process
from tuning.loop_limits import LoopLimits
from tuning.optimal import optimal
from tuning.optimal_search import OptimalSettings, Structure

# Ms of the three named positions: 1.2 hardly reacts, 2.0 is what the general profile allows; the
# knob is linear between them.
CALM, NORMAL, FAST = 1.2, 1.6, 2.0
NAMED = {"calm": 0.0, "normal": 0.5, "fast": 1.0}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Front:
    """Optimal settings from calm to fast.

    Attributes
    ----------
    structure : str
        PI or PID.
    knob : tuple of float
        Position of each point, 0 calm to 1 fast. [-]
    points : tuple of OptimalSettings
        Settings, the calm ones first: Ms rises and the load area falls.
    """

    structure: Structure
    knob: tuple[float, ...]
    points: tuple[OptimalSettings, ...]


def peak_at(knob: float) -> float:
    """Ms at a position of the knob: 1.2 at 0 (calm), 1.6 at 0.5 (normal), 2.0 at 1 (fast). [-]

    Parameters
    ----------
    knob : float
        Position. [-]

    Raises
    ------
    ValueError
        The position lies outside 0 to 1.
    """
    if not 0 <= knob <= 1:
        raise ValueError(f"the knob must lie within 0 (calm) and 1 (fast), got {knob}")
    return float(np.interp(knob, (0.0, 0.5, 1.0), (CALM, NORMAL, FAST)))


def detuned(
    process: Process,
    knob: float | str,
    *,
    structure: Structure = "PI",
    N: float = DEFAULT_N,
    sample_time: float = 0.0,
) -> OptimalSettings:
    """Choose settings by one knob.

    Parameters
    ----------
    process : Process
        Process model.
    knob : float or str
        0 to 1, or "calm", "normal", "fast". [-]
    structure : "PI" or "PID"
        Terms in use.
    N : float
        Derivative filter ratio. [-]
    sample_time : float
        Scan time. [s]

    Raises
    ------
    RuleNotApplicable
        As `optimal`.
    ValueError
        There is no such position.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> heater = FOPDT(K=2.0, tau=120.0, theta=30.0)
    >>> [round(detuned(heater, knob).margins.Ms, 2) for knob in ("calm", "normal", "fast")]
    [1.2, 1.6, 2.0]
    """
    if isinstance(knob, str):
        if knob not in NAMED:
            raise ValueError(f"the knob must be one of {', '.join(NAMED)}, got {knob}")
        knob = NAMED[knob]
    limits = LoopLimits(Ms=peak_at(knob))
    return optimal(process, limits, structure=structure, N=N, sample_time=sample_time)


def front(
    process: Process,
    *,
    structure: Structure = "PI",
    points: int = 9,
    N: float = DEFAULT_N,
    sample_time: float = 0.0,
) -> Front:
    """Lay out the front of Ms against load IAE.

    Parameters
    ----------
    process : Process
        Process model.
    structure : "PI" or "PID"
        Terms in use.
    points : int
        Number of points, evenly on the knob. A position where no settings keep Ms is left out.
    N : float
        Derivative filter ratio. [-]
    sample_time : float
        Scan time. [s]

    Raises
    ------
    RuleNotApplicable
        Nothing in the model bounds the gain, or no position has settings.
    ValueError
        There are fewer than 2 points.
    """
    if points < 2:
        raise ValueError(f"a front needs at least 2 points, got {points}")
    found: list[tuple[float, OptimalSettings]] = []
    refusal: RuleNotApplicable | None = None
    for knob in np.linspace(0.0, 1.0, points).tolist():
        try:
            settings = detuned(process, knob, structure=structure, N=N, sample_time=sample_time)
        except RuleNotApplicable as reason:
            refusal = reason
        else:
            found.append((knob, settings))
    if refusal is not None and not found:
        raise refusal
    return Front(
        structure=structure,
        knob=tuple(knob for knob, _ in found),
        points=tuple(settings for _, settings in found),
    )
