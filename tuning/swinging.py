"""Settings for a process that swings by itself, which no published rule takes.

The PI and the PID of least load area are searched that keep the profile over ±50 % of gain, times
and dead time at once, on the process with half its damping; their margins are then read on the
process itself and with each parameter, its damping too, off by up to ±50 %.
"""

from itertools import product

import numpy as np

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.swing import Swing, swing_margins
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


def swing_sweep(swing: Swing) -> tuple[Sweep, list[Swing]]:
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
    plants = [swing.scaled(**dict(zip(names, row.tolist(), strict=True))) for row in table]
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
    rows = PIDBatch.stacked(controllers)
    batch = swing_margins(plants, rows, sample_time=sample_time)
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
    lighter = swing.scaled(zeta=LIGHTER).process
    found: list[Proposal] = []
    for structure in STRUCTURES:
        try:
            best = optimal_over_box(
                lighter, LoopLimits.of(profile), structure=structure, sample_time=sample_time
            )
        except RuleNotApplicable as refusal:
            proposal = Proposal(
                rule=NAME, structure=structure, pid=None, refusal=str(refusal), status="confirmed"
            )
            answered.append((proposal, None))
            continue
        proven = "proven" if best.verdict.holds else "not proven"
        note = (
            f"the profile is {proven} over ±50 % of gain, times and dead time at once with a "
            f"damping of {LIGHTER * swing.zeta:.2g}, half that of the model"
        )
        found.append(
            Proposal(
                rule=NAME,
                structure=structure,
                pid=best.settings.pid,
                status="confirmed",
                notes=(note,),
            )
        )
    # All of them in one batch, whose scan costs little more for two controllers than for one.
    settings = [proposal.pid for proposal in found if proposal.pid is not None]
    verified = verify_swing(swing, settings, profile, sample_time=sample_time)
    return [*answered, *zip(found, verified, strict=True)]
