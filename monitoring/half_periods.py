"""Half periods between zero crossings of the error: load events and likeness of neighbours."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real
from monitoring.basis import Basis, graded, refusal

FEWEST_HALF_PERIODS = 6
EVENT_LIMIT = 10
AMPLITUDE = 0.01
ALPHA = 0.6
GAMMA = 0.75


@dataclass(frozen=True, slots=True, kw_only=True)
class HalfPeriods:
    """Indices of the areas and lengths between zero crossings of the error.

    Attributes
    ----------
    events : int or None
        Half periods whose IAE exceeds the limit in the busiest supervision time [1]_.
    alarm : bool or None
        At least ten such events within that time.
    limit : float or None
        IAE of half a sine of 1 % of the PV span with the period Ti, 2 a/w. [PV s]
    likeness : float
        Part of neighbouring half periods that are alike in area and in length [2]_. [-]
    basis : Basis
        What this rests on.

    References
    ----------
    .. [1] T. Hägglund, "A control-loop performance monitor", Control Engineering Practice 3
       (1995); the limits as in a public program.
    .. [2] K. Forsman and A. Stattin, "A new criterion for detecting oscillations in control
       loops", European Control Conference (1999); from memory.
    """

    events: int | None
    alarm: bool | None
    limit: float | None
    likeness: float
    basis: Basis


def half_periods(
    error: Real, dt: float, *, pv_span: float | None, Ti: float | None, share: float = 1.0
) -> HalfPeriods:
    r"""Count load events and alike half periods.

    .. math:: IAE_{lim} = \frac{2 a}{\omega_i},\quad \omega_i = \frac{2\pi}{T_i},\quad
              T_{sup} = 50\, T_i

    .. math:: h = \frac{h_A + h_B}{N}, \quad
              \alpha < A_{i+1}/A_i < 1/\alpha,\ \gamma < \epsilon_{i+1}/\epsilon_i < 1/\gamma

    where A and epsilon are area and length of the half periods on one side of zero.

    Parameters
    ----------
    error : ndarray, shape (n,)
        Control error without gaps. [PV]
    dt : float
        Sample time. [s]
    pv_span : float, optional
        Range of PV, for the size of an event; events are not counted without it. [PV]
    Ti : float, optional
        Integral time of the controller; events are not counted without it. [s]
    share : float
        Part of the record that the error covers. [-]
    """
    settings = (("a, part of the PV span", AMPLITUDE), ("alpha", ALPHA), ("gamma", GAMMA))
    turns, areas = areas_between_crossings(error - float(np.mean(error)), dt)
    if areas.size < FEWEST_HALF_PERIODS:
        why = f"{areas.size} half periods are fewer than {FEWEST_HALF_PERIODS}"
        return HalfPeriods(
            events=None, alarm=None, limit=None, likeness=0.0,
            basis=refusal(why, share=share, settings=settings),
        )  # fmt: skip
    lengths = np.diff(turns) * dt
    limit = events = None
    doubts: tuple[str, ...] = ()
    if pv_span is None or Ti is None or not np.isfinite(Ti):
        doubts = ("events are not counted without the PV range and Ti",)
    else:
        limit = 2 * AMPLITUDE * pv_span * Ti / (2 * np.pi)
        at = turns[1:][areas > limit] * dt
        within = np.searchsorted(at, at + 50 * Ti, side="right") - np.arange(at.size)
        events = int(np.max(within, initial=0))
    return HalfPeriods(
        events=events,
        alarm=None if events is None else events >= EVENT_LIMIT,
        limit=limit,
        likeness=_likeness(areas, lengths),
        basis=graded(share, doubts, settings=settings),
    )


def areas_between_crossings(error: Real, dt: float) -> tuple[Real, Real]:
    """Crossings of zero [samples] and the IAE of every half period between two [PV s]."""
    turns = np.flatnonzero((error[1:] > 0) != (error[:-1] > 0)) + 1
    sums = np.cumsum(np.r_[0.0, np.abs(error)]) * dt
    return turns.astype(np.float64), np.diff(sums[turns])


def _likeness(areas: Real, lengths: Real) -> float:
    """Compare half periods on the same side of zero, two apart."""
    first, second = areas[:-2], areas[2:]
    alike = (second > ALPHA * first) & (first > ALPHA * second)
    before, after = lengths[:-2], lengths[2:]
    alike &= (after > GAMMA * before) & (before > GAMMA * after)
    return float(np.count_nonzero(alike) / alike.size)
