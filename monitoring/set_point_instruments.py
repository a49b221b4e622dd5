"""Parameters of a process in closed loop, by what the set point alone drives.

In closed loop the output answers the disturbances, so that a fit of PV to OP mistakes one for the
other. The set point knows nothing of disturbances: what it drives in a simulated loop is an
instrument, correlated with the output and not with the residual.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from loop.autoregression import ar_least_squares, ar_order
from loop.controller import PID, Action
from loop.errors import LoopDiverged, PoorExcitation
from loop.process import LARGEST, SMALLEST, Process, gain_sign, static_gain
from loop.process_variation import varied
from loop.pulse_transfer import pulse_transfer
from loop.signals import Real
from loop.simulation import simulate
from monitoring.known_loop import KnownLoop, lags
from monitoring.loop_signals import Stretch

# Rows in which the process answers; more would only cost time.
ROWS_OF_PACE = 12
FEWEST_OF_PACE = 2.0
FEWEST_ROWS = 120
MOST_ROWS = 4000
HIGHEST_ORDER = 12
# Central differences of the answers, in the logarithm of a parameter.
DIFFERENCE = 0.02
STEPS = 8
LARGEST_STEP = 0.4
FARTHEST = float(np.log(4.0))
SMALL_STEP = 0.02

FACTORS = {"gain": "K", "lag": "lag", "dead time": "theta"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """A stretch thinned to what the process can follow.

    Attributes
    ----------
    pv, op : ndarray, shape (n,)
        Process variable and output as recorded, about their first value. [PV], [OP]
    driven : ndarray, shape (rows,)
        Output that the set point alone drives in the model's loop. [OP]
    dt : float
        Sample time of the record. [s]
    thinned : int
        Samples a row: their mean stands for them.
    settled : int
        Rows at the start whose past is not known.
    hidden : float
        Time between two samples in which OP may move unseen. [s]
    late : float
        Time by which recorded outputs come late on average, where the controller is known to scan
        between the samples. [s]
    process : Process
        Process model.
    names : tuple of str
        Parameters that the model has.
    """

    pv: Real
    op: Real
    driven: Real
    dt: float
    thinned: int
    settled: int
    hidden: float
    late: float
    process: Process
    names: tuple[str, ...]

    @property
    def count(self) -> int:
        """Rows that are used."""
        return self.pv.size // self.thinned - self.settled

    @property
    def integrating(self) -> bool:
        """Whether the process keeps what it is given; its rows are differences then."""
        return self.process.denominator[-1] == 0

    @property
    def jumps(self) -> bool:
        """Whether PV follows every move of OP at once, after the dead time."""
        return len(self.process.denominator) == 1

    def at(self, logs: Real) -> Process:
        """The process with its parameters multiplied by exp(logs)."""
        factors = {
            FACTORS[name]: float(np.exp(log)) for name, log in zip(self.names, logs, strict=True)
        }
        return varied(self.process, **factors)

    def recorded(self, process: Process) -> Process:
        """The process as recorded outputs see it: they come late, PV does not."""
        return replace(process, theta=max(process.theta - self.late, 0.0))

    def rows(self, signal: Real) -> Real:
        """Means over the samples of a row, the start left out."""
        return self.kept(_means(signal, self.thinned))

    def kept(self, rows: Real) -> Real:
        """Leave the start out, and take differences where the process integrates."""
        rows = rows[self.settled :]
        return np.diff(rows) if self.integrating else rows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Whitened:
    """Residual, and derivatives of the answers by ln p, one column a parameter, all whitened.

    Attributes
    ----------
    residual : ndarray, shape (rows,)
        Residual of the model. [PV]
    instruments : ndarray, shape (rows, k)
        Derivatives of the answer to what the set point drives. [PV]
    regressors : ndarray, shape (rows, k)
        Derivatives of the answer to the recorded output. [PV]
    """

    residual: Real
    instruments: Real
    regressors: Real

    @property
    def variance(self) -> float:
        """Variance of the residual. [PV^2]"""
        return float(self.residual @ self.residual) / max(self.residual.size - 1, 1)

    @property
    def statistic(self) -> float:
        """What `statistic` says of it: chi-squared with k degrees of freedom. [-]"""
        return statistic(self.residual, self.instruments, self.variance)

    @property
    def alone(self) -> Real:
        """Standard error of each ln p with the others known, shape (k,). [-]"""
        Z, X = self.instruments, self.regressors
        with np.errstate(divide="ignore"):
            return np.asarray(
                np.sqrt(self.variance * np.sum(Z**2, axis=0)) / np.abs(np.sum(Z * X, axis=0))
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """Parameters by their instruments.

    Attributes
    ----------
    logs, errors : ndarray, shape (k,)
        Logarithms of estimate over model and their standard errors. [-]
    whitened : Whitened
        Residual and derivatives at the estimate.
    converged : bool
        The last step was small.
    """

    logs: Real
    errors: Real
    whitened: Whitened
    converged: bool


def rows_of(stretch: Stretch, known: KnownLoop) -> Rows:
    """Thin a stretch and simulate what its set point drives.

    Parameters
    ----------
    stretch : Stretch
        Controlled part of a record.
    known : KnownLoop
        Process model; without settings, a calm PI drives the instruments.

    Raises
    ------
    PoorExcitation
        The set point does not move, or the record is too short or too coarse for the model.
    """
    if stretch.sp is None or not np.ptp(stretch.sp) > 0:
        raise PoorExcitation("the set point does not move, and nothing else tells the two apart")
    if not (np.ptp(stretch.pv) > 0 and np.ptp(stretch.op) > 0):
        raise PoorExcitation("PV or OP does not move")
    if known.unstable:
        raise PoorExcitation("the model is unstable by itself")
    if known.pace < FEWEST_OF_PACE * stretch.dt:
        raise PoorExcitation(
            f"the process answers within {known.pace:.3g} s, too fast for samples every "
            f"{stretch.dt:g} s"
        )
    thinned = max(int(known.pace / (ROWS_OF_PACE * stretch.dt)), 1)
    settled = int(np.ceil(4 * known.pace / (thinned * stretch.dt)))
    part = _richest(stretch.sp, (MOST_ROWS + settled) * thinned)
    pv, op, sp = stretch.pv[part], stretch.op[part], stretch.sp[part]
    if pv.size // thinned - settled < FEWEST_ROWS:
        raise PoorExcitation(
            f"{pv.size} samples give {max(pv.size // thinned - settled, 0)} rows, fewer than "
            f"{FEWEST_ROWS}"
        )
    held = ("lag",) if lags(known.process) > 0 else ()
    late = ("dead time",) if known.process.theta > 0 else ()
    return Rows(
        pv=pv - pv[0],
        op=op - op[0],
        driven=_driven(_means(sp - sp[0], thinned), known, thinned * stretch.dt),
        dt=stretch.dt,
        thinned=thinned,
        settled=settled,
        hidden=max(stretch.dt - (known.scan_time or 0.0), 0.0),
        late=0.5 * max(stretch.dt - (known.scan_time or stretch.dt), 0.0),
        process=known.process,
        names=("gain", *held, *late),
    )


def whitened(rows: Rows, logs: Real) -> Whitened:
    """Residual and derivatives at some parameters, behind the filter that whitens the residual."""
    process = rows.at(logs)
    residual = rows.rows(rows.pv - answer(rows.recorded(process), rows.op, rows.dt))
    regressors = [
        rows.rows(column) for column in _derivatives(rows, logs, rows.op, rows.dt, rows.recorded)
    ]
    instruments = [
        rows.kept(column)
        for column in _derivatives(rows, logs, rows.driven, rows.dt * rows.thinned, _as_it_is)
    ]
    if not np.ptp(residual) > 0:
        raise PoorExcitation("the residual does not move")
    order = ar_order(residual, HIGHEST_ORDER)
    a = ar_least_squares(residual, order).a if order else np.zeros(0)
    taps = np.r_[1.0, -a]

    def white(column: Real) -> Real:
        filtered = np.convolve(column, taps)[order : column.size]
        return filtered - float(np.mean(filtered))

    return Whitened(
        residual=white(residual),
        instruments=np.column_stack([white(column) for column in instruments]),
        regressors=np.column_stack([white(column) for column in regressors]),
    )


def estimated(rows: Rows, only: tuple[int, ...] | None = None) -> Estimate:
    """Estimate parameters by Gauss-Newton steps (Z' X) delta = Z' e from those of the model.

    Parameters
    ----------
    rows : Rows
        Thinned record.
    only : tuple of int, optional
        Parameters to move; all if not given.

    Raises
    ------
    PoorExcitation
        The set point drives nothing at the model that tells them apart; further away, the estimate
        has not converged instead.
    """
    moved = list(range(len(rows.names)) if only is None else only)
    logs, errors = np.zeros(len(rows.names)), np.full(len(rows.names), np.inf)
    found = whitened(rows, logs)
    step, errors[moved] = _step(found, moved)
    converged = False
    for _ in range(STEPS):
        logs[moved] = np.clip(logs[moved] + step, -FARTHEST, FARTHEST)
        found = whitened(rows, logs)
        try:
            step, errors[moved] = _step(found, moved)
        except PoorExcitation:
            break
        converged = bool(np.all(np.abs(step) < np.maximum(SMALL_STEP, errors[moved] / 2)))
        if converged:
            break
    if rows.jumps:
        # Samples of a bare delay bound it to one of them.
        late = rows.names.index("dead time")
        errors[late] = np.hypot(errors[late], 0.5 * rows.dt / rows.process.theta)
    return Estimate(logs=logs, errors=errors, whitened=found, converged=converged)


def _step(found: Whitened, moved: list[int]) -> tuple[Real, Real]:
    """Next step, bounded, and the standard errors where it starts."""
    Z, X = found.instruments[:, moved], found.regressors[:, moved]
    half = _solved(Z.T @ X, Z.T)
    errors = np.sqrt(found.variance * np.sum(half**2, axis=1))
    return np.clip(half @ found.residual, -LARGEST_STEP, LARGEST_STEP), errors


def statistic(residual: Real, Z: Real, variance: float) -> float:
    """Project the residual on the instruments: s' (sigma^2 Z'Z)^-1 s with s = Z' e. [-]"""
    q, _ = np.linalg.qr(Z)
    return float(np.sum((q.T @ residual) ** 2) / variance)


