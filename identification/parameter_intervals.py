"""How far the parameters of the chosen model may be off."""

import numpy as np
from scipy.stats import t as student

from identification.candidate import Candidate
from identification.least_squares import LeastSquaresFit
from identification.structures import FIRST_ORDER
from loop.signals import Real


def parameter_intervals(chosen: Candidate, rival: LeastSquaresFit | None) -> Real:
    """State 95 % intervals, none of which but those of a gain or a lead goes below 0.

    Where the record does not tell a slow tail from a drift, the answer with the other reading is
    as likely and lies within them.

    Parameters
    ----------
    chosen : Candidate
        Structure to use, with its errors.
    rival : LeastSquaresFit or None
        Fit with the other reading of the tail, if it is as likely.

    Returns
    -------
    ndarray, shape (p, 2)
        In the order of the structure's names.
    """
    width = float(student.ppf(0.975, chosen.fit.freedom)) * chosen.standard_errors
    intervals = np.stack((chosen.values - width, chosen.values + width), axis=1)
    if rival is not None and chosen.structure is FIRST_ORDER:
        other = np.array([rival.K, rival.tau, rival.theta])
        intervals[:, 0] = np.minimum(intervals[:, 0], other)
        intervals[:, 1] = np.maximum(intervals[:, 1], other)
    signed = np.isin(chosen.structure.names, ("K", "lead"))
    intervals[~signed] = np.maximum(intervals[~signed], 0.0)
    return intervals
