"""Named target profiles: what a loop must keep, at the model and under ±50 % of model error.

Gain margins are printed in dB and kept as ratios. A loop with a gain margin of exactly 4 dB has
Ms >= 2.71, so the Ms column often binds.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """Limits on the margins of a loop.

    Attributes
    ----------
    name : str
        Key in `PROFILES`.
    gain : float
        Smallest gain margin. [-]
    phase : float
        Smallest phase margin. [deg]
    Ms : float
        Largest peak of the sensitivity. [-]
    delay_over_theta : float, optional
        Smallest delay margin over the dead time of the loop it is taken on; 1.5 is usual. [-]
    Mt : float, optional
        Largest peak of the complementary sensitivity. [-]
    """

    name: str
    gain: float
    phase: float
    Ms: float
    delay_over_theta: float | None = None
    Mt: float | None = None

    def __post_init__(self) -> None:
        if not (self.gain > 1 and math.isfinite(self.gain)):
            raise ValueError(f"the gain margin of a profile must be above 1, got {self.gain}")
        if not 0 < self.phase < 180:
            raise ValueError(
                f"the phase margin of a profile must lie between 0 and 180, got {self.phase}"
            )
        if not self.Ms > 1:
            raise ValueError(f"the Ms of a profile must be above 1, got {self.Ms}")
        if self.delay_over_theta is not None and not self.delay_over_theta >= 0:
            raise ValueError(
                f"delay_over_theta of a profile must not be negative, got {self.delay_over_theta}"
            )
        if self.Mt is not None and not self.Mt >= 1:
            raise ValueError(f"the Mt of a profile must be 1 or more, got {self.Mt}")

    @property
    def gain_in_decibels(self) -> float:
        """Smallest gain margin as it is printed. [dB]"""
        return 20 * math.log10(self.gain)


def _profile(name: str, gain_dB: float, phase: float, Ms: float) -> Profile:
    return Profile(name=name, gain=10 ** (gain_dB / 20), phase=phase, Ms=Ms)


DEFAULT_PROFILE = "general"
PROFILES: Mapping[str, Profile] = MappingProxyType(
    {
        profile.name: profile
        for profile in (
            _profile("process", 10, 60, 1.7),
            _profile("general", 6, 45, 2.0),
            _profile("servo", 4, 30, 2.0),
            _profile("aerospace", 6, 45, 1.4),
            _profile("disk_drive", 3, 25, 2.5),
            _profile("hvac", 12, 70, 1.5),
        )
    }
)


def profile_named(name: str) -> Profile:
    """Look up a profile.

    Raises
    ------
    ValueError
        There is no profile of that name.
    """
    if name not in PROFILES:
        raise ValueError(f"profile must be one of {', '.join(PROFILES)}, got {name}")
    return PROFILES[name]
