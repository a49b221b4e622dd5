"""Does the model on the sheet still describe the loop? Asked of routine data in automatic."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.stats import chi2

from loop.errors import PoorExcitation
from loop.signals import Real
from monitoring.basis import Basis, Setting, graded, refusal
from monitoring.known_loop import KnownLoop, lags
from monitoring.loop_signals import Stretch
from monitoring.set_point_instruments import (
    Estimate,
    Rows,
    Whitened,
    estimated,
    rows_of,
    statistic,
    whitened,
)

LEVEL = 0.01
# A significant difference below this part changes no tuning.
MATERIAL = 0.15
# With a standard error below it a difference of 50 % would be seen.
SEEN = 0.15
# Beyond this part a difference of 50 % would pass for one that does not matter.
HALF_SEEN = 0.4
# A lag or dead time below this part of both together need not show.
MINOR = 0.25
# A parameter explains alone what chi-squared leaves to chance, and others must do so worse.
EXPLAINED, WORSE = 0.001, 9.0


class ModelVerdict(StrEnum):
    """What the data say of the model."""

    AGREES = "agrees"
    DOES_NOT = "does not agree"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRatio:
    """One parameter as the data see it, over that of the model.

    Attributes
    ----------
    parameter : str
        gain, lag (all time constants together) or dead time.
    ratio, low, high : float
        Estimate over model, all parameters estimated together, and its 95 % interval. [-]
    alone : float
        Estimate over model where only this parameter is taken to be off. [-]
    checked : bool
        A difference of 50 % in this parameter alone would be seen.
    """

    parameter: str
    ratio: float
    low: float
    high: float
    alone: float
    checked: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelMismatch:
    """Whether the model describes the loop.

    Attributes
    ----------
    verdict : ModelVerdict
        Agrees, does not agree, or undecided.
    p_value : float or None
        Chance that the right model's residual correlates so much with what the set point
        drives. [-]
    correlation : float or None
        Largest correlation of the whitened residual with one of the instruments, of either
        sign. [-]
    ratios : tuple of ParameterRatio
        Parameters by a direct re-estimate over those of the model.
    suspect : str or None
        The parameter that is off, where one alone explains the data and the others do not.
    rows : int
        Rows of the thinned record.
    basis : Basis
        What this rests on.
    """

    verdict: ModelVerdict
    p_value: float | None
    correlation: float | None
    ratios: tuple[ParameterRatio, ...]
    suspect: str | None
    rows: int
    basis: Basis


def model_mismatch(stretch: Stretch, known: KnownLoop, *, level: float = LEVEL) -> ModelMismatch:
    r"""Test a model against routine data by what the set point drives (own combination).

    The residual pv - P op holds disturbances alone if the model is right, and those know nothing
    of the set point. With r the output that the set point alone drives in the model's loop,
    z_i = dP/d(ln p_i) r, and both whitened by an autoregression of the residual,

    .. math:: s = Z^T\varepsilon,\qquad s^T (\sigma^2 Z^T Z)^{-1} s \sim \chi^2_k .

    The parameters follow from the instruments Z by the steps of
    `monitoring.set_point_instruments.estimated`.

    Parameters
    ----------
    stretch : Stretch
        Controlled part of a record.
    known : KnownLoop
        Process model; its settings sharpen the test and are not needed.
    level : float
        Share of right models that may be called wrong. [-]
    """
    if not 0 < level < 1:
        raise ValueError(f"level must lie within 0 and 1, got {level}")
    settings: tuple[Setting, ...] = (
        ("level", level),
        ("material difference", MATERIAL),
        ("seen with a standard error below", SEEN),
    )
    try:
        rows = rows_of(stretch, known)
        start = whitened(rows, np.zeros(len(rows.names)))
        together = estimated(rows)
        singles = [estimated(rows, (k,)) for k in range(len(rows.names))]
    except PoorExcitation as reason:
        return ModelMismatch(
            verdict=ModelVerdict.UNDECIDED, p_value=None, correlation=None, ratios=(), suspect=None,
            rows=0, basis=refusal(str(reason), share=stretch.share, settings=settings),
        )  # fmt: skip
    p = float(chi2.sf(start.statistic, len(rows.names)))
    enough = _enough(rows)
    # What the sampling may hide is not seen either.
    checked = (start.alone < SEEN) & (enough < np.log1p(HALF_SEEN))
    verdict, said = _verdict(
        significant=p < level,
        together=together,
        singles=singles,
        enough=enough,
        seen=bool(np.all(checked[_needed(rows, known)])),
    )
    coarse = ("the controller scans between the samples",) if rows.late > 0 else ()
    return ModelMismatch(
        verdict=verdict,
        p_value=p,
        correlation=_correlation(start),
        ratios=_ratios(rows, together, singles, checked.tolist()),
        suspect=_suspect(rows, singles) if verdict is ModelVerdict.DOES_NOT else None,
        rows=rows.count,
        basis=graded(stretch.share, (*coarse, *said), settings=settings),
    )


def _verdict(
    *, significant: bool, together: Estimate, singles: list[Estimate], enough: Real, seen: bool
) -> tuple[ModelVerdict, tuple[str, ...]]:
    """Choose the verdict, and say what is in doubt about it."""
    if significant and _material(together, singles, enough):
        return ModelVerdict.DOES_NOT, ()
    if significant and not _small(together, enough):
        return ModelVerdict.UNDECIDED, ("it differs, but in what and how much is not clear",)
    if not seen:
        few = "the set-point moves are too few or too small beside the disturbances"
        return ModelVerdict.UNDECIDED, (few,)
    less = f"it differs, by less than {MATERIAL:.0%} and what the sampling hides"
    return ModelVerdict.AGREES, (less,) if significant else ()


def _enough(rows: Rows) -> Real:
    """Logarithm beyond which a parameter is off.

    A controller that may scan between the samples moves OP at instants that are not recorded:
    times are known to a sample less a scan at best.
    """
    hidden = {"gain": np.inf, "lag": lags(rows.process), "dead time": rows.process.theta}
    return np.log1p([MATERIAL + rows.hidden / hidden[name] for name in rows.names])


def _material(together: Estimate, singles: list[Estimate], enough: Real) -> bool:
    """A parameter is surely off by enough, or whichever is off is so by enough."""
    size = np.abs(together.logs)
    surely = together.converged and bool(np.any((size > enough) & (size > 2 * together.errors)))
    # One that does not converge explains nothing.
    alone = [abs(one.logs[k]) > enough[k] for k, one in enumerate(singles) if one.converged]
    return surely or all(alone)


def _small(together: Estimate, enough: Real) -> bool:
    """No parameter differs by enough."""
    return together.converged and bool(np.all(np.abs(together.logs) <= enough))


def _needed(rows: Rows, known: KnownLoop) -> list[int]:
    """Parameters that must show before a model can be said to agree."""
    theta = known.process.theta
    shares = {"gain": 1.0, "lag": 1 - theta / known.pace, "dead time": theta / known.pace}
    return [k for k, name in enumerate(rows.names) if shares[name] >= MINOR]


def _suspect(rows: Rows, singles: list[Estimate]) -> str | None:
    """The one parameter that alone explains what all together do; None where it cannot be told."""
    left = [
        statistic(one.whitened.residual, one.whitened.instruments, one.whitened.variance)
        for one in singles
    ]
    order = np.argsort(left)
    best, second = int(order[0]), int(order[1])
    explained = left[best] < chi2.isf(EXPLAINED, len(rows.names) - 1)
    told = left[second] - left[best] > WORSE
    return rows.names[best] if explained and told else None


def _correlation(start: Whitened) -> float:
    """Largest correlation of the residual with an instrument."""
    Z, e = start.instruments, start.residual
    lengths = np.linalg.norm(Z, axis=0) * np.linalg.norm(e)
    found: Real = (Z.T @ e) / np.where(lengths > 0, lengths, 1.0)
    return float(found[np.argmax(np.abs(found))])


def _ratios(
    rows: Rows, together: Estimate, singles: list[Estimate], checked: list[bool]
) -> tuple[ParameterRatio, ...]:
    return tuple(
        ParameterRatio(
            parameter=name,
            ratio=float(np.exp(together.logs[k])),
            low=float(np.exp(together.logs[k] - 1.96 * together.errors[k])),
            high=float(np.exp(min(together.logs[k] + 1.96 * together.errors[k], 50.0))),
            alone=float(np.exp(singles[k].logs[k])),
            checked=checked[k],
        )
        for k, name in enumerate(rows.names)
    )
