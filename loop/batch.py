"""Many processes and many controllers as arrays, for sweeps and for whole plants at once.

A batch broadcasts like its arrays: a controller of shape () against processes of shape (11, 3)
makes 33 loops. The limits on each number are those of the scalar models.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Self, TypeAlias

import numpy as np
import numpy.typing as npt

from loop.controller import DEFAULT_N, PID
from loop.process import FOPDT, IPDT, LARGEST, SMALLEST, SOPDT, DoubleIntegrator, PureDelay
from loop.signals import Flags, Real

LagProcess: TypeAlias = FOPDT | SOPDT | IPDT | DoubleIntegrator | PureDelay
Counts: TypeAlias = npt.NDArray[np.integer[Any]]


def _require(name: str, values: Real, good: Flags, range_in_words: str) -> None:
    if not good.all():
        raise ValueError(f"{name} must {range_in_words}, got {np.ravel(values[~good])[0]}")


def _within(values: Real, smallest: float = SMALLEST) -> Flags:
    return np.asarray((values >= smallest) & (values <= LARGEST))


def common_shape(*shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Shape that all broadcast to; numpy takes long to find it where they are alike.

    Parameters
    ----------
    *shapes : tuple of int
        Shapes of arrays.

    Raises
    ------
    ValueError
        The shapes do not broadcast.
    """
    different = {shape for shape in shapes if shape}
    return different.pop() if len(different) == 1 else np.broadcast_shapes(*different)


