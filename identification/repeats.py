"""Repeated tests of one loop: what they say together, which of them does not belong, what drifts.

Each test comes with its own errors, but tests of one loop differ by more than those: valves stick,
feeds change, the gain is not the same at every level. The spread between tests is therefore
estimated and counts in the errors of the pooled model (a random-effects mean).

References
----------
.. [1] R. DerSimonian and N. Laird, "Meta-analysis in clinical trials," Controlled Clinical Trials,
   vol. 7, no. 3, pp. 177-188, 1986. doi:10.1016/0197-2456(86)90046-2 (the moment estimate of the
   spread, from memory)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from identification.identify import Identification
from identification.verdict import Verdict
from loop.errors import FitNotTrusted
from loop.process import FOPDT
from loop.signals import Flags, Real

NAMES = ("K", "tau", "theta")
# A test so many robust standard deviations off the median of the others does not belong: one in
# 2,000 of normal ones.
FAR = 3.5
# Tests agree within this part whatever their errors say: nothing that tuning notices.
SAME = 0.05
MEDIAN_DEVIATION = 0.6745
# With two tests there is no majority to be off from.
FEWEST_FOR_OUTLIERS = 3
# A trend is told from chance at one in a hundred.
TREND = 0.01
# Gains in the ratio of Fahrenheit to Celsius within this part.
FAHRENHEIT, RATIO = 1.8, 0.04


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """A test that does not count, and why."""

    index: int
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Repeats:
    """Several tests of one loop taken together.

    Attributes
    ----------
    process : FOPDT
        Pooled model.
    standard_errors : ndarray, shape (3,)
        Of the pooled K, tau, theta, the spread between tests included. [PV/OP], [s], [s]
    spread : ndarray, shape (3,)
        Standard deviation of K, tau and theta from test to test beyond their own errors.
    used : tuple of int
        Tests that count, by their place in the sequence.
    left_out : tuple of LeftOut
        Tests that do not.
    trends : ndarray, shape (3,), or None
        Change of K, tau and theta per second of calendar time; none without times, with fewer than
        four tests or where no trend is certain.
    notes : tuple of str
        What the tests show together, in words.
    """

    process: FOPDT
    standard_errors: Real
    spread: Real
    used: tuple[int, ...]
    left_out: tuple[LeftOut, ...]
    trends: Real | None
    notes: tuple[str, ...]


def pool(models: Sequence[Identification], *, times: Sequence[float] | None = None) -> Repeats:
    """Take repeated tests of one loop together.

    Refused models and others than first order are left out; so is a test that stands more than 3.5
    robust standard deviations and 5 % off the median of all in K, tau or theta (theta against
    tau + theta). The rest is averaged with weights 1/(error^2 + spread^2), the spread by moments
    [1]_.

    Parameters
    ----------
    models : sequence of Identification
        One for each test, two at least that are no refusals.
    times : sequence of float, optional
        When each test was made. [s]

    Raises
    ------
    FitNotTrusted
        Fewer than two tests carry a first-order model.
    ValueError
        There is not one time for each test.
    """
    if times is not None and len(times) != len(models):
        raise ValueError(f"{len(models)} tests need as many times, got {len(times)}")
    left_out = [
        LeftOut(index=i, reason=reason) for i, m in enumerate(models) if (reason := _unusable(m))
    ]
    gone = {test.index for test in left_out}
    kept = [i for i in range(len(models)) if i not in gone]
    _require_two(len(kept), left_out)
    values, errors = _numbers([models[i] for i in kept])
    off = _outliers(values, errors)
    left_out += [
        LeftOut(index=i, reason=_distance(values, off, k)) for k, i in enumerate(kept) if off[k]
    ]
    used = [i for k, i in enumerate(kept) if not off[k]]
    values, errors = values[~off], errors[~off]
    _require_two(len(used), left_out)
    mean, error, spread = _pooled(values, errors)
    when = None if times is None else np.array([times[i] for i in used])
    trends, found = _trends(values, when)
    return Repeats(
        process=FOPDT(K=float(mean[0]), tau=float(mean[1]), theta=float(max(mean[2], 0.0))),
        standard_errors=error,
        spread=spread,
        used=tuple(used),
        left_out=tuple(sorted(left_out, key=lambda test: test.index)),
        trends=trends,
        notes=(
            f"{len(used)} of {len(models)} tests count",
            *(
                f"{name} {m:.4g} ± {1.96 * e:.2g} (95 %), from test to test ± {s:.2g}"
                for name, m, e, s in zip(NAMES, mean, error, spread, strict=True)
            ),
            *found,
        ),
    )


def _unusable(model: Identification) -> str:
    """Why a test has no say, empty where it has."""
    if model.verdict is Verdict.REFUSED or model.process is None:
        return model.reasons[0]
    if not isinstance(model.process, FOPDT):
        return f"Its model is {model.kind}, not first order."
    return ""


def _require_two(count: int, left_out: list[LeftOut]) -> None:
    if count < 2:
        reasons = " ".join(f"Test {test.index + 1}: {test.reason}" for test in left_out)
        raise FitNotTrusted(
            f"Pooling needs two tests with a first-order model, and {count} is left. {reasons}"
        )


def _numbers(models: list[Identification]) -> tuple[Real, Real]:
    """K, tau, theta of every test and their standard errors, both of shape (tests, 3)."""
    values, errors = [], []
    for model in models:
        p = model.process
        assert isinstance(p, FOPDT)  # noqa: S101 - others are left out before
        assert model.standard_errors is not None  # noqa: S101 - a model has errors
        values.append([p.K, p.tau, p.theta])
        errors.append(model.standard_errors)
    return np.array(values), np.array(errors)


def _outliers(values: Real, errors: Real) -> Flags:
    """Tests far off the median of all."""
    if len(values) < FEWEST_FOR_OUTLIERS:
        return np.zeros(len(values), dtype=np.bool_)
    middle = np.median(values, axis=0)
    distance = np.abs(values - middle)
    scale = np.median(distance, axis=0) / MEDIAN_DEVIATION
    sizes = np.array([abs(middle[0]), middle[1], middle[1] + middle[2]])
    far = distance > FAR * np.maximum(np.hypot(scale, errors), 1e-300)
    return np.asarray(np.any(far & (distance > SAME * sizes), axis=1))


def _distance(values: Real, off: Flags, k: int) -> str:
    """How a test differs from those that count."""
    middle = np.median(values[~off], axis=0)
    ratio = float(values[k, 0] / middle[0])
    text = (
        f"K {values[k, 0]:.4g}, tau {values[k, 1]:.4g} s and theta {values[k, 2]:.3g} s against "
        f"{middle[0]:.4g}, {middle[1]:.4g} s and {middle[2]:.3g} s of the others."
    )
    if abs(ratio / FAHRENHEIT - 1) < RATIO or abs(ratio * FAHRENHEIT - 1) < RATIO:
        text += " The gains stand as Fahrenheit to Celsius: check the units."
    return text


def _pooled(values: Real, errors: Real) -> tuple[Real, Real, Real]:
    """Random-effects mean of each parameter, its standard error and the spread between tests."""
    n = len(values)
    floor = np.maximum(errors, 1e-12 * np.max(np.abs(values), axis=0) + 1e-300)
    weight = 1 / floor**2
    fixed = np.sum(weight * values, axis=0) / np.sum(weight, axis=0)
    excess = np.sum(weight * (values - fixed) ** 2, axis=0) - (n - 1)
    room = np.sum(weight, axis=0) - np.sum(weight**2, axis=0) / np.sum(weight, axis=0)
    between = np.maximum(excess / room, 0.0)
    weight = 1 / (floor**2 + between)
    total = np.sum(weight, axis=0)
    return np.sum(weight * values, axis=0) / total, 1 / np.sqrt(total), np.sqrt(between)


def _trends(values: Real, when: Real | None) -> tuple[Real | None, list[str]]:
    """Slopes over calendar time that chance does not explain, and what they mean."""
    n = len(values)
    if when is None or n < 4 or np.ptp(when) == 0:
        return None, []
    about = when - when.mean()
    power = float(about @ about)
    slopes = about @ (values - values.mean(axis=0)) / power
    left = values - values.mean(axis=0) - np.outer(about, slopes)
    errors = np.sqrt(np.sum(left**2, axis=0) / (n - 2) / power)
    certain = np.abs(slopes) > student.ppf(1 - TREND / 2, n - 2) * errors
    change = slopes * np.ptp(when) / np.maximum(np.abs(values.mean(axis=0)), 1e-300)
    certain &= np.abs(change) > SAME
    days = float(np.ptp(when)) / 86_400
    notes = [
        f"{name} drifts: {100 * part:+.2g} % over {days:.3g} days"
        for name, part, sure in zip(NAMES, change, certain, strict=True)
        if sure
    ]
    return (np.where(certain, slopes, 0.0), notes) if notes else (None, [])


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelEffect:
    """How the gain changes with the size or the level of the tests.

    Attributes
    ----------
    slope : float
        Change of K per OP of mean level. [PV/OP^2]
    slope_error : float
        Its standard error, the spread of the tests about the line included. [PV/OP^2]
    low, high : float
        Gain on the line at the lowest and at the highest mean level. [PV/OP]
    certain : bool
        Whether chance does not explain it and it is more than 5 %.
    sentence : str
        The same in words.
    """

    slope: float
    slope_error: float
    low: float
    high: float
    certain: bool
    sentence: str


def gain_over_level(models: Sequence[Identification]) -> LevelEffect:
    """Say whether the gain depends on where OP stood: a process that is not linear.

    Parameters
    ----------
    models : sequence of Identification
        Tests at several levels, three at least with a first-order model.

    Raises
    ------
    FitNotTrusted
        There are fewer than three, or all at one level.
    """
    kept = [m for m in models if not _unusable(m) and m.steps]
    level = np.array(
        [np.mean([(r.step.op_from + r.step.op_to) / 2 for r in m.steps]) for m in kept]
    )
    if len(kept) < 3 or np.ptp(level) == 0:
        raise FitNotTrusted(
            f"Whether the gain depends on the level of OP takes three tests at different levels, "
            f"and {len(kept)} have a model."
        )
    values, _ = _numbers(kept)
    gain = values[:, 0]
    about = level - level.mean()
    power = float(about @ about)
    slope = float(about @ gain) / power
    left = gain - gain.mean() - slope * about
    error = float(np.sqrt(float(left @ left) / (len(kept) - 2) / power))
    ends = gain.mean() + slope * np.array([about.min(), about.max()])
    change = float(ends[1] / ends[0] - 1)
    certain = abs(change) > SAME and abs(slope) > student.ppf(0.975, len(kept) - 2) * error
    sentence = (
        f"The gain is {ends[0]:.4g} at a mean OP of {level.min():.4g} and {ends[1]:.4g} at "
        f"{level.max():.4g}: {100 * change:+.2g} %"
    )
    sentence += ", the process is not linear." if certain else ", which chance may explain."
    return LevelEffect(
        slope=slope, slope_error=error, low=float(ends[0]), high=float(ends[1]),
        certain=bool(certain), sentence=sentence,
    )  # fmt: skip
