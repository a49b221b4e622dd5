"""Whether the recorded values are what the sensor read, or what a historian made of them.

Compression keeps few points and draws straight lines between them, exception logging repeats the
last value, a converter rounds, a frozen transmitter or a wrong unit writes down something else.
Each hides noise, so that a fit looks better than it is; each has its effect on the verdict.
"""

from dataclasses import dataclass

import numpy as np

from identification.verdict import Finding, Verdict, graded
from loop.errors import FitNotTrusted
from loop.signals import Flags, Real

# Readings on a straight line between two others: a third of all by rounding, not in noise.
DRAWN, ALL_DRAWN = 0.3, 0.9
# A drawn line over so much of tau + theta is a shape that somebody made up.
LONG_LINE, TOO_LONG_LINE = 0.2, 0.6
# Resolution against the answer: twenty values over it, and five.
COARSE, TOO_COARSE = 0.05, 0.2
# What PV should have moved while it stood still, against the answer, beyond its resolution.
STUCK, TOO_STUCK = 0.1, 0.4
# Decimal numbers are not exact in binary.
WHOLE = 1e-3
# So many equal readings in a row are no chance.
FEWEST_EQUAL = 5
# Rounding of a difference against the range of PV.
ROUNDING = 1e-9
# Kelvin and Fahrenheit against Celsius.
KELVIN, FAHRENHEIT = 273.15, (1.8, 32.0)
NEAR = 0.02
CELSIUS_NAMES = frozenset({"c", "°c", "degc", "deg c", "celsius"})
KELVIN_NAMES = frozenset({"k", "kelvin"})
# No plant is at rest below this in kelvin, few are above it in Celsius without saying so.
COLDEST = 200.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DataFacts:
    """What was done to the readings of PV before they came here.

    Attributes
    ----------
    resolution : float
        Smallest difference of two readings where PV takes few values, 0 where it does not. [PV]
    repeated : float
        Part of the readings that equal the one before. [-]
    longest_equal : float
        Longest time over which PV stands at exactly one value. [s]
    drawn : float
        Part of the readings on a straight line between their neighbours. [-]
    longest_line : float
        Longest such line. [s]
    """

    resolution: float
    repeated: float
    longest_equal: float
    drawn: float
    longest_line: float


def data_facts(t: Real, pv: Real) -> DataFacts:
    """Look for traces of compression, exception logging and rounding.

    Parameters
    ----------
    t, pv : ndarray, shape (n,)
        Times [s] and readings [PV], without gaps, three at least.
    """
    equal = np.diff(pv) == 0
    drawn = _drawn(t, pv)
    return DataFacts(
        resolution=resolution(pv),
        repeated=float(np.mean(equal)),
        longest_equal=_longest(t, equal),
        drawn=float(np.mean(drawn)),
        longest_line=_longest(t[1:], drawn),
    )


def resolution(pv: Real) -> float:
    """Smallest difference of two readings, 0 where nearly every reading has a value of its own.

    Parameters
    ----------
    pv : ndarray, shape (n,)
        Readings. [PV]
    """
    values = np.unique(pv)
    if values.size < 2 or values.size > pv.size / 4:
        return 0.0
    # Rounded values stand a whole number of steps apart; those of an exception log do not.
    steps = np.diff(values)
    smallest = float(np.median(steps[steps < 1.5 * steps.min()]))
    ratio = steps / smallest
    return smallest if float(np.max(np.abs(ratio - np.round(ratio)))) < WHOLE else 0.0


def _drawn(t: Real, pv: Real) -> Flags:
    """Readings that lie exactly between their neighbours while PV moves."""
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    off = np.abs(pv[1:-1] - pv[:-2] - share * (pv[2:] - pv[:-2]))
    rounding = ROUNDING * max(float(np.ptp(pv)), float(np.max(np.abs(pv))) * 1e-3)
    moves = np.abs(pv[2:] - pv[:-2]) > 4 * rounding
    # Rounded readings stand on a line by chance; drawn ones are not rounded.
    step = resolution(pv)
    if step:
        return np.zeros(off.size, dtype=np.bool_)
    return np.asarray((off <= rounding) & moves)


def _longest(t: Real, flags: Flags) -> float:
    """Longest time over flags in a row, flag i standing between t[i] and t[i + 1]. [s]"""
    edges = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    return float(np.max(t[edges[1::2]] - t[edges[::2]], initial=0.0)) if edges.size else 0.0


def judge_data(
    t: Real, pv: Real, predicted: Real, *, swing: float, slowness: float, noise_sd: float
) -> list[Finding]:
    """Say what was done to the readings and what that means for a model fitted to them.

    Parameters
    ----------
    t, pv : ndarray, shape (n,)
        Times [s] and readings [PV].
    predicted : ndarray, shape (n,)
        The model's values at the same times. [PV]
    swing : float
        Size of the model's answer. [PV]
    slowness : float
        tau + theta of the model. [s]
    noise_sd : float
        Standard deviation of the readings about the model. [PV]
    """
    facts = data_facts(t, pv)
    # A record without noise, such as a simulated one, shows the lines of rounding.
    compressed = facts.drawn > DRAWN and noise_sd > ROUNDING * swing
    findings = _compression(facts, slowness) if compressed else []
    findings += _rounding(facts, swing, noise_sd)
    findings += _standing(t, pv, predicted, facts.resolution, swing)
    return findings