@dataclass(frozen=True, slots=True, eq=False)
class ProcessBatch:
    """Processes K e^(-theta s) / (s^integrators (tau1 s + 1)(tau2 s + 1)) as arrays.

    FOPDT is tau1 = tau, tau2 = 0; IPDT is no lag and one integrator.

    Attributes
    ----------
    K : ndarray of float
        Gain of either sign. [PV/OP per s^integrators]
    tau1, tau2 : ndarray of float
        Time constants, 0 for none. [s]
    integrators : ndarray of int
        Number of integrators, 0, 1 or 2. [-]
    theta : ndarray of float
        Dead time. [s]

    Raises
    ------
    ValueError
        An array holds a number outside its range, or the shapes do not broadcast.
    """

    K: Real
    tau1: Real
    tau2: Real
    integrators: Counts
    theta: Real

    def __post_init__(self) -> None:
        for item in fields(self):
            kind = np.int64 if item.name == "integrators" else np.float64
            given = np.asarray(getattr(self, item.name))
            if kind is np.int64 and not ((given == 0) | (given == 1) | (given == 2)).all():
                raise ValueError("integrators must be 0, 1 or 2")
            object.__setattr__(self, item.name, given.astype(kind))
        limits = f"lie within {SMALLEST:g} and {LARGEST:g}"
        _require("K", self.K, _within(np.abs(self.K)), limits + " in size")
        for name in ("tau1", "tau2", "theta"):
            values = getattr(self, name)
            _require(name, values, (values == 0) | _within(values), f"be 0 or {limits} s")
        _ = self.shape

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch after broadcasting."""
        return common_shape(*(getattr(self, f.name).shape for f in fields(self)))

    @classmethod
    def of(cls, process: LagProcess) -> Self:
        """Hold one process as a batch of shape ().

        Parameters
        ----------
        process : FOPDT, SOPDT, IPDT, DoubleIntegrator or PureDelay
            Process model.

        Raises
        ------
        ValueError
            The process is a general transfer function.
        """
        match process:
            case FOPDT():
                lags, integrators = (process.tau, 0.0), 0
            case SOPDT():
                lags, integrators = (process.tau1, process.tau2), 0
            case IPDT():
                lags, integrators = (0.0, 0.0), 1
            case DoubleIntegrator():
                lags, integrators = (0.0, 0.0), 2
            case PureDelay():
                lags, integrators = (0.0, 0.0), 0
            case _:
                raise ValueError(
                    "a batch holds lags and integrators, not a general transfer function"
                )
        return cls(
            K=np.asarray(process.K),
            tau1=np.asarray(lags[0]),
            tau2=np.asarray(lags[1]),
            integrators=np.asarray(integrators),
            theta=np.asarray(process.theta),
        )

    def take(self, rows: npt.NDArray[np.intp]) -> Self:
        """Pick processes of a batch of shape (n,) by index.

        Parameters
        ----------
        rows : ndarray of int
            Indices; one may repeat.
        """
        columns = (np.broadcast_to(getattr(self, f.name), self.shape)[rows] for f in fields(self))
        return type(self)(*columns)

    def scaled(
        self, *, K: npt.ArrayLike = 1.0, tau: npt.ArrayLike = 1.0, theta: npt.ArrayLike = 1.0
    ) -> Self:
        """Multiply the parameters by factors, as in a +-50 % sweep.

        Parameters
        ----------
        K, tau, theta : array_like
            Factors on the gain, on both lags and on the dead time; they broadcast. [-]
        """
        return type(self)(
            K=self.K * np.asarray(K, dtype=float),
            tau1=self.tau1 * np.asarray(tau, dtype=float),
            tau2=self.tau2 * np.asarray(tau, dtype=float),
            integrators=self.integrators,
            theta=self.theta * np.asarray(theta, dtype=float),
        )


@dataclass(frozen=True, slots=True, eq=False)
class PIDBatch:
    """PID controllers in the ISA form as arrays; set-point weights do not touch the margins.

    Attributes
    ----------
    Kc : ndarray of float
        Controller gain, positive. [OP/PV]
    Ti : ndarray of float
        Integral time, infinite for no integral action. [s]
    Td : ndarray of float
        Derivative time. [s]
    N : ndarray of float
        Derivative filter ratio, infinite for no filter. [-]
    tauF : ndarray of float
        Lag in series with the whole controller. [s]
    sign : ndarray of float
        +1 for reverse action (e = sp - pv), -1 for direct action. [-]

    Raises
    ------
    ValueError
        An array holds a number outside its range, or the shapes do not broadcast.
    """

    Kc: Real
    Ti: Real = field(default_factory=lambda: np.asarray(np.inf))
    Td: Real = field(default_factory=lambda: np.asarray(0.0))
    N: Real = field(default_factory=lambda: np.asarray(DEFAULT_N))
    tauF: Real = field(default_factory=lambda: np.asarray(0.0))
    sign: Real = field(default_factory=lambda: np.asarray(1.0))

    def __post_init__(self) -> None:
        for item in fields(self):
            object.__setattr__(self, item.name, np.asarray(getattr(self, item.name), dtype=float))
        limits = f"lie within {SMALLEST:g} and {LARGEST:g}"
        _require("Kc", self.Kc, _within(self.Kc), limits)
        _require(
            "Ti", self.Ti, (self.Ti == np.inf) | _within(self.Ti), f"be infinite or {limits} s"
        )
        for name in ("Td", "tauF"):
            values = getattr(self, name)
            _require(name, values, _within(values, 0.0), f"lie within 0 and {LARGEST:g} s")
        _require("N", self.N, np.asarray(self.N >= SMALLEST), f"be at least {SMALLEST:g}")
        _require("sign", self.sign, np.abs(self.sign) == 1, "be +1 or -1")
        _ = self.shape

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch after broadcasting."""
        return common_shape(*(getattr(self, f.name).shape for f in fields(self)))

    @classmethod
    def of(cls, pid: PID) -> Self:
        """Hold one controller as a batch of shape ().

        Parameters
        ----------
        pid : PID
            Controller settings.
        """
        return cls(
            Kc=np.asarray(pid.Kc),
            Ti=np.asarray(pid.Ti),
            Td=np.asarray(pid.Td),
            N=np.asarray(pid.N),
            tauF=np.asarray(pid.tauF),
            sign=np.asarray(pid.action.sign),
        )

    @classmethod
    def stacked(cls, pids: Sequence[PID]) -> Self:
        """Hold n controllers as a batch of shape (n, 1), to be met with plants of shape (p,).

        Parameters
        ----------
        pids : sequence of PID
            Controllers' settings.
        """
        rows = [(p.Kc, p.Ti, p.Td, p.N, p.tauF, p.action.sign) for p in pids]
        return cls(*np.array(rows, dtype=float).T[:, :, None])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MarginBatch:
    """Margins of a batch of loops, each array of the batch's shape.

    Where a loop is unstable, `stable` is False, `gain`, `gain_reduction`, `phase` and `delay` are
    0 and `Ms` and `Mt` infinite.

    Attributes
    ----------
    stable : ndarray of bool
        Whether the closed loop is stable.
    gain, gain_reduction : ndarray of float
        Gain margin, and the factor on the gain below which stability is lost. [-]
    phase : ndarray of float
        Phase margin. [°]
    delay : ndarray of float
        Delay margin. [s]
    Ms, Mt : ndarray of float
        Peaks of |1/(1 + L)| and |L/(1 + L)|. [-]
    """

    stable: Flags
    gain: Real
    gain_reduction: Real
    phase: Real
    delay: Real
    Ms: Real
    Mt: Real
