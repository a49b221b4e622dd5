"""Settings for a process that swings by itself, which no published rule takes.

The PI and the PID of least load area are searched that keep the profile over ±50 % of gain, times
and dead time at once, on the process with half its damping; their margins are then read on the
process itself and with each parameter, its damping too, off by up to ±50 %.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from loop.batch import MarginBatch, ProcessBatch
from loop.chain_margins import full_margins
from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.process import Process, TransferFunction
from loop.signals import Real
from tuning.catalogue import RULES
from tuning.least_area import NAME
from tuning.loop_limits import LoopLimits
from tuning.optimal_robust import optimal_over_box
from tuning.optimal_search import Structure
from tuning.profiles import Profile
from tuning.proposals import Proposal
from tuning.sweep import CORNERS, FACTORS, Sweep, where_of
from tuning.verification import Verification, judged

# The damping that settings are searched at, as a part of the model's: resonance is worst there.
LIGHTER = 0.5
STRUCTURES: tuple[Structure, ...] = ("PI", "PID")
PARAMETERS = ("K", "T", "zeta", "theta")


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """K e^(-theta s)/(T^2 s^2 + 2 zeta T s + 1) with zeta below 1.

    Attributes
    ----------
    K : float
        Gain. [PV/OP]
    T : float
        Time constant. [s]
    zeta : float
        Damping. [-]
    theta : float
        Dead time. [s]
    """

    K: float
    T: float
    zeta: float
    theta: float

    def moved(
        self, K: float = 1.0, T: float = 1.0, zeta: float = 1.0, theta: float = 1.0
    ) -> Process:
        """Multiply the parameters by factors."""
        time, damping = self.T * T, self.zeta * zeta
        return TransferFunction(
            (self.K * K,), (time**2, 2 * damping * time, 1.0), self.theta * theta
        )


def swing_of(process: Process) -> Swing | None:
    """Read a process as one swing; None where it is another.

    Parameters
    ----------
    process : Process
        Process model. [s]
    """
    match process:
        case TransferFunction(numerator=(n,), denominator=(d2, d1, d0)) if d0 and d2 / d0 > 0:
            T = (d2 / d0) ** 0.5
            zeta = d1 / d0 / (2 * T)
            return Swing(K=n / d0, T=T, zeta=zeta, theta=process.theta) if 0 < zeta < 1 else None
        case _:
            return None


def swing_sweep(swing: Swing) -> tuple[Sweep, list[Process]]:
    """Lay out the plants around a swinging model: one parameter off at a time, and joint corners.

    Parameters
    ----------
    swing : Swing
        Middle.
    """
    names = PARAMETERS if swing.theta else PARAMETERS[:3]
    p = len(names)
    rows = [np.ones((1, p))]
    for column in range(p):
        single = np.ones((len(FACTORS), p))
        single[:, column] = FACTORS
        rows.append(single)
    rows.append(np.array(list(product(CORNERS, repeat=p))))
    table = np.vstack(rows)
    plants = [swing.moved(**dict(zip(names, row.tolist(), strict=True))) for row in table]
    off = [
        [(name, float(f)) for name, f in zip(names, row, strict=True) if f != 1] for row in table
    ]
    # Only dead times and their number are read from this batch, whose lags cannot swing.
    like = ProcessBatch(
        K=np.full(len(plants), swing.K),
        tau1=np.full(len(plants), swing.T),
        tau2=np.zeros(len(plants)),
        integrators=np.zeros(len(plants), dtype=np.intp),
        theta=np.array([plant.theta for plant in plants]),
    )
    sweep = Sweep(
        parameters=names,
        factors=table,
        plants=like,
        corners=2**p,
        where=tuple(where_of(row) for row in off),
        moved=tuple(row[0] if len(row) == 1 else (None, 1.0) for row in off),
    )
    return sweep, plants


def verify_swing(
    swing: Swing, controllers: list[PID], profile: Profile, *, sample_time: float = 0.0
) -> tuple[Verification, ...]:
    """Hold controllers to a profile on a swinging process and under ±50 % of each parameter.

    Parameters
    ----------
    swing : Swing
        Process.
    controllers : list of PID
        Settings as they will run.
    profile : Profile
        Limits on the margins.
    sample_time : float
        Scan time of the controllers; half of it counts as dead time. [s]
    """
    if not controllers:
        return ()
    sweep, plants = swing_sweep(swing)
    found = [full_margins(plant, tuple(controllers), sample_time=sample_time) for plant in plants]

    def together(name: str) -> Real:
        return np.stack([getattr(one, name) for one in found], axis=1)

    batch = MarginBatch(
        stable=np.stack([one.stable for one in found], axis=1),
        gain=together("gain"),
        gain_reduction=together("gain_reduction"),
        phase=together("phase"),
        delay=together("delay"),
        Ms=together("Ms"),
        Mt=together("Mt"),
    )
    return judged(sweep, batch, profile)


def tune_swing(
    swing: Swing, profile: Profile, *, sample_time: float = 0.0
) -> list[tuple[Proposal, Verification | None]]:
    """Find settings for a swinging process, and say why no published rule has any.

    Parameters
    ----------
    swing : Swing
        Process. [s]
    profile : Profile
        Limits on the margins.
    sample_time : float
        Scan time of the controller. [s]

    Returns
    -------
    list of tuple of Proposal and Verification or None
        Refusals of the published rules, then a PI and a PID with what they keep, or the reason.
    """
    why = f"no published rule takes a process that swings by itself (damping {swing.zeta:.2g})"
    answered: list[tuple[Proposal, Verification | None]] = [
        (
            Proposal(
                rule=rule.name,
                structure=structure,
                pid=None,
                refusal=str(RuleNotApplicable(rule.title, why)),
                status=rule.status,
            ),
            None,
        )
        for rule in RULES.values()
        for structure in rule.structures
    ]
    lighter = swing.moved(zeta=LIGHTER)
    for structure in STRUCTURES:
        try:
            found = optimal_over_box(
                lighter, LoopLimits.of(profile), structure=structure, sample_time=sample_time
            )
        except RuleNotApplicable as refusal:
            proposal = Proposal(
                rule=NAME, structure=structure, pid=None, refusal=str(refusal), status="confirmed"
            )
            answered.append((proposal, None))
            continue
        pid = found.settings.pid
        proven = "proven" if found.verdict.holds else "not proven"
        note = (
            f"the profile is {proven} over ±50 % of gain, times and dead time at once with a "
            f"damping of {LIGHTER * swing.zeta:.2g}, half that of the model"
        )
        proposal = Proposal(
            rule=NAME, structure=structure, pid=pid, status="confirmed", notes=(note,)
        )
        (verified,) = verify_swing(swing, [pid], profile, sample_time=sample_time)
        answered.append((proposal, verified))
    return answered
