"""Why a loop is suspected, in words."""

from collections.abc import Sequence

import numpy as np

from advice.display import digits
from advice.swings import Swing
from monitoring.origin import NAMED_FROM
from monitoring.propagation import Propagation
from monitoring.stiction_model import stiction_model

# Below this, a probability is not worth naming in a list of rivals.
WORTH_NAMING = 0.05
# Standard errors from which a delay is not none.
CLEAR_DELAY = 2.0


def evidence_of(swing: Swing, place: int, tags: Sequence[str], dt: float) -> tuple[str, ...]:
    """Say what is known of one loop of a group, one fact a sentence.

    Parameters
    ----------
    swing : Swing
        The group.
    place : int
        Place in its members.
    tags : sequence of str
        Names of its members.
    dt : float
        Sample time. [s]
    """
    said = [_valve(swing, place), _shape(swing, place)]
    if place in swing.compared:
        said += [_told(swing, place, tags), _led(swing, place, tags, dt)]
    else:
        said.append("it feels the oscillation too little to be compared with the others")
    if not swing.own[place]:
        said.append(
            f"no oscillation of its own is seen, it keeps step with the group "
            f"(coherence {swing.coherence[place]:.2f})"
        )
    return tuple(sentence for sentence in said if sentence)


def group_reason(swing: Swing, tags: Sequence[str]) -> str:
    """Say where the oscillation likely begins, or why that is not known.

    Parameters
    ----------
    swing : Swing
        The group.
    tags : sequence of str
        Names of its members.
    """
    named = swing.origin.named
    if named is None:
        return _undecided(swing, tags)
    first = f"It begins or enters at {tags[named]} (probability {_p(swing, named)})"
    if _sticks(swing, named) or swing.nonlinear[named].significant:
        return f"{first}. Check its valve first."
    return (
        f"{first}. Nothing says that its valve sticks: look at its tuning, and at what disturbs it."
    )


def _undecided(swing: Swing, tags: Sequence[str]) -> str:
    order = np.argsort(-np.array(swing.origin.probabilities), kind="stable")
    rivals = [
        f"{tags[k]} {_p(swing, int(k))}"
        for k in order[:3]
        if swing.origin.probabilities[k] >= WORTH_NAMING
    ]
    outside = (
        f"a disturbance from outside that reaches several at once {swing.origin.elsewhere:.2f}"
    )
    if swing.origin.elsewhere >= NAMED_FROM:
        return f"No loop stands out: {outside} is the likeliest."
    return f"No loop stands out, the data do not say: {', '.join([*rivals, outside])}."


def _p(swing: Swing, place: int) -> str:
    return f"{swing.origin.probabilities[place]:.2f}"


def _sticks(swing: Swing, place: int) -> bool:
    probability = swing.loops[place].stiction
    return probability is not None and probability >= stiction_model().stiction_from


def _valve(swing: Swing, place: int) -> str:
    probability = swing.loops[place].stiction
    if probability is None:
        return "its valve cannot be judged"
    if _sticks(swing, place):
        return f"its valve likely sticks (probability {probability:.2f})"
    if probability < stiction_model().none_below:
        return f"its valve does not stick (probability {probability:.2f})"
    return f"whether its valve sticks is undecided (probability {probability:.2f})"


def _shape(swing: Swing, place: int) -> str:
    found = swing.nonlinear[place]
    if found.index is None:
        return f"its shape cannot be judged: {found.reason}"
    if not found.significant:
        return f"its shape is that of a linear loop (index {found.index:.2f})"
    rest = [one.index for k, one in enumerate(swing.nonlinear) if k != place and one.index]
    most = "the most non-linear" if found.index > max(rest, default=0.0) else "non-linear"
    return f"it is {most} (index {found.index:.2f})"


def _told(swing: Swing, place: int, tags: Sequence[str]) -> str:
    """Whom it tells, and who tells it."""
    here = swing.compared.index(place)
    drives = [a.effect for a in swing.arrows.arrows if a.significant and a.cause == here]
    driven = [a.cause for a in swing.arrows.arrows if a.significant and a.effect == here]

    def names(places: Sequence[int]) -> str:
        return ", ".join(tags[swing.compared[k]] for k in places)

    if swing.arrows.reason:
        return ""
    if drives and driven:
        return f"its past tells what {names(drives)} will do, and that of {names(driven)} tells it"
    if drives:
        return f"its past tells what {names(drives)} will do, and no other tells it"
    if driven:
        return f"the past of {names(driven)} tells what it will do"
    return "its past tells nothing of the others, nor theirs of it"


def _led(swing: Swing, place: int, tags: Sequence[str], dt: float) -> str:
    """Whom it leads or follows, by delays that stand out; by the nearest in phase otherwise."""
    here = swing.compared.index(place)
    clear = [pair for pair in swing.delays if pair.clear and here in (pair.first, pair.second)]
    if not clear:
        return "" if not swing.delays else "its delays are known up to parts of a period only"
    clear = [pair for pair in clear if abs(pair.delay) > CLEAR_DELAY * pair.error]
    if not clear:
        return "it swings at the same time as the others"
    parts = []
    for pair in clear:
        other = tags[swing.compared[pair.second if pair.first == here else pair.first]]
        ahead = _ahead(pair, here) * dt
        word = "leads" if ahead > 0 else "follows"
        parts.append(f"{word} {other} by {digits(abs(ahead))} s")
    return f"it {', '.join(parts)}"


def _ahead(pair: Propagation, here: int) -> float:
    return pair.delay if pair.first == here else -pair.delay


def doubts_of(swing: Swing) -> tuple[str, ...]:
    """Say what could not be judged in a group, and why.

    Parameters
    ----------
    swing : Swing
        The group.
    """
    doubts = []
    if swing.arrows.reason:
        doubts.append(f"Who predicts whom was not tested: {swing.arrows.reason}.")
    elif len(swing.compared) > 2 and not swing.arrows.conditional:
        doubts.append(
            "The record is too short to allow for all loops at once: pairs were looked at alone, "
            "and an arrow may pass through a third loop."
        )
    if not swing.delays:
        doubts.append("Delays were not measured: that needs 16 cycles.")
    elif not any(pair.clear for pair in swing.delays):
        doubts.append(
            "The oscillation is so regular that delays are known up to whole periods, or half ones "
            "with the sign turned."
        )
    return tuple(doubts)
