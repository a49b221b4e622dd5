"""Verification of settings: the margins at the model and under ±50 % of model error.

A profile's limits must hold at the model and at every plant of the one-at-a-time sweep (each
parameter times 0.5 to 1.5 in eleven steps). The joint corners, all parameters off by 50 % at once,
are reported and do not gate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from loop.batch import PIDBatch
from loop.controller import PID
from loop.margin_batch import MarginBatch, batch_margins
from loop.margins import Margins
from loop.process import Process
from loop.signals import Flags, Real
from tuning.profiles import Profile
from tuning.shortfall import (
    MARGIN_NAMES,
    Failure,
    failures,
    gain_margin_words,
    profile_holds,
)
from tuning.sweep import FACTORS, Sweep, sweep_of

Part: TypeAlias = "slice | int | tuple[slice, npt.NDArray[np.intp]]"


@dataclass(frozen=True, slots=True, kw_only=True)
class Worst:
    """Worst value of one margin over a set of plants, and the plant it is on.

    Attributes
    ----------
    value : float
        The margin: gain, Ms and Mt in [-], phase in [deg], delay in [s]. An unstable loop counts
        as 0, or as infinite for Ms and Mt.
    parameter : str or None
        Parameter that is off; None at the model and where several are off.
    factor : float
        Its factor, 1 at the model. [-]
    where : str
        The plant in words: "at the model", "with theta x 1.5".
    """

    value: float
    parameter: str | None
    factor: float
    where: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verification:
    """What a controller keeps at the model, under one-at-a-time errors and at the corners.

    Attributes
    ----------
    profile : Profile
        Limits it was held to.
    stable : bool
        Whether the loop is stable at the model.
    nominal : Margins
        Margins at the model; of an unstable loop 0, and infinite for Ms and Mt.
    parameters : tuple of str
        Parameters of the model that were moved, p of them.
    factors : ndarray, shape (11,)
        Factors of the one-at-a-time sweep. [-]
    sweep : MarginBatch, shape (p, 11)
        Margins of the one-at-a-time sweep.
    corner_factors : ndarray, shape (2^p, p)
        Factors at the joint corners. [-]
    corners : MarginBatch, shape (2^p,)
        Margins at the joint corners.
    nominal_passes, one_at_a_time_passes, corners_pass : bool
        Whether every limit holds at the model, on the sweep, at the corners.
    worst : mapping of str to Worst
        Worst gain, phase, delay, Ms and Mt over the model and the sweep.
    worst_corner : mapping of str to Worst
        The same over the joint corners.
    failure : Failure or None
        The target that gives way first, at the smallest model error; None where every limit holds.
    gravest : Failure or None
        The target that is broken by most; None where every limit holds.
    """

    profile: Profile
    stable: bool
    nominal: Margins
    parameters: tuple[str, ...]
    factors: Real
    sweep: MarginBatch
    corner_factors: Real
    corners: MarginBatch
    nominal_passes: bool
    one_at_a_time_passes: bool
    corners_pass: bool
    worst: Mapping[str, Worst]
    worst_corner: Mapping[str, Worst]
    failure: Failure | None
    gravest: Failure | None

    @property
    def passes(self) -> bool:
        """The verdict: the limits hold at the model and on the one-at-a-time sweep."""
        return self.nominal_passes and self.one_at_a_time_passes

    @property
    def missed(self) -> str:
        """What gives way first and what is broken by most, in words; empty where all holds."""
        if not (self.failure and self.gravest):
            return ""
        first, last = self.failure.sentence, self.gravest.sentence
        return first if first == last else f"{first}; at worst {last}"

    @property
    def verdict(self) -> str:
        """The verdict in one sentence with its numbers."""
        unmoved = "" if "theta" in self.parameters else " The dead time is 0 and was not moved."
        if self.failure:
            return f"Fails the {self.profile.name} profile: {self.missed}.{unmoved}"
        gain, phase, Ms = (self.worst[name] for name in ("gain", "phase", "Ms"))
        return (
            f"Passes the {self.profile.name} profile for ±50 % of each parameter; worst cases: "
            f"gain margin {gain_margin_words(gain.value)} {gain.where}, "
            f"phase margin {phase.value:.3g}° {phase.where}, Ms {Ms.value:.3g} {Ms.where}.{unmoved}"
        )


def verify(
    process: Process, controller: PID, profile: Profile, *, sample_time: float = 0.0
) -> Verification:
    """Hold a controller to a profile at the model and under ±50 % of model error.

    Parameters
    ----------
    process : Process
        Process model. [s]
    controller : PID
        Settings as they will run, N and tauF included.
    profile : Profile
        Limits on the margins.
    sample_time : float
        Scan time of the controller; half of it counts as dead time. [s]

    Raises
    ------
    RuleNotApplicable
        The process is a transfer function other than K/(s (tau2 s + 1)).
    ValueError
        A parameter is so close to the limit of models that ±50 % leaves it.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> from tuning.profiles import PROFILES
    >>> from tuning.simc import simc_pi
    >>> heater = FOPDT(K=2.0, tau=120.0, theta=30.0)
    >>> print(verify(heater, simc_pi(heater), PROFILES["general"]).failure.sentence)
    Ms is 2.121 with tau x 0.6, above 2
    >>> verify(heater, simc_pi(heater, tau_c=45.0), PROFILES["general"]).passes
    True
    """
    return verify_many(process, [controller], profile, sample_time=sample_time)[0]


def verify_many(
    process: Process,
    controllers: Sequence[PID],
    profile: Profile,
    *,
    sample_time: float = 0.0,
) -> tuple[Verification, ...]:
    """Hold many controllers for one process to a profile, in one batch.

    Parameters
    ----------
    process : Process
        Process model. [s]
    controllers : sequence of PID
        Settings as they will run.
    profile : Profile
        Limits on the margins.
    sample_time : float
        Scan time of the controllers; half of it counts as dead time. [s]

    Raises
    ------
    RuleNotApplicable
        The process is a transfer function other than K/(s (tau2 s + 1)).
    ValueError
        A parameter is so close to the limit of models that ±50 % leaves it.
    """
    if not controllers:
        return ()
    sweep = sweep_of(process)
    found = _margins_of(sweep, controller_column(controllers), sample_time)
    return judged(sweep, found, profile)


def judged(sweep: Sweep, found: MarginBatch, profile: Profile) -> tuple[Verification, ...]:
    """Turn the margins of m controllers on the plants of a sweep into verdicts.

    Parameters
    ----------
    sweep : Sweep
        n plants.
    found : MarginBatch, shape (m, n)
        Margins on them.
    profile : Profile
        Limits on the margins.
    """
    holds = profile_holds(sweep, found, profile)
    first_corner = len(sweep.where) - sweep.corners
    worst = _worst(sweep, found, slice(0, first_corner))
    worst_corner = _worst(sweep, found, slice(first_corner, len(sweep.where)))
    missed = failures(sweep, found, holds[:, :first_corner], profile)
    return tuple(
        _judge(sweep, _part(found, i, sweep.plants.shape), holds[i], profile, missed[i], *worsts)
        for i, worsts in enumerate(zip(worst, worst_corner, strict=True))
    )


def _margins_of(sweep: Sweep, controllers: PIDBatch, sample_time: float) -> MarginBatch:
    """Margins of m controllers on the n plants; the model is in the sweep of each parameter too."""
    at_model = np.all(sweep.factors == 1, axis=1)
    own = np.flatnonzero(~at_model)
    column = np.zeros(at_model.size, dtype=int)
    column[own] = np.arange(own.size) + 1
    plants = sweep.plants.take(np.concatenate([[0], own]))
    found = batch_margins(plants, controllers, sample_time=sample_time)
    return _part(found, (slice(None), column), (controllers.shape[0], column.size))


def _judge(
    sweep: Sweep,
    found: MarginBatch,
    holds: Flags,
    profile: Profile,
    missed: tuple[Failure | None, Failure | None],
    worst: Mapping[str, Worst],
    worst_corner: Mapping[str, Worst],
) -> Verification:
    p, steps = len(sweep.parameters), len(FACTORS)
    single = slice(0, 1 + p * steps)
    corner = slice(1 + p * steps, None)
    return Verification(
        profile=profile,
        stable=bool(found.stable[0]),
        nominal=Margins(
            gain=float(found.gain[0]),
            gain_reduction=float(found.gain_reduction[0]),
            phase=float(found.phase[0]),
            delay=float(found.delay[0]),
            Ms=float(found.Ms[0]),
            Mt=float(found.Mt[0]),
        ),
        parameters=sweep.parameters,
        factors=np.array(FACTORS),
        sweep=_part(found, slice(1, 1 + p * steps), (p, steps)),
        corner_factors=sweep.factors[corner],
        corners=_part(found, corner, (sweep.corners,)),
        nominal_passes=bool(holds[0]),
        one_at_a_time_passes=bool(np.all(holds[single])),
        corners_pass=bool(np.all(holds[corner])),
        worst=worst,
        worst_corner=worst_corner,
        failure=missed[0],
        gravest=missed[1],
    )


def _worst(sweep: Sweep, found: MarginBatch, plants: slice) -> list[Mapping[str, Worst]]:
    """Worst of each margin for each controller over some of the plants."""
    worst: list[dict[str, Worst]] = [{} for _ in found.stable]
    for name, (_, small_is_bad) in MARGIN_NAMES.items():
        values = getattr(found, name)[:, plants]
        at = np.argmin(values, axis=1) if small_is_bad else np.argmax(values, axis=1)
        for case, row, column in zip(worst, values, at, strict=True):
            plant = plants.start + int(column)
            parameter, factor = sweep.moved[plant]
            case[name] = Worst(
                value=float(row[column]),
                parameter=parameter,
                factor=factor,
                where=sweep.where[plant],
            )
    return [MappingProxyType(case) for case in worst]


def controller_column(controllers: Sequence[PID]) -> PIDBatch:
    """Controllers as a batch of shape (m, 1), to stand against plants of shape (n,)."""
    return PIDBatch(
        Kc=np.array([[c.Kc] for c in controllers]),
        Ti=np.array([[c.Ti] for c in controllers]),
        Td=np.array([[c.Td] for c in controllers]),
        N=np.array([[c.N] for c in controllers]),
        tauF=np.array([[c.tauF] for c in controllers]),
        sign=np.array([[c.action.sign] for c in controllers]),
    )


def _part(found: MarginBatch, part: Part, shape: tuple[int, ...]) -> MarginBatch:
    return MarginBatch(
        stable=found.stable[part].reshape(shape),
        gain=found.gain[part].reshape(shape),
        gain_reduction=found.gain_reduction[part].reshape(shape),
        phase=found.phase[part].reshape(shape),
        delay=found.delay[part].reshape(shape),
        Ms=found.Ms[part].reshape(shape),
        Mt=found.Mt[part].reshape(shape),
    )
