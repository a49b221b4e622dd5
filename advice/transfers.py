"""Transfer entropy between the likeliest source of a small group and its nearest rivals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from advice.display import digits
from advice.swings import Swing, thinning
from monitoring.transfer_entropy import TransferEntropy, transfer_entropy

# Half a second a direction: only in groups of so many loops that are compared, and only between
# the likeliest source and as many rivals.
MOST_COMPARED = 4
RIVALS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """What one loop tells of another.

    Attributes
    ----------
    cause, effect : int
        Places in the members of the group.
    found : TransferEntropy
        What was measured.
    delay : float or None
        Delay of the cause. [samples]
    """

    cause: int
    effect: int
    found: TransferEntropy
    delay: float | None


def transfers_of(swing: Swing, *, seed: int = 0) -> tuple[Transfer, ...]:
    """Measure both directions between the likeliest source and its two nearest rivals.

    Pairs are looked at alone: what passes through a third loop counts.

    Parameters
    ----------
    swing : Swing
        The group.
    seed : int
        Seed of the shifts.

    Returns
    -------
    tuple of Transfer
        Empty where more than four loops are compared.
    """
    if len(swing.compared) > MOST_COMPARED:
        return ()
    chances = [swing.origin.probabilities[k] for k in swing.compared]
    first, *rivals = np.argsort(-np.array(chances), kind="stable")[: RIVALS + 1].tolist()
    step = thinning(swing.period)
    found = []
    for cause, effect in [
        pair for rival in rivals for pair in ((first, rival), (rival, first))
    ]:  # fmt: skip
        one = transfer_entropy(swing.signals[cause], swing.signals[effect], seed=seed)
        found.append(
            Transfer(
                cause=swing.compared[cause], effect=swing.compared[effect], found=one,
                delay=None if one.delay is None else one.delay * step,
            )
        )  # fmt: skip
    return tuple(found)


def told_by_entropy(
    transfers: Sequence[Transfer], place: int, tags: Sequence[str], dt: float
) -> str:
    """Say whom a loop tells by transfer entropy, and how much later; empty where nobody.

    Parameters
    ----------
    transfers : sequence of Transfer
        What was measured.
    place : int
        Place of the loop in the members of the group.
    tags : sequence of str
        Names of the members.
    dt : float
        Sample time. [s]
    """
    parts = [
        f"{tags[one.effect]} {one.found.value:.2f} nat after {digits(one.delay * dt)} s"
        for one in transfers
        if one.cause == place and one.found.significant and one.delay is not None
    ]
    return f"by transfer entropy it tells {', '.join(parts)}" if parts else ""


def doubt_of_entropy(transfers: Sequence[Transfer]) -> str:
    """Say why transfer entropy was not measured; empty where it was, or was not asked for.

    Parameters
    ----------
    transfers : sequence of Transfer
        What was measured.
    """
    reasons = [one.found.reason for one in transfers if one.found.reason]
    return f"Transfer entropy was not measured: {reasons[0]}." if reasons else ""