def answer(process: Process, op: Real, dt: float) -> Real:
    """Answer of a process at rest to a held output. [PV]"""
    transfer = pulse_transfer(process, dt)
    return np.asarray(lfilter(transfer.b, transfer.a, transfer.delayed(op)))


def _as_it_is(process: Process) -> Process:
    return process


def _derivatives(
    rows: Rows, logs: Real, op: Real, dt: float, seen: Callable[[Process], Process]
) -> list[Real]:
    """Derivatives of the answer by the logarithm of every parameter."""
    found = []
    for k, name in enumerate(rows.names):
        if name == "gain":
            found.append(answer(seen(rows.at(logs)), op, dt))  # linear in the gain
            continue
        h = DIFFERENCE
        if name == "dead time" and rows.jumps:
            # Samples of a bare delay do not tell instants within a scan from each other.
            h = float(np.clip(dt / rows.process.theta, DIFFERENCE, 0.5))
        ways = [
            answer(seen(rows.at(logs + sign * h * np.eye(logs.size)[k])), op, dt)
            for sign in (1.0, -1.0)
        ]
        found.append((ways[0] - ways[1]) / (2 * h))
    return found


def _solved(matrix: Real, right: Real) -> Real:
    """Solve, scaled so that parameters without effect are seen."""
    size = np.sqrt(np.abs(np.diag(matrix)))
    if not np.all(size > 0):
        raise PoorExcitation("the set point does not excite every parameter of the model")
    scaled = matrix / np.outer(size, size)
    if not np.all(np.isfinite(scaled)) or np.linalg.cond(scaled) > 1e8:
        raise PoorExcitation("the set-point moves do not tell the parameters apart")
    return np.asarray(np.linalg.solve(scaled, right / size[:, None]) / size[:, None])


