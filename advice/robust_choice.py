"""What robust design adds to a case on request: proofs over the whole box, and optimal settings.

Proofs and optima take some tenths of a second, so a case comes without them unless asked.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from advice.tune import TuningCase
from identification.draws import parameter_draws
from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.process import Process, PureDelay, TransferFunction
from tuning.box_proof import BoxProof, prove_box
from tuning.catalogue import RULES
from tuning.detuning import Front, front
from tuning.joint_tau_c import JointTauC, joint_tau_c
from tuning.largest_box import LargestBox, largest_box
from tuning.loop_limits import LoopLimits
from tuning.optimal_robust import BoxOptimum, DrawOptimum, optimal_over_box, optimal_over_draws
from tuning.optimal_search import Structure
from tuning.profiles import Profile

Found = TypeVar("Found")
STRUCTURES: tuple[Structure, ...] = ("PI", "PID")
FRONT_POINTS = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProvenSettings:
    """What is proven of one controller.

    Attributes
    ----------
    name : str
        "recommended" or "running".
    pid : PID
        The settings.
    proof : BoxProof
        Worst margins over ±50 % of every parameter at once.
    largest : LargestBox
        Largest error of all parameters that the profile survives.
    """

    name: str
    pid: PID
    proof: BoxProof
    largest: LargestBox


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CaseProof:
    """Proofs for a case.

    Attributes
    ----------
    settings : tuple of ProvenSettings
        The recommended and the running settings, where there are any.
    joint_tau_c : JointTauC or None
        SIMC's tau_c that is proven with all parameters off at once.
    joint_refusal : str
        Why there is none; empty where there is.
    """

    settings: tuple[ProvenSettings, ...]
    joint_tau_c: JointTauC | None
    joint_refusal: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OptimalChoice:
    """Optimal settings of one structure under the profile.

    Attributes
    ----------
    structure : str
        PI or PID.
    over_box : BoxOptimum or None
        Least load area whose limits are proven over ±50 % of every parameter at once.
    over_draws : DrawOptimum or None
        The same over what the record leaves open, with a stated probability; None where the
        process was given or its errors are not known.
    front : Front or None
        From calm to fast, at the model.
    refusals : tuple of str
        Why something is missing.
    """

    structure: Structure
    over_box: BoxOptimum | None
    over_draws: DrawOptimum | None
    front: Front | None
    refusals: tuple[str, ...]


def prove_case(case: TuningCase, *, scan_time: float = 0.0) -> CaseProof | None:
    """Prove what the recommended and the running settings keep over the whole box.

    Parameters
    ----------
    case : TuningCase
        A case; without a process nothing can be proven, and None comes back.
    scan_time : float
        Scan time of the controller. [s]

    Raises
    ------
    ValueError
        The scan time is impossible.
    """
    process = case.process
    if process is None:
        return None
    best = None if case.best is None else case.best.proposal.pid
    named = [("recommended", best), ("running", case.running)]
    settings = tuple(
        ProvenSettings(
            name=name,
            pid=pid,
            proof=prove_box(process, pid, sample_time=scan_time),
            largest=largest_box(process, pid, case.profile, sample_time=scan_time),
        )
        for name, pid in named
        if pid is not None
    )
    structure = next(
        (t.proposal.structure for t in case.tunings if t.proposal.rule == "simc"), "PI"
    )
    joint, refusal = _or_refusal(
        lambda: joint_tau_c(process, RULES["simc"], structure, case.profile, sample_time=scan_time)
    )
    return CaseProof(settings=settings, joint_tau_c=joint, joint_refusal=refusal)


def optimal_choices(
    case: TuningCase, *, scan_time: float = 0.0
) -> tuple[OptimalChoice, ...] | None:
    """Find the optimal PI and PID for a case under its profile.

    Parameters
    ----------
    case : TuningCase
        A case; without a process there is no optimum, and None comes back.
    scan_time : float
        Scan time of the controller. [s]

    Raises
    ------
    ValueError
        The scan time is impossible.
    """
    if case.process is None:
        return None
    return tuple(
        _choice(case, case.process, case.profile, structure, scan_time) for structure in STRUCTURES
    )


def _choice(
    case: TuningCase, process: Process, profile: Profile, structure: Structure, scan_time: float
) -> OptimalChoice:
    limits = LoopLimits.of(profile)
    over_box, box_refusal = _or_refusal(
        lambda: optimal_over_box(process, limits, structure=structure, sample_time=scan_time)
    )
    over_draws, draws_refusal = _or_refusal(
        lambda: _over_draws(case, process, limits, structure, scan_time)
    )
    curve, curve_refusal = _or_refusal(
        lambda: front(process, structure=structure, points=FRONT_POINTS, sample_time=scan_time)
    )
    refusals = dict.fromkeys((box_refusal, draws_refusal, curve_refusal))
    return OptimalChoice(
        structure=structure,
        over_box=over_box,
        over_draws=over_draws,
        front=curve,
        refusals=tuple(text for text in refusals if text),
    )


def _over_draws(
    case: TuningCase,
    process: Process,
    limits: LoopLimits,
    structure: Structure,
    scan_time: float,
) -> DrawOptimum | None:
    if case.model is None or isinstance(process, TransferFunction | PureDelay):
        return None
    try:
        draws = parameter_draws(case.model)
    except ValueError as reason:
        raise RuleNotApplicable("Tuning over draws", str(reason)) from reason
    return optimal_over_draws(process, draws, limits, structure=structure, sample_time=scan_time)


def _or_refusal(work: Callable[[], Found]) -> tuple[Found | None, str]:
    try:
        return work(), ""
    except RuleNotApplicable as refusal:
        return None, str(refusal)
