"""Facts that stop an engineering answer, with the numbers they rest on."""

import sys

# Count of unstable poles where a dead time meets a loop gain that stays above 1 at high frequency.
INFINITELY_MANY = sys.maxsize


class LoopError(Exception):
    """An engineering fact stands in the way of an answer."""


class RuleNotApplicable(LoopError):
    """The tuning rule does not cover this process."""

    def __init__(self, rule: str, reason: str) -> None:
        super().__init__(f"{rule} does not apply: {reason}.")
        self.rule = rule
        self.reason = reason


class UnstableLoop(LoopError):
    """The closed loop is unstable, so it has no margins."""

    def __init__(self, unstable_poles: int) -> None:
        count = "infinitely many" if unstable_poles == INFINITELY_MANY else str(unstable_poles)
        plural = "pole" if unstable_poles == 1 else "poles"
        super().__init__(
            f"The closed loop is unstable: {count} {plural} in the right half-plane. "
            "Lower Kc or check the sign of the action."
        )
        self.unstable_poles = unstable_poles


class ConversionRefused(LoopError):
    """The controller has no equivalent in the form asked for."""

    def __init__(self, target: str, reason: str) -> None:
        super().__init__(f"There is no {target} form of this controller: {reason}.")
        self.target = target
        self.reason = reason


class NoStepFound(LoopError):
    """The controller output does not move, so nothing can be learned from the record."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class PoorExcitation(LoopError):
    """The process variable hardly answers, or only within its noise."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class NotSteady(LoopError):
    """The process was not at rest where the method needs it to be."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class FitNotTrusted(LoopError):
    """A model was fitted, but the data do not carry it."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class NoLimitCycle(LoopError):
    """The record holds no settled relay cycles."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class LoopDiverged(LoopError):
    """The simulated loop grows without bound."""

    def __init__(self, time: float) -> None:
        super().__init__(
            f"The simulated loop grows without bound; PV left every scale at t = {time:.6g} s. "
            "Lower Kc, check the sign of the action or give the output its limits."
        )
        self.time = time


class NoSamples(LoopError):
    """The sample store holds nothing of this loop, in the time asked for or at all."""

    def __init__(self, loop: str) -> None:
        super().__init__(
            f"The sample store holds no samples of loop {loop}, in the time asked for or at all."
        )
        self.loop = loop


class StoreBusy(LoopError):
    """Other writers kept getting in first, so the upload was given up; nothing was stored."""

    def __init__(self, attempts: int) -> None:
        super().__init__(
            f"Other uploads got in first {attempts} times, so nothing was stored. Send it again."
        )
        self.attempts = attempts


class StoreDamaged(LoopError):
    """The folder of the sample store cannot be read as one."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"The sample store cannot be read: {reason}")
        self.reason = reason


class DiskFull(LoopError):
    """The disk has no room for the samples; nothing was stored."""

    def __init__(self) -> None:
        super().__init__(
            "The disk that holds the samples is full. Nothing was stored. "
            "Make room and send it again."
        )
