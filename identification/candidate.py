"""A structure fitted to a record, with the figures for and against it, and the choice of one."""

from dataclasses import dataclass

import numpy as np

from identification.least_squares import LeastSquaresFit
from identification.quality import Colour, Misfit
from identification.structure_fit import StructureFit
from identification.structures import UNDERDAMPED, Structure
from loop.process import Process
from loop.signals import Real

# A parameter within two standard errors of nothing is not there.
THERE = 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """One structure fitted to the record, with the figures that speak for or against it.

    Attributes
    ----------
    structure : Structure
        Kind of process.
    fit : LeastSquaresFit or StructureFit
        The fit.
    values, standard_errors : ndarray, shape (p,)
        Parameters in the order of `structure.names`; errors widened by the residual's colour.
    covariance : ndarray, shape (p, p)
        Of the parameters, widened likewise.
    free : int
        Parameters fitted in all.
    bic : float
        Bayesian information criterion with the readings counted as often as they are independent,
        less that of the first-order model: negative speaks for this structure. [-]
    misfit : Misfit
        Largest systematic error.
    part : float
        The same against the size of the answer. [-]
    swing : float
        Size of the answer to OP. [PV]
    colour : Colour
        Whiteness of the residual.
    """

    structure: Structure
    fit: LeastSquaresFit | StructureFit
    values: Real
    standard_errors: Real
    covariance: Real
    free: int
    bic: float
    misfit: Misfit
    part: float
    swing: float
    colour: Colour

    @property
    def slowness(self) -> float:
        """Dead time and lags together. [s]"""
        times = [n in ("tau", "tau1", "tau2", "T", "theta") for n in self.structure.names]
        return float(np.sum(self.values[times]))

    @property
    def process(self) -> Process | None:
        """Model; none where a parameter is outside what a process may have."""
        try:
            return self.structure.process(*self.values.tolist())
        except ValueError:
            return None

    @property
    def determined(self) -> bool:
        """Whether every parameter that makes the structure is told from nothing."""
        if self.process is None:
            return False
        sizes: list[bool] = (np.abs(self.values) > THERE * self.standard_errors).tolist()
        named = dict(zip(self.structure.names, sizes, strict=True))
        named.pop("theta")
        if self.structure is UNDERDAMPED:
            return named["T"] and bool(self.values[2] + THERE * self.standard_errors[2] < 1)
        return all(named.values())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Choice:
    """The structure to use, and all that were fitted.

    Attributes
    ----------
    chosen : Candidate
        To use.
    candidates : tuple of Candidate
        All that were fitted, the best by the criterion first.
    reason : str
        Why this one, in words with numbers.
    """

    chosen: Candidate
    candidates: tuple[Candidate, ...]
    reason: str

    @property
    def runner_up(self) -> Candidate | None:
        """Best of the others by the criterion, None where no other was worth a fit."""
        return next((c for c in self.candidates if c is not self.chosen), None)
