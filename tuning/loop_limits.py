"""What optimal settings must keep: margins, peaks and the effort of the output."""

import math
from dataclasses import dataclass
from typing import Self

from tuning.profiles import Profile


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopLimits:
    """What settings must keep.

    Attributes
    ----------
    Ms : float
        Largest peak of the sensitivity. [-]
    Mt : float
        Largest peak of the complementary sensitivity; infinite for no limit. [-]
    gain : float
        Smallest gain margin; 1 for no limit. [-]
    phase : float
        Smallest phase margin; 0 for no limit. [deg]
    delay_over_theta : float
        Smallest delay margin over the dead time; 0 for no limit. [-]
    effort : float
        Largest peak of |C/(1 + L)|, from noise to output; infinite for no limit. [OP/PV]
    """

    Ms: float
    Mt: float = math.inf
    gain: float = 1.0
    phase: float = 0.0
    delay_over_theta: float = 0.0
    effort: float = math.inf

    def __post_init__(self) -> None:
        for name, value, least in (
            ("Ms", self.Ms, 1.0),
            ("Mt", self.Mt, 1.0),
            ("effort", self.effort, 0.0),
        ):
            if not value > least:
                raise ValueError(f"the largest {name} must be above {least:g}, got {value}")
        if not 1 <= self.gain < math.inf:
            raise ValueError(f"the smallest gain margin must be 1 or more, got {self.gain}")
        if not 0 <= self.phase < 90:
            raise ValueError(
                f"the smallest phase margin must lie within 0 and below 90°, got {self.phase}"
            )
        if not 0 <= self.delay_over_theta < math.inf:
            raise ValueError(f"delay_over_theta must be 0 or positive, got {self.delay_over_theta}")

    @classmethod
    def of(cls, profile: Profile, *, effort: float = math.inf) -> Self:
        """Take the limits of a profile.

        Parameters
        ----------
        profile : Profile
            Limits on the margins.
        effort : float
            Largest peak of |C/(1 + L)|. [OP/PV]
        """
        return cls(
            Ms=profile.Ms,
            Mt=math.inf if profile.Mt is None else profile.Mt,
            gain=profile.gain,
            phase=profile.phase,
            delay_over_theta=profile.delay_over_theta or 0.0,
            effort=effort,
        )

    def profile(self, name: str = "own limits") -> Profile:
        """The limits as a profile, without the effort; what is not limited is next to nothing."""
        return Profile(
            name=name,
            gain=max(self.gain, 1 + 1e-9),
            phase=max(self.phase, 1e-9),
            Ms=self.Ms,
            delay_over_theta=self.delay_over_theta or None,
            Mt=None if math.isinf(self.Mt) else self.Mt,
        )
