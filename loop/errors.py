"""Facts that stop an engineering answer, with the numbers they rest on."""


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
        plural = "pole" if unstable_poles == 1 else "poles"
        super().__init__(
            f"The closed loop is unstable: {unstable_poles} {plural} in the right half-plane. "
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
