"""Settings that hold on every process that a record cannot tell from the model.

±50 % of one parameter at a time is the general allowance. A model to be used with care can be off
in other ways: in several parameters together, or as its record allows another reading altogether.
The profile's limits must then hold at each of those processes as well.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from loop.batch import ProcessBatch
from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.margin_batch import batch_margins
from loop.process import Process
from loop.signals import Flags
from tuning.answer import Tuning, Tunings
from tuning.catalogue import RULES
from tuning.profiles import Profile
from tuning.proposals import Proposal
from tuning.ranking import Recommendation, recommend
from tuning.verification import controller_column, verify_many

# Slower settings are tried up to a hundredfold, in steps of a fifth.
SLOWER = np.geomspace(1.0, 100.0, 26)


def withstanding(
    answer: Tunings, process: Process, others: ProcessBatch, *, sample_time: float = 0.0
) -> Tunings:
    """Recommend the best of the settings that also hold at other processes.

    Where none of the rules' settings does, SIMC is slowed down until it does.

    Parameters
    ----------
    answer : Tunings
        Every rule's answer for the model.
    process : Process
        The model.
    others : ProcessBatch, shape (n,)
        Processes that the record cannot tell from it.
    sample_time : float
        Scan time of the controller. [s]

    Returns
    -------
    Tunings
        The same with the recommendation that follows, and with the slower settings added where
        they are needed.
    """
    settings = [t.proposal.pid for t in answer.tunings if t.proposal.pid is not None]
    found = iter(holding(settings, others, answer.profile, sample_time=sample_time))
    held = [t.proposal.pid is not None and next(found) for t in answer.tunings]
    count = others.shape[0]
    chosen = answer.recommendation.index
    if chosen is None:
        return answer
    if held[chosen]:
        reason = f"{answer.recommendation.reason} {_also(answer.profile, count)}"
        return replace(answer, recommendation=Recommendation(index=chosen, reason=reason))
    checked = [
        replace(t, verification=t.verification if good else None)
        for t, good in zip(answer.tunings, held, strict=True)
    ]
    best = recommend([t.proposal for t in checked], [t.verification for t in checked])
    if best.index is not None:
        reason = f"{best.reason} {_also(answer.profile, count)}"
        return replace(answer, recommendation=Recommendation(index=best.index, reason=reason))
    slower = _slower(answer, process, others, sample_time)
    if slower is None:
        return replace(
            answer,
            recommendation=Recommendation(
                index=None,
                reason=f"No settings hold the {answer.profile.name} profile at all {count} "
                "processes that the record cannot tell from the model; better data are needed.",
            ),
        )
    return replace(
        answer,
        tunings=(*answer.tunings, slower),
        recommendation=Recommendation(
            index=len(answer.tunings),
            reason=f"SIMC {slower.proposal.structure} at tau_c = {slower.proposal.tau_c:.4g} s is "
            f"the fastest tried that passes. {_also(answer.profile, count)}",
        ),
    )


def holding(
    settings: Sequence[PID], others: ProcessBatch, profile: Profile, *, sample_time: float = 0.0
) -> Flags:
    """Whether each of some settings keeps the gain, phase and Ms of a profile at all processes.

    Parameters
    ----------
    settings : sequence of PID
        m controllers.
    others : ProcessBatch, shape (n,)
        Processes.
    profile : Profile
        Limits on the margins.
    sample_time : float
        Scan time of the controller. [s]

    Returns
    -------
    ndarray of bool, shape (m,)
    """
    if not settings:
        return np.zeros(0, dtype=np.bool_)
    found = batch_margins(others, controller_column(settings), sample_time=sample_time)
    holds = found.stable & (found.gain >= profile.gain) & (found.phase >= profile.phase)
    return np.asarray(np.all(holds & (found.Ms <= profile.Ms), axis=1))


def _also(profile: Profile, count: int) -> str:
    return (
        f"The record may mean other processes too: the {profile.name} profile also holds at each "
        f"of {count} that it allows."
    )


def _slower(
    answer: Tunings, process: Process, others: ProcessBatch, sample_time: float
) -> Tuning | None:
    """SIMC at the smallest tau_c of a grid that passes everywhere."""
    rule = RULES["simc"]
    base = max(process.theta, float(np.max(others.theta)), sample_time)
    if base <= 0:
        return None
    tried: list[tuple[float, PID]] = []
    for factor in SLOWER.tolist():
        try:
            tried.append((base * factor, rule.structures["PI"](process, base * factor)))
        except (RuleNotApplicable, ValueError):
            continue
    if not tried:
        return None
    settings = [pid for _, pid in tried]
    held = holding(settings, others, answer.profile, sample_time=sample_time)
    verified = verify_many(process, settings, answer.profile, sample_time=sample_time)
    for (tau_c, pid), good, found in zip(tried, held.tolist(), verified, strict=True):
        if good and found.passes:
            return Tuning(
                proposal=Proposal(
                    rule=rule.name,
                    structure="PI",
                    pid=pid,
                    tau_c=tau_c,
                    tau_c_reason="smallest tried that passes at every process the record allows",
                    status="confirmed",
                    notes=rule.notes("PI", process, tau_c),
                ),
                verification=found,
            )
    return None
