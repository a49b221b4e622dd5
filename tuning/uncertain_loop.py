"""A loop around a box of plants: the open loop with intervals in the place of parameters.

Gain and dead time are kept apart as whole intervals, since every bound is exact in them. The
time constants and the frequency are cut into cells; over a cell ln|L| and arg L are enclosed.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self, TypeAlias

import numpy as np
import numpy.typing as npt

from loop.controller import PID
from loop.factors import FactoredLoop
from loop.process import FOPDT, SOPDT, Process, TransferFunction
from loop.signals import Complex, Real

Places: TypeAlias = npt.NDArray[np.intp]
Errors: TypeAlias = tuple[float, float, float] | Mapping[str, float]

# Bounds are moved outwards by this, far above the rounding of some ten operations.
ROUNDING = 1e-12
LARGEST_LOG = 600.0
LARGEST_PULL = 1e3


def error_sizes(process: Process, errors: Errors) -> dict[str, float]:
    """Relative error of each parameter of a process, by the parameter's name. [-]

    Parameters
    ----------
    process : Process
        Process model.
    errors : tuple of float or mapping of str to float
        Errors of (K, tau, theta), or by name; tau stands for every time constant not named. Of a
        TransferFunction tau multiplies all poles' and zeros' time constants alike. [-]

    Raises
    ------
    ValueError
        An error lies outside 0 to below 1, or the process has no such parameter.
    """
    given = dict(zip(("K", "tau", "theta"), errors, strict=True)) if isinstance(
        errors, tuple
    ) else dict(errors)  # fmt: skip
    lags = {"FOPDT": ("tau",), "SOPDT": ("tau1", "tau2"), "TransferFunction": ("tau",)}
    names = ("K", *lags.get(type(process).__name__, ()), "theta")
    unknown = set(given) - {*names, "tau"}
    if unknown:
        raise ValueError(
            f"a {type(process).__name__} has {', '.join(names)}, not {', '.join(sorted(unknown))}"
        )
    sizes = {
        name: float(given.get(name, given.get("tau", 0.0) if name.startswith("tau") else 0.0))
        for name in names
    }
    for name, size in sizes.items():
        if not 0 <= size < 1:
            raise ValueError(f"the error of {name} must lie within 0 and below 1, got {size}")
    return sizes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Enclosure:
    """Where L lies for every point of some cells, each array of shape (n,).

    Attributes
    ----------
    log_low, log_high : ndarray
        Bounds of ln|L| at the model's gain. [-]
    phase_low, phase_high : ndarray
        Bounds of arg L over the whole interval of dead times. [rad]
    late_high : ndarray
        Upper bound of arg L at the longest dead time. [rad]
    w_high : ndarray
        Highest frequency. [rad/s]
    pull : ndarray, shape (n, d)
        How much each side of the cell widens the enclosure. [-]
    """

    log_low: Real
    log_high: Real
    phase_low: Real
    phase_high: Real
    late_high: Real
    w_high: Real
    pull: Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UncertainLoop:
    """L(jw) = k e^(-j theta w) (jw)^-order prod(1 - jw f/z) / prod(1 - jw f/p).

    Attributes
    ----------
    log_k, start : float
        ln|k|, and the phase of k j^-order. [-], [rad]
    order : int
        Poles at the origin above the zeros there.
    roots : ndarray of complex, shape (r,)
        Zeros and poles away from the origin. [rad/s]
    weights : ndarray, shape (r,)
        +1 for a zero, -1 for a pole.
    moved_by : ndarray of int, shape (r,)
        Column of `low`, `high` whose factor f the root is divided by; 0 for none.
    names : tuple of str
        Parameter behind each column, the first "" for none.
    low, high : ndarray, shape (1 + g,)
        Interval of ln f for each column; 0 to 0 in the first.
    gain_low, gain_high : float
        Interval of the factor on K. [-]
    theta_low, theta_high : float
        Interval of the dead time, half the scan time included. [s]
    hold : float
        Half the scan time. [s]
    """

    log_k: float
    start: float
    order: int
    roots: Complex
    weights: Real
    moved_by: Places
    names: tuple[str, ...]
    low: Real
    high: Real
    gain_low: float
    gain_high: float
    theta_low: float
    theta_high: float
    hold: float

    @classmethod
    def of(cls, process: Process, controller: PID, sizes: Mapping[str, float], hold: float) -> Self:
        """Factor the loop and put the intervals in.

        Parameters
        ----------
        process : Process
            The model, middle of the box.
        controller : PID
            Settings as they will run.
        sizes : mapping of str to float
            Error of each parameter, of `error_sizes`. [-]
        hold : float
            Half the scan time. [s]
        """
        loop = FactoredLoop.of(process, controller, delay=hold)
        names = ("", *(name for name in sizes if name not in ("K", "theta")))
        moved = [sizes[name] for name in names[1:]]
        roots = np.concatenate([loop.zeros, loop.poles])
        weights = np.concatenate([np.ones(loop.zeros.size), -np.ones(loop.poles.size)])
        n, first_pole = len(process.numerator) - 1, loop.zeros.size
        moved_by = np.zeros(roots.size, dtype=np.intp)
        match process:
            case FOPDT():
                moved_by[first_pole] = 1
            case SOPDT():
                moved_by[first_pole : first_pole + 2] = (1, 2)
            case TransferFunction():
                moved_by[:n] = 1
                moved_by[first_pole : first_pole + len(process.denominator) - 1] = 1
        away = roots != 0
        sign, log_k = loop.origin
        order = loop.integrators
        return cls(
            log_k=log_k,
            start=(0.0 if sign > 0 else -math.pi) - 0.5 * math.pi * order,
            order=order,
            roots=roots[away],
            weights=weights[away],
            moved_by=moved_by[away],
            names=names,
            low=np.log([1.0, *(1 - e for e in moved)]),
            high=np.log([1.0, *(1 + e for e in moved)]),
            gain_low=1 - sizes["K"],
            gain_high=1 + sizes["K"],
            theta_low=process.theta * (1 - sizes["theta"]) + hold,
            theta_high=process.theta * (1 + sizes["theta"]) + hold,
            hold=hold,
        )

    @property
    def excess(self) -> int:
        """Number of poles above the number of zeros."""
        return self.order - int(self.weights.sum())

    @property
    def asymptote(self) -> tuple[float, float]:
        """Logarithm of |L| w^excess for w -> infinity at the model, and how far factors move it."""
        log = self.log_k - float(self.weights @ np.log(np.abs(self.roots)))
        by_factor = [float(self.weights[self.moved_by == g].sum()) for g in range(len(self.names))]
        ends = np.abs(np.stack([self.low, self.high])).max(axis=0)
        return log, float(np.abs(by_factor) @ ends)

    def enclose(self, low: Real, high: Real) -> Enclosure:
        """Enclose L over cells of ln w (column 0) and of ln f (columns 1 to g).

        Two enclosures are intersected: each factor by its own range, and a Taylor polynomial of
        degree 1 in ln w and ln f with the remainder of degree 2, which keeps what leads and lags
        take off each other. With f(u) = ln(1 - j e^u/p): f' = jw/(jw - p), |f''| = w|p|/|jw - p|^2.

        Parameters
        ----------
        low, high : ndarray, shape (n, 1 + g)
            Corners of the cells; equal for points.
        """
        v_low, v_high = low[:, 0], high[:, 0]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        v, dv = middle[:, 0], half[:, 0]
        zero = np.zeros((v.size, 1))
        moved = self.moved_by
        own_middle, own_half = (
            (a[:, :1] + np.concatenate([zero, a[:, 1:]], axis=1)[:, moved])
            for a in (middle, half)
        )  # fmt: skip
        w_low, w_high = np.exp(own_middle - own_half), np.exp(own_middle + own_half)
        natural = self._natural(w_low, w_high)
        near, log_low, log_high, turn_low, turn_high = natural
        w = np.exp(own_middle)
        root = self.roots
        value = np.log(np.maximum(np.abs(1j * w - root) / np.abs(root), 1e-300))
        angle = self.angle(w)
        slope = np.divide(
            1j * w, 1j * w - root, out=np.full(w.shape, np.inf + 0j), where=1j * w != root
        )
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            bend = 0.5 * own_half**2 * np.where(own_half > 0, w_high * np.abs(root) / near**2, 0.0)
        rest = bend.sum(axis=1)
        weighted = slope * self.weights
        columns = len(self.names)
        by_side = np.stack(
            [
                weighted.sum(axis=1) - self.order,
                *(weighted[:, moved == g].sum(axis=1) for g in range(1, columns)),
            ],
            axis=1,
        )
        plain = self.log_k - self.order * v
        centre = plain + value @ self.weights
        with np.errstate(invalid="ignore"):
            spread = (np.abs(by_side.real) * half).sum(axis=1) + rest
        own = plain[:, None] + np.stack(
            [
                log_low @ np.maximum(self.weights, 0) + log_high @ np.minimum(self.weights, 0),
                log_high @ np.maximum(self.weights, 0) + log_low @ np.minimum(self.weights, 0),
            ],
            axis=1,
        )  # fmt: skip
        own[:, 0] -= abs(self.order) * dv
        own[:, 1] += abs(self.order) * dv
        turned = self.start + np.stack(
            [
                turn_low @ np.maximum(self.weights, 0) + turn_high @ np.minimum(self.weights, 0),
                turn_high @ np.maximum(self.weights, 0) + turn_low @ np.minimum(self.weights, 0),
            ],
            axis=1,
        )  # fmt: skip
        level = self.start + angle @ self.weights
        w0, w1, w2 = np.exp(v), np.exp(v_low), np.exp(v_high)

        def phase(theta: float, way: float) -> Real:
            """Bound of the phase at one dead time, from below (way -1) or from above (1)."""
            with np.errstate(invalid="ignore"):
                side = np.abs(by_side.imag)
                side[:, 0] = np.abs(by_side[:, 0].imag - theta * w0)
                taylor = (side * half).sum(axis=1) + rest + 0.5 * theta * w2 * dv**2
            straight = level - theta * w0 + way * taylor
            ranges = turned[:, 0] - theta * w2 if way < 0 else turned[:, 1] - theta * w1
            best = np.fmax(straight, ranges) if way < 0 else np.fmin(straight, ranges)
            return np.asarray(best + way * ROUNDING * (1 + theta * w2))

        pull = np.abs(by_side)
        pull[:, 0] += self.theta_high * w0
        pull = np.where(np.isfinite(pull), pull, LARGEST_PULL) * half
        pull[:, 0] += np.minimum(rest, LARGEST_PULL)
        for g in range(1, columns):
            pull[:, g] += np.minimum(bend[:, moved == g].sum(axis=1), LARGEST_PULL)
        return Enclosure(
            log_low=np.fmax(centre - spread, own[:, 0]) - ROUNDING * (1 + np.abs(plain)),
            log_high=np.fmin(centre + spread, own[:, 1]) + ROUNDING * (1 + np.abs(plain)),
            phase_low=phase(self.theta_high, -1.0),
            phase_high=phase(self.theta_low, 1.0),
            late_high=phase(self.theta_high, 1.0),
            w_high=w2,
            pull=pull,
        )

    def _natural(self, w_low: Real, w_high: Real) -> tuple[Real, Real, Real, Real, Real]:
        """Distance to each root, range of ln|1 - jw/p|, range of its phase."""
        height, width, size = self.roots.imag, np.abs(self.roots.real), np.abs(self.roots)
        near = np.hypot(width, np.clip(height, w_low, w_high) - height)
        far = np.hypot(width, np.maximum(np.abs(w_low - height), np.abs(w_high - height)))
        log_low = np.log(np.maximum(near / size, 1e-300))
        ends = np.stack([self.angle(w_low), self.angle(w_high)])
        return near, log_low, np.log(far / size), ends.min(axis=0), ends.max(axis=0)

    def angle(self, w: Real) -> Real:
        """Phase of 1 - jw/p without jumps, shape (n, r); a root on the axis is left. [rad]"""
        height, width = self.roots.imag, np.abs(self.roots.real)
        turn = np.arctan2(w - height, width) - np.arctan2(-height, width)
        return np.asarray(np.where(self.roots.real > 0, -turn, turn))

    def plant(self, process: Process, gain: float, factors: Real, theta: float) -> Process:
        """The plant of the box with these factors.

        Parameters
        ----------
        process : Process
            The model.
        gain : float
            Factor on K. [-]
        factors : ndarray, shape (1 + g,)
            ln f of each column. [-]
        theta : float
            Dead time, half the scan time included. [s]
        """
        return moved_plant(process, gain, np.exp(factors[1:]), max(theta - self.hold, 0.0))


def moved_plant(process: Process, gain: float, lags: Real, theta: float) -> Process:
    """The process with its gain and its time constants multiplied, and another dead time.

    Parameters
    ----------
    process : Process
        The model.
    gain : float
        Factor on K. [-]
    lags : ndarray, shape (g,)
        Factor on each time constant; of a TransferFunction one for all. [-]
    theta : float
        Dead time. [s]
    """
    match process:
        case FOPDT():
            return FOPDT(K=process.K * gain, tau=process.tau * float(lags[0]), theta=theta)
        case SOPDT():
            taus = sorted((process.tau1 * float(lags[0]), process.tau2 * float(lags[1])))
            return SOPDT(K=process.K * gain, tau1=taus[1], tau2=taus[0], theta=theta)
        case TransferFunction():
            return TransferFunction(
                _scaled(process.numerator, float(lags[0]), gain),
                _scaled(process.denominator, float(lags[0]), 1.0),
                theta,
            )
    return replace(process, K=process.K * gain, theta=theta)


def _scaled(coefficients: tuple[float, ...], f: float, gain: float) -> tuple[float, ...]:
    """Divide the roots away from the origin by f and multiply by a gain."""
    powers = np.arange(len(coefficients) - 1, -1, -1)
    lowest = min(int(p) for p, a in zip(powers, coefficients, strict=True) if a)
    return tuple(float(a) for a in gain * np.asarray(coefficients) * f ** (powers - lowest))