def _compression(facts: DataFacts, slowness: float) -> list[Finding]:
    part = facts.longest_line / slowness
    verdict = graded(part, LONG_LINE, TOO_LONG_LINE)
    if verdict is Verdict.TRUSTED:
        verdict = Verdict.CARE
    return [
        Finding(
            verdict=verdict,
            reason=f"{facts.drawn:.0%} of the readings of PV lie on straight lines between others, "
            f"as after compression or interpolation, the longest over {facts.longest_line:.3g} s "
            f"against tau + theta = {slowness:.3g} s: the noise is hidden and the stated errors "
            "are too small. Export raw values, with compression off",
        )
    ]


def _rounding(facts: DataFacts, swing: float, noise_sd: float) -> list[Finding]:
    part = facts.resolution / swing
    if not part or facts.resolution < 2 * noise_sd:
        return []  # noise above the resolution averages it out
    verdict = graded(part, COARSE, TOO_COARSE)
    return [
        Finding(
            verdict=verdict,
            reason=f"PV is rounded to {facts.resolution:.3g}, {100 * part:.2g} % of the answer"
            + ("" if verdict is Verdict.TRUSTED else "; make a larger move or log more digits"),
        )
    ]


def _standing(t: Real, pv: Real, predicted: Real, step: float, swing: float) -> list[Finding]:
    """PV at exactly one value while the process must have moved."""
    edges = np.flatnonzero(np.diff((np.diff(pv) == 0).astype(np.int8), prepend=0, append=0))
    worst, where = 0.0, (0.0, 0.0)
    for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if b - a + 1 >= FEWEST_EQUAL:
            moved = float(np.ptp(predicted[a : b + 1])) - 2 * step
            if moved > worst:
                worst, where = moved, (float(t[a]), float(t[b]))
    part = worst / swing
    if part <= STUCK:
        return []
    return [
        Finding(
            verdict=graded(part, STUCK, TOO_STUCK),
            reason=f"PV repeats one value from {where[0]:.4g} s to {where[1]:.4g} s, over which "
            f"the model moves by {100 * part:.2g} % of the answer: a frozen reading, or exception "
            "logging with too wide a dead band",
        )
    ]


def require_one_unit(t: Real, pv: Real) -> None:
    """Refuse a record in which a temperature changes its unit.

    Parameters
    ----------
    t, pv : ndarray, shape (n,)
        Times [s] and readings [PV].

    Raises
    ------
    FitNotTrusted
        PV jumps as from one unit to another, by far more than it does otherwise.
    """
    before, after = pv[:-1], pv[1:]
    jumps = np.abs(after - before)
    usual = float(np.median(jumps))
    slack = np.minimum(NEAR * np.maximum(np.abs(before), np.abs(after)) + 6 * usual, jumps / 4)
    large = (jumps > 0.25 * float(np.ptp(pv))) & (jumps > 20 * usual)
    factor, offset = FAHRENHEIT
    for name, off in (
        ("Celsius to kelvin", after - before - KELVIN),
        ("kelvin to Celsius", before - after - KELVIN),
        ("Celsius to Fahrenheit", after - before * factor - offset),
        ("Fahrenheit to Celsius", before - after * factor - offset),
    ):
        seen = (np.abs(off) < slack) & large
        if np.any(seen):
            i = int(np.argmax(seen))
            raise FitNotTrusted(
                f"PV jumps from {pv[i]:.4g} to {pv[i + 1]:.4g} at {t[i + 1]:.4g} s, as from {name}:"
                " the unit changes within the record."
            )


def judge_unit(pv: Real, unit: str) -> list[Finding]:
    """Compare the readings with the unit that the record states.

    Kelvin for Celsius shifts PV and leaves the gain, but shows that nobody checked; a gain in
    Fahrenheit is 1.8 times that in Celsius, which a single record does not tell.

    Parameters
    ----------
    pv : ndarray, shape (n,)
        Readings. [PV]
    unit : str
        Stated unit of PV; empty where unknown.
    """
    low, high, name = float(np.min(pv)), float(np.max(pv)), unit.strip().lower()
    wrong = ""
    if name in CELSIUS_NAMES and low > COLDEST and high < COLDEST + KELVIN:
        wrong = "kelvin"
    elif name in CELSIUS_NAMES and low < -KELVIN:
        wrong = "no temperature"
    elif name in KELVIN_NAMES and low < COLDEST:
        wrong = "Celsius or Fahrenheit"
    if not wrong:
        return []
    return [
        Finding(
            verdict=Verdict.CARE,
            reason=f"PV from {low:.4g} to {high:.4g} is stated in {unit} and looks like {wrong}: "
            "check the unit of the tag before settings are typed, a gain in another unit is wrong "
            "by its factor",
        )
    ]
