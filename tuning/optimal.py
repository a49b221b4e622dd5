"""Optimal PI and PID settings: the least error area that robustness limits allow.

For each integral and derivative time the largest gain that keeps every limit is found from the
exact frequency response, and the times are searched on grids that close in on the best.
"""

from loop.controller import DEFAULT_N
from loop.process import Process
from tuning.gain_polish import Judge
from tuning.loop_limits import LoopLimits
from tuning.optimal_search import Objective, OptimalSettings, References, Search, Structure
from tuning.plant_set import PlantSet


def optimal(
    process: Process,
    limits: LoopLimits,
    *,
    structure: Structure = "PI",
    objective: Objective = "load",
    N: float = DEFAULT_N,
    references: References = None,
    sample_time: float = 0.0,
) -> OptimalSettings:
    """Minimise the error area of PI or PID settings under limits at the model.

    Parameters
    ----------
    process : Process
        Process model with dead time, or with lag enough to bound the gain.
    limits : LoopLimits
        Ms, Mt, margins and effort to keep.
    structure : "PI" or "PID"
        Terms in use.
    objective : str
        "load": IAE after a load step at the process input. "IE": Ti/Kc, the signed area. "set
        point": IAE after a step at the process output. "trade-off":
        J = .5 (IAE_out/IAE_out* + IAE_in/IAE_in*), * the least of each under the same limits [1]_.
    N : float
        Derivative filter ratio. [-]
    references : tuple of float, optional
        IAE_out* and IAE_in* of the trade-off; by default both are found first. Around an
        integrating process a P controller counts for IAE_out*. [s], [PV s/OP]
    sample_time : float
        Scan time; half of it counts as dead time. [s]

    Raises
    ------
    RuleNotApplicable
        Nothing in the model bounds the gain, or no settings keep the limits.
    ValueError
        There is no such structure or objective, or N or the scan time is out of range.

    References
    ----------
    .. [1] C. Grimholt, S. Skogestad, "Optimal PI-control and verification of the SIMC tuning
       rule", IFAC Proceedings 45-3 (2012) 11-22.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> process = FOPDT(K=1.0, tau=1.0, theta=1.0)
    >>> found = optimal(process, LoopLimits(Ms=1.59), objective="trade-off")
    >>> round(found.pid.Kc, 2), round(found.pid.Ti, 1), round(found.margins.Ms, 2)
    (0.54, 1.1, 1.59)
    """
    search = Search.of(process, limits, structure, N, sample_time)
    speed = search.speed
    plants = PlantSet.of([process], speed, hold=search.hold)
    judge = Judge(plants=(process,), limits=limits, sample_time=sample_time)
    return search.settle(search.best(plants, objective, references), judge, objective)