def _means(signal: Real, size: int) -> Real:
    whole = signal.size // size * size
    return np.asarray(signal[:whole].reshape(-1, size).mean(axis=1))


def _richest(sp: Real, length: int) -> slice:
    """Samples in which the set point moves most, not more than asked."""
    if sp.size <= length:
        return slice(0, sp.size)
    moves = np.cumsum(np.r_[0.0, np.diff(sp) ** 2])
    within = moves[length - 1 :] - moves[: moves.size - length + 1]
    first = int(np.argmax(within))
    return slice(first, first + length)


def _driven(sp: Real, known: KnownLoop, dt: float) -> Real:
    """Output that the set point drives in the loop of the model, without disturbances."""
    for pid in (known.controller, _calm(known, dt)):
        if pid is None:
            continue
        try:
            run = simulate(known.process, pid, t_end=(sp.size - 1) * dt, dt=dt, sp=sp)
        except LoopDiverged:
            continue
        if np.ptp(run.op) < 1e6 * np.ptp(sp) * pid.Kc:
            return run.op
    raise PoorExcitation("model and settings make an unstable loop")


def _calm(known: KnownLoop, dt: float) -> PID | None:
    """A PI that a process with one integrator at most bears; None for others."""
    process, time = known.process, max(known.pace, 4 * dt)
    size = abs(static_gain(process))
    if not np.isfinite(size):
        if process.denominator[-2] == 0:
            return None
        size = abs(process.numerator[-1] / process.denominator[-2]) * 4 * time
        time *= 10
    action = Action.for_gain(gain_sign(process))
    return PID(Kc=float(np.clip(0.3 / size, SMALLEST, LARGEST)), Ti=time, action=action)
