"""The plants around a model: each parameter off by up to ±50 % alone, and all of them at once."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from loop.batch import ProcessBatch
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, PureDelay
from loop.signals import Real
from tuning.simc import integrator_with_lag

# Eleven steps and not the two ends alone, so that an interior worst case is seen.
FACTORS: tuple[float, ...] = tuple(k / 10 for k in range(5, 16))
CORNERS = (0.5, 1.5)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sweep:
    """Plants to verify a controller on: the model, one parameter at a time, joint corners.

    Attributes
    ----------
    parameters : tuple of str
        Parameters that are moved, p of them. A dead time of 0 is not among them, since no
        percentage moves it.
    factors : ndarray, shape (n, p)
        Factor on each parameter for each plant: the model first, then `len(FACTORS)` plants for
        each parameter, then 2^p corners. [-]
    plants : ProcessBatch
        The plants, shape (n,).
    corners : int
        Number of corners, the last plants of the batch.
    where : tuple of str
        Each plant in words: "at the model", "with theta x 1.5".
    moved : tuple
        The one parameter that is off and its factor for each plant; (None, 1) at the model and at
        the corners.
    """

    parameters: tuple[str, ...]
    factors: Real
    plants: ProcessBatch
    corners: int
    where: tuple[str, ...]
    moved: tuple[tuple[str | None, float], ...]


def sweep_of(
    process: Process, *, factors: tuple[float, ...] = FACTORS, corners: bool = True
) -> Sweep:
    """Lay out the plants around a model.

    Parameters
    ----------
    process : FOPDT, SOPDT, IPDT, DoubleIntegrator, PureDelay or TransferFunction
        Process model; a transfer function must be K/(s (tau2 s + 1)). [s]
    factors : tuple of float
        Factors of the one-at-a-time sweep. [-]
    corners : bool
        Whether the joint corners are laid out too.

    Raises
    ------
    RuleNotApplicable
        The process is another transfer function.
    ValueError
        A parameter is so close to the limit of models that ±50 % leaves it.
    """
    base, columns, integrators = _parameters(process)
    p = len(columns)
    rows = [np.ones((1, p))]
    for column in range(p):
        single = np.ones((len(factors), p))
        single[:, column] = factors
        rows.append(single)
    if corners:
        rows.append(np.array(list(product(CORNERS, repeat=p))))
    table = np.vstack(rows)
    moved = {name: np.full(len(table), value) for name, value in base.items()}
    for column, name in enumerate(columns.values()):
        moved[name] = moved[name] * table[:, column]
    try:
        plants = ProcessBatch(integrators=np.asarray(integrators), **moved)
    except ValueError as limit:
        raise ValueError(f"±50 % of the model leaves the range of models: {limit}") from limit
    moved_by = [
        [(name, float(f)) for name, f in zip(columns, row, strict=True) if f != 1] for row in table
    ]
    return Sweep(
        parameters=tuple(columns),
        factors=table,
        plants=plants,
        corners=2**p if corners else 0,
        where=tuple(where_of(row) for row in moved_by),
        moved=tuple(row[0] if len(row) == 1 else (None, 1.0) for row in moved_by),
    )


def where_of(moved: list[tuple[str, float]]) -> str:
    """Say which parameters are off by which factors.

    Parameters
    ----------
    moved : list of tuple of str and float
        Parameters with their factors.
    """
    said = ", ".join(f"{name} x {factor:g}" for name, factor in moved)
    return f"with {said}" if said else "at the model"


def _parameters(process: Process) -> tuple[dict[str, float], dict[str, str], int]:
    """Values by field of a batch, the field of each parameter that moves, and the integrators."""
    lags: dict[str, float]
    match process:
        case FOPDT(K=K, tau=tau):
            lags, names, integrators = {"tau1": tau}, {"tau": "tau1"}, 0
        case SOPDT(K=K, tau1=tau1, tau2=tau2):
            lags, integrators = {"tau1": tau1, "tau2": tau2}, 0
            names = {"tau1": "tau1", "tau2": "tau2"}
        case IPDT(K=K):
            lags, names, integrators = {}, {}, 1
        case DoubleIntegrator(K=K):
            lags, names, integrators = {}, {}, 2
        case PureDelay(K=K):
            lags, names, integrators = {}, {}, 0
        case _:
            K, tau = integrator_with_lag(process, "The ±50 % verification")
            lags, names, integrators = {"tau1": tau}, {"tau2": "tau1"}, 1
    values = {"K": K, "tau1": 0.0, "tau2": 0.0, "theta": process.theta} | lags
    columns = {"K": "K"} | names | ({"theta": "theta"} if process.theta else {})
    return values, columns, integrators
