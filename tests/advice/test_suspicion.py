"""Reasons in words, from groups made up by hand."""

from dataclasses import replace

import numpy as np
import pytest

from advice.suspicion import doubts_of, evidence_of, group_reason
from advice.swings import Swing
from monitoring.granger import Granger, GrangerArrow
from monitoring.nonlinearity import Nonlinearity
from monitoring.origin import LoopEvidence, Origin
from monitoring.propagation import Propagation

TAGS = ("A", "B", "C")


def arrow(cause: int, effect: int) -> GrangerArrow:
    return GrangerArrow(
        cause=cause, effect=effect, strength=0.3, p_value=0.0, beyond=9.0, significant=True
    )


def delay(first: int, second: int, late: float, *, clear: bool = True) -> Propagation:
    return Propagation(
        first=first, second=second, delay=late, error=0.5, sign=1, correlation=0.9, rival=20.0,
        clear=clear, phase_delay=None,
    )  # fmt: skip


def swing(*, stiction: tuple[float | None, ...] = (0.97, 0.01, None)) -> Swing:
    """A drives B, B drives C; C feels too little to be compared at first."""
    return Swing(
        members=(0, 1, 2), period=40.0, similarity=0.9, coherence=(1.0, 0.9, 0.4),
        own=(True, True, False),
        loops=tuple(LoopEvidence(share=0.5, nonlinearity=1.0, stiction=p) for p in stiction),
        nonlinear=(
            Nonlinearity(index=2.0), Nonlinearity(index=0.5),
            Nonlinearity(index=None, reason="7 cycles are fewer than 10"),
        ),
        compared=(0, 1), signals=np.zeros((2, 0)),
        arrows=Granger(arrows=(arrow(0, 1),), order=2, conditional=False),
        delays=(delay(0, 1, 6.0),),
        origin=Origin(probabilities=(0.95, 0.03, 0.0), elsewhere=0.02, named=0),
    )  # fmt: skip


def test_what_is_known_of_each_loop_is_said() -> None:
    assert evidence_of(swing(), 0, TAGS, 10.0) == (
        "its valve likely sticks (probability 0.97)",
        "it is the most non-linear (index 2.00)",
        "its past tells what B will do, and no other tells it",
        "it leads B by 60.00 s",
    )
    assert evidence_of(swing(), 1, TAGS, 10.0) == (
        "its valve does not stick (probability 0.01)",
        "its shape is that of a linear loop (index 0.50)",
        "the past of A tells what it will do",
        "it follows A by 60.00 s",
    )
    assert evidence_of(swing(), 2, TAGS, 10.0) == (
        "its valve cannot be judged",
        "its shape cannot be judged: 7 cycles are fewer than 10",
        "it feels the oscillation too little to be compared with the others",
        "no oscillation of its own is seen, it keeps step with the group (coherence 0.40)",
    )


def test_arrows_both_ways_and_none_are_told_apart() -> None:
    both = replace(
        swing(), arrows=Granger(arrows=(arrow(0, 1), arrow(1, 0)), order=2, conditional=True)
    )
    assert "its past tells what B will do, and that of B tells it" in evidence_of(
        both, 0, TAGS, 1.0
    )
    none = replace(swing(), arrows=Granger(arrows=(), order=2, conditional=True))
    assert "its past tells nothing of the others, nor theirs of it" in evidence_of(none, 0, TAGS, 1)


@pytest.mark.parametrize(
    ("delays", "said"),
    [
        ((delay(0, 1, 0.4),), "it swings at the same time as the others"),
        ((delay(0, 1, 6.0, clear=False),), "its delays are known up to parts of a period only"),
    ],
)
def test_delays_that_say_little_say_so(delays: tuple[Propagation, ...], said: str) -> None:
    assert said in evidence_of(replace(swing(), delays=delays), 0, TAGS, 1.0)


def test_a_valve_that_is_undecided_is_called_so() -> None:
    said = evidence_of(swing(stiction=(0.3, None, None)), 0, TAGS, 1.0)
    assert "whether its valve sticks is undecided (probability 0.30)" in said


def test_the_group_says_where_to_look_first() -> None:
    assert group_reason(swing(), TAGS) == (
        "It begins or enters at A (probability 0.95). Check its valve first."
    )
    linear = replace(swing(stiction=(0.01, None, None)), nonlinear=(Nonlinearity(index=0.1),) * 3)
    assert "look at its tuning, and at what disturbs it" in group_reason(linear, TAGS)
    nobody = replace(
        swing(), origin=Origin(probabilities=(0.5, 0.3, 0.01), elsewhere=0.19, named=None)
    )
    assert group_reason(nobody, TAGS) == (
        "No loop stands out, the data do not say: A 0.50, B 0.30, a disturbance from outside that "
        "reaches several at once 0.19."
    )
    outside = replace(
        swing(), origin=Origin(probabilities=(0.05, 0.05, 0.0), elsewhere=0.9, named=None)
    )
    assert "from outside that reaches several at once 0.90 is the likeliest" in group_reason(
        outside, TAGS
    )


def test_what_could_not_be_judged_is_listed() -> None:
    assert doubts_of(swing()) == ()
    short = Granger(arrows=(), order=None, conditional=False, reason="50 samples are too few")
    regular = replace(swing(), compared=(0, 1, 2), delays=(delay(0, 1, 6.0, clear=False),))
    pairs, unclear = doubts_of(regular)
    assert "pairs were looked at alone" in pairs
    assert "up to whole periods" in unclear
    assert doubts_of(replace(swing(), arrows=short, delays=())) == (
        "Who predicts whom was not tested: 50 samples are too few.",
        "Delays were not measured: that needs 16 cycles.",
    )
    assert "its past" not in " ".join(evidence_of(replace(swing(), arrows=short), 0, TAGS, 1.0))
