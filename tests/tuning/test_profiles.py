"""Target profiles: printed in dB, kept as ratios, refused when impossible."""

import pytest

from tuning.profiles import DEFAULT_PROFILE, PROFILES, Profile, profile_named


@pytest.mark.parametrize(
    ("name", "gain_dB", "phase", "Ms"),
    [
        ("process", 10, 60, 1.7),
        ("general", 6, 45, 2.0),
        ("servo", 4, 30, 2.0),
        ("aerospace", 6, 45, 1.4),
        ("disk_drive", 3, 25, 2.5),
        ("hvac", 12, 70, 1.5),
    ],
)
def test_the_profiles_are_those_of_the_trades(
    name: str, gain_dB: float, phase: float, Ms: float
) -> None:
    profile = profile_named(name)
    assert profile.gain_in_decibels == pytest.approx(gain_dB)
    assert (profile.phase, profile.Ms) == (phase, Ms)
    assert profile.delay_over_theta is None
    assert profile.Mt is None


def test_six_decibels_is_a_ratio_just_below_two() -> None:
    assert PROFILES["general"].gain == pytest.approx(1.99526, abs=5e-6)


def test_the_default_profile_exists_and_the_list_is_closed() -> None:
    assert DEFAULT_PROFILE in PROFILES
    assert len(PROFILES) == 6
    with pytest.raises(TypeError):
        PROFILES["mine"] = PROFILES["general"]  # type: ignore[index]


def test_an_unknown_profile_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ValueError, match="process, general, servo"):
        profile_named("heroic")


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"gain": 0.9}, "gain margin"),
        ({"phase": 0.0}, "phase margin"),
        ({"phase": 200.0}, "phase margin"),
        ({"Ms": 1.0}, "Ms"),
        ({"delay_over_theta": -1.0}, "delay_over_theta"),
        ({"Mt": 0.5}, "Mt"),
    ],
)
def test_an_impossible_profile_is_refused(limits: dict[str, float], words: str) -> None:
    usual = {"gain": 2.0, "phase": 45.0, "Ms": 2.0}
    with pytest.raises(ValueError, match=words):
        Profile(name="mine", **(usual | limits))
