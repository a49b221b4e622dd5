"""The one walk from a record to verified settings: data, model, tunings, verdict, recommendation.

The command line, the REST service and a notebook all call these functions:

    from historian.csv_file import read_export
    from advice.tune import tune
    case = tune(read_export("step.csv").record())
"""

from dataclasses import dataclass, replace

from advice.frequency import FrequencyCase, measured_beside
from advice.identifying import as_found, identified
from advice.rivals import for_all_readings
from identification.identify import Identification
from identification.relay import looks_like_relay
from identification.relay_model import RelayModel, relay_model
from identification.running_controller import RunningController
from loop.controller import PID, Action
from loop.errors import NoLimitCycle
from loop.half_rule import Reduction
from loop.process import (
    FOPDT,
    IPDT,
    SOPDT,
    DoubleIntegrator,
    Process,
    PureDelay,
    TransferFunction,
    gain_sign,
)
from loop.record import Record
from loop.swing import swing_of
from tuning.answer import Tuning, Tunings, tunings
from tuning.full_process import FullProcess, on_full_process, simplest
from tuning.profiles import DEFAULT_PROFILE, Profile, profile_named
from tuning.proposals import tune_from_ultimate
from tuning.swinging import verify_swing
from tuning.ultimate import UltimatePoint
from tuning.verification import Verification, verify

TunedProcess = FOPDT | SOPDT | IPDT | DoubleIntegrator | PureDelay
StatedProcess = TunedProcess | TransferFunction


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TuningCase:
    """Everything from the data to the recommendation, for one loop.

    Attributes
    ----------
    profile : Profile
        Limits that the settings were held to.
    record : Record or None
        Data that the case rests on; None where the process was given.
    model : Identification or None
        What the data say of the process; None where it was given.
    relay : RelayModel or None
        Cycles, ultimate gain and period, for a relay test.
    process : Process or None
        Process that was tuned; None where the data carry none.
    tunings : tuple of Tuning
        Every rule's answer.
    recommended : int or None
        Index into `tunings`, None where nothing can be recommended.
    recommended_reason : str
        Why, always filled.
    running : PID or None
        Settings in the controller now, where they are known.
    running_verification : Verification or None
        What those keep on the model.
    reductions : tuple of Reduction
        Low-order models that stood for the process; empty where the rules take it as it is.
    running_full : FullProcess or None
        What the running settings keep on the process itself, where that was reduced.
    frequency : FrequencyCase or None
        Measured response, with the margins of the recommended settings on it, for a frequency test.
    as_found : RunningController or None
        What routine data say of the running settings, where nobody stated them.
    """

    profile: Profile
    record: Record | None
    model: Identification | None
    relay: RelayModel | None
    process: Process | None
    tunings: tuple[Tuning, ...]
    recommended: int | None
    recommended_reason: str
    running: PID | None = None
    running_verification: Verification | None = None
    reductions: tuple[Reduction, ...] = ()
    running_full: FullProcess | None = None
    as_found: RunningController | None = None
    frequency: FrequencyCase | None = None

    @property
    def refused(self) -> bool:
        """Whether the data carry no answer at all."""
        return not self.tunings

    @property
    def best(self) -> Tuning | None:
        """The recommended settings."""
        return None if self.recommended is None else self.tunings[self.recommended]


def tune(
    record: Record,
    *,
    profile: str = DEFAULT_PROFILE,
    tau_c: float | None = None,
    scan_time: float = 0.0,
    running: PID | None = None,
    relay_hysteresis: float = 0.0,
) -> TuningCase:
    """Identify the process behind a record, tune it by every rule and verify the settings.

    Parameters
    ----------
    record : Record
        A step test, a relay test, or routine data in automatic with moves of the set point.
    profile : str
        Name of the target profile in `tuning.profiles.PROFILES`.
    tau_c : float, optional
        Desired closed-loop time constant for the rules that have one; by default each rule's own
        formula. [s]
    scan_time : float
        Scan time of the controller; half of it counts as dead time in every margin. [s]
    running : PID, optional
        Settings in the controller now, to compare with; by default those that routine data show.
    relay_hysteresis : float
        Half-width of the relay's hysteresis, for a relay test. [PV]

    Returns
    -------
    TuningCase
        A refusal is a case too: without tunings, and with the reasons.

    Raises
    ------
    ValueError
        The profile, tau_c or the scan time cannot be.
    """
    limits = profile_named(profile)
    if looks_like_relay(record):
        return _from_relay(
            record, limits, hysteresis=relay_hysteresis, tau_c=tau_c, scan_time=scan_time,
            running=running,
        )  # fmt: skip
    model = identified(record)
    read = as_found(record, model) if running is None else None
    running = running if read is None else read.pid
    if model.process is None:
        return TuningCase(
            profile=limits,
            record=record,
            model=model,
            relay=None,
            process=None,
            tunings=(),
            recommended=None,
            recommended_reason="No settings, because the model was refused: "
            + " ".join(model.reasons),
            running=running,
            as_found=read,
            frequency=measured_beside(record, running),
        )
    case = _tuned(
        model.full or model.process, limits, tau_c=tau_c, scan_time=scan_time, running=running,
        record=record, model=model,
    )  # fmt: skip
    settings = running if case.best is None else case.best.proposal.pid
    return replace(case, as_found=read, frequency=measured_beside(record, settings))


