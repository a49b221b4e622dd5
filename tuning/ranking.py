"""Which of the verified settings to recommend, and why.

Among the settings that pass the profile under ±50 % of model error, the one that lets a load
disturbance through least is recommended: the area under the deviation after a step of 1 OP at the
process input is Ti/Kc exactly (the integral must end at -1 OP), and with the damping that a
profile asks for the area is the IAE. Settings without integral action leave an offset and are not
recommended. Two things outrank the area: a rule that was confirmed goes before one from memory,
and a PID must save a fifth of the area of the best PI, since its derivative multiplies the noise
on the output by up to N + 1.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from loop.controller import PID
from tuning.catalogue import rule_of
from tuning.proposals import Proposal
from tuning.shortfall import gain_margin_words
from tuning.verification import Verification

# What a PID must save of the best PI's area to be worth its noise and its wear on the valve.
PID_SAVES = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Recommendation:
    """The settings to use and the reason, or the reason why there are none.

    Attributes
    ----------
    index : int or None
        Index of the recommended proposal; None where none can be recommended.
    reason : str
        Always filled: why this one, or why none.
    """

    index: int | None
    reason: str


def load_area(pid: PID) -> float:
    """Area under the deviation after a load step of 1 OP at the process input, Ti/Kc.

    The area is signed; it is the IAE where the response does not cross the set point.

    Parameters
    ----------
    pid : PID
        Settings.

    Returns
    -------
    float
        Ti/Kc, infinite without integral action. [PV s/OP]
    """
    return pid.Ti / pid.Kc


def recommend(
    proposals: Sequence[Proposal], verifications: Sequence[Verification | None]
) -> Recommendation:
    """Recommend one of the proposals that pass, or say why there is none.

    Parameters
    ----------
    proposals : sequence of Proposal
        What the rules answered.
    verifications : sequence of Verification or None
        What each proposal keeps, None for a refusal; all under one profile.

    Raises
    ------
    ValueError
        The sequences differ in length.
    """
    if len(proposals) != len(verifications):
        raise ValueError(
            f"{len(proposals)} proposals need as many verifications, got {len(verifications)}"
        )
    cases = [
        _Case(index=i, proposal=p, pid=p.pid, verification=v)
        for i, (p, v) in enumerate(zip(proposals, verifications, strict=True))
        if p.pid is not None and v is not None
    ]
    passing = [case for case in cases if case.verification.passes]
    sound = [case for case in passing if case.pid.structure in ("PI", "PID")]
    if not sound:
        return Recommendation(index=None, reason=_why_none(cases, passing))
    confirmed = [case for case in sound if case.proposal.status == "confirmed"]
    chosen, runner = _pi_or_pid(confirmed or sound)
    return Recommendation(index=chosen.index, reason=_why(chosen, runner, sound))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Case:
    index: int
    proposal: Proposal
    pid: PID
    verification: Verification

    @property
    def area(self) -> float:
        return load_area(self.pid)

    @property
    def name(self) -> str:
        """The rule with its structure and speed."""
        title = rule_of(self.proposal.rule).title
        structure = self.proposal.structure
        words = title if title.split()[-1].startswith("PI") else f"{title} {structure}"
        if self.proposal.tau_c is None:
            return words
        return f"{words} at tau_c = {self.proposal.tau_c:.4g} s ({self.proposal.tau_c_reason})"


def _smallest(cases: Iterable[_Case]) -> _Case | None:
    return min(cases, key=lambda case: case.area, default=None)


def _pi_or_pid(cases: Sequence[_Case]) -> tuple[_Case, _Case | None]:
    """The best PI and the best PID, the one that is worth it first."""
    pi = _smallest(case for case in cases if case.pid.structure == "PI")
    pid = _smallest(case for case in cases if case.pid.structure == "PID")
    if pi is None or pid is None:
        return min(cases, key=lambda case: case.area), None
    if pid.area <= (1 - PID_SAVES) * pi.area:
        return pid, pi
    return pi, pid if pid.area < pi.area else None


def _why(chosen: _Case, runner: _Case | None, sound: Sequence[_Case]) -> str:
    found = chosen.verification
    gain, phase, Ms = (found.worst[name] for name in ("gain", "phase", "Ms"))
    area = f"Ti/Kc = {chosen.area:.4g} s PV/OP"
    among = (
        f"of the {len(sound)} settings that do, it lets a load disturbance through least: {area}"
    )
    said = [
        f"{chosen.name} passes the {found.profile.name} profile for ±50 % of each parameter "
        f"(worst gain margin {gain_margin_words(gain.value)} {gain.where}, "
        f"phase margin {phase.value:.3g}° {phase.where}, Ms {Ms.value:.3g} {Ms.where})",
        among if len(sound) > 1 else f"no other settings do; for a load disturbance {area}",
    ]
    if runner is not None and runner.pid.structure == "PID":
        said.append(
            f"{runner.name} would save {1 - runner.area / chosen.area:.0%} of that, less than the "
            f"{PID_SAVES:.0%} that pays for the noise its derivative puts on the output"
        )
    elif runner is not None:
        said.append(
            f"its derivative saves {1 - chosen.area / runner.area:.0%} against {runner.name}, at "
            f"{1 + chosen.pid.N:.3g} times its Kc for fast noise"
        )
    if chosen.proposal.status == "memory":
        said.append("no confirmed rule passes: this one is from memory, check it before use")
    return "; ".join(said) + "."


def _why_none(cases: Sequence[_Case], passing: Sequence[_Case]) -> str:
    if passing:
        names = ", ".join(case.name for case in passing)
        return f"Only settings without integral action pass ({names}); they leave an offset."
    if not cases:
        return "No rule has settings for this process; each refusal says why."
    _, closest = min(
        ((case.verification.gravest.overrun, case) for case in cases if case.verification.gravest),
        key=lambda pair: pair[0],
    )
    profile = closest.verification.profile.name
    return (
        f"No settings pass the {profile} profile for ±50 % of each parameter. The closest is "
        f"{closest.name}: {closest.verification.missed}."
    )