def tune_process(
    process: Process,
    *,
    profile: str = DEFAULT_PROFILE,
    tau_c: float | None = None,
    scan_time: float = 0.0,
    running: PID | None = None,
) -> TuningCase:
    """Tune a process that the caller states, by every rule, and verify the settings.

    Parameters
    ----------
    process : Process
        Process model. One of any order is reduced by the half rule for the rules, and the settings
        are held to the process itself as well.
    profile : str
        Name of the target profile.
    tau_c : float, optional
        Desired closed-loop time constant. [s]
    scan_time : float
        Scan time of the controller. [s]
    running : PID, optional
        Settings in the controller now.

    Raises
    ------
    RuleNotApplicable
        The process is unstable, has complex zeros, or oscillates and is of an order above two.
    ValueError
        The profile, tau_c or the scan time cannot be.
    """
    return _tuned(
        simplest(process), profile_named(profile), tau_c=tau_c, scan_time=scan_time, running=running
    )


def _tuned(
    process: Process,
    profile: Profile,
    *,
    tau_c: float | None,
    scan_time: float,
    running: PID | None,
    record: Record | None = None,
    model: Identification | None = None,
    relay: RelayModel | None = None,
) -> TuningCase:
    if running is not None:
        # A loop that runs has the right action; only its numbers are in question.
        running = replace(running, action=Action.for_gain(gain_sign(process)))
    answer = tunings(process, profile, tau_c=tau_c, sample_time=scan_time)
    if record is not None and model is not None:
        answer = for_all_readings(answer, process, record, model, scan_time)
    verification, full = _kept(process, running, answer, scan_time)
    return TuningCase(
        profile=profile,
        record=record,
        model=model,
        relay=relay,
        process=process,
        tunings=answer.tunings,
        recommended=answer.recommendation.index,
        recommended_reason=answer.recommendation.reason,
        running=running,
        running_verification=verification,
        reductions=answer.reductions,
        running_full=full,
    )


def _kept(
    process: Process, running: PID | None, answer: Tunings, scan_time: float
) -> tuple[Verification | None, FullProcess | None]:
    """What the running settings keep: on the model that rules have, and on the process itself."""
    if running is None:
        return None, None
    swing = swing_of(process)
    if swing is not None:
        (found,) = verify_swing(swing, [running], answer.profile, sample_time=scan_time)
        return found, None
    if not answer.reductions:
        return verify(process, running, answer.profile, sample_time=scan_time), None
    closest = answer.reductions[-1]
    (full,) = on_full_process(process, [(running, closest)], answer.profile, sample_time=scan_time)
    on_model = verify(closest.model, running, answer.profile, sample_time=scan_time)
    return on_model, full


def _from_relay(
    record: Record,
    profile: Profile,
    *,
    hysteresis: float,
    tau_c: float | None,
    scan_time: float,
    running: PID | None,
) -> TuningCase:
    """Tune the model that the waveform carries; without one, the ultimate-point rules alone.

    Those have no proof, so none of them is recommended.
    """
    try:
        found = relay_model(record, hysteresis=hysteresis)
    except NoLimitCycle as reason:
        return TuningCase(
            profile=profile, record=record, model=None, relay=None, process=None, tunings=(),
            recommended=None, recommended_reason=f"No settings: {reason}",
        )  # fmt: skip
    if found.model.process is not None:
        return _tuned(
            found.model.process, profile, tau_c=tau_c, scan_time=scan_time, running=running,
            record=record, model=found.model, relay=found,
        )  # fmt: skip
    point = UltimatePoint(
        Ku=found.relay.Ku,
        Pu=found.relay.Pu,
        action=Action.for_gain(found.relay.gain_sign),
        source="describing function",
    )
    return TuningCase(
        profile=profile,
        record=record,
        model=found.model,
        relay=found,
        process=None,
        tunings=tuple(Tuning(proposal=p, verification=None) for p in tune_from_ultimate(point)),
        recommended=None,
        recommended_reason=(
            "Nothing is recommended: Ku and Pu alone say nothing of the margins under model "
            "errors, and the model from the cycles was refused. "
            + " ".join(found.model.reasons[:1])
        ),
        running=running,
    )
