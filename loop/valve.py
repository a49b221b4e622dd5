"""Valves that stick: stem position as a function of the controller output and of its past.

All models are in % of the output and shift with it, so that they work on deviations as well. A
valve without friction has position = op. They are rules for samples, not for time: what counts is
the order of the outputs, not the time between them.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Protocol, TypeAlias

import numpy as np

from loop.signals import Flags, Real
from loop.valve_floats import choudhury_of_one, he_of_one, kano_of_one


class Stem(Protocol):
    """Stems of m valves on their way."""

    def step(self, op: Real) -> Real:
        """Take the outputs of one scan, shape (m,); give the positions, shape (m,). [OP]"""
        ...


# From the output of a scan to the position, for one valve on its way. [OP]
OneStem: TypeAlias = Callable[[float], float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Choudhury:
    """Two-parameter model of a sticking valve, by its flow chart [1]_.

    The stem sticks when the output stops or turns. It lets go where |op - position| > (S + J)/2,
    and then follows at op -+ (S - J)/2. Where it sticks again and goes on in the same direction,
    it lets go after J more; for J > S this differs from `Kano` after a reversal.

    Attributes
    ----------
    S : float or ndarray, shape (m,)
        Dead band plus stick band: what a reversing output moves before the stem does. [OP]
    J : float or ndarray, shape (m,)
        Slip jump: how far the stem jumps when it lets go. [OP]

    References
    ----------
    .. [1] M. A. A. S. Choudhury, N. F. Thornhill and S. L. Shah, "Modelling valve stiction",
       Control Engineering Practice 13 (2005).
    """

    S: float | Real
    J: float | Real

    def __post_init__(self) -> None:
        _check_not_negative(S=self.S, J=self.J)

    def stem(self, op: float | Real = 0.0, position: float | Real | None = None) -> Stem:
        """Start at rest with the output at `op`; the stem at `position`, at `op` if not given."""
        return _ChoudhuryStem(self, op, op if position is None else position)

    def one_stem(self, op: float = 0.0, position: float | None = None) -> OneStem:
        """Start one valve at rest, in floats; S and J are numbers."""
        return choudhury_of_one(
            float(self.S), float(self.J), op, op if position is None else position
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Kano:
    """Two-parameter model of a sticking valve with the direction of friction as a state [1]_.

    The stem sticks when the output stops or turns, at op = us. It lets go where the output has
    gone S back from us or J further, and then follows at op - d (S - J)/2, d the direction.

    Attributes
    ----------
    S : float or ndarray, shape (m,)
        Dead band plus stick band: what a reversing output moves before the stem does. [OP]
    J : float or ndarray, shape (m,)
        Slip jump: how far the stem jumps when it lets go. [OP]

    References
    ----------
    .. [1] M. Kano, H. Maruta, H. Kugemoto and K. Shimizu, "Practical model and detection
       algorithm for valve stiction", IFAC Symposium on Dynamics and Control of Process Systems
       (2004).
    """

    S: float | Real
    J: float | Real

    def __post_init__(self) -> None:
        _check_not_negative(S=self.S, J=self.J)

    def stem(self, op: float | Real = 0.0, position: float | Real | None = None) -> Stem:
        """Start at rest with the output at `op`; the stem at `position`, at `op` if not given."""
        return _KanoStem(self, op, op if position is None else position)

    def one_stem(self, op: float = 0.0, position: float | None = None) -> OneStem:
        """Start one valve at rest, in floats; S and J are numbers."""
        return kano_of_one(float(self.S), float(self.J), op, op if position is None else position)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class He:
    """Three-line model of a sticking valve [1]_.

    Where |op - position| > fs the stem jumps to op -+ fd, else it stays. It has no state of
    motion: a steadily moving output makes it move in jumps of fs - fd.

    Attributes
    ----------
    fs : float or ndarray, shape (m,)
        Static friction: residual force that lets the stem go. [OP]
    fd : float or ndarray, shape (m,)
        Kinetic friction: residual force that is left after a jump, at most fs. [OP]

    References
    ----------
    .. [1] Q. P. He, J. Wang, M. Pottmann and S. J. Qin, "A curve fitting method for detecting
       valve stiction in oscillating control loops", Industrial & Engineering Chemistry Research
       46 (2007).
    """

    fs: float | Real
    fd: float | Real

    def __post_init__(self) -> None:
        _check_not_negative(fs=self.fs, fd=self.fd)
        if np.any(np.asarray(self.fd) > np.asarray(self.fs)):
            raise ValueError(
                f"fd must not exceed fs, got fd = {self.fd} and fs = {self.fs}: "
                "kinetic friction is the smaller one"
            )

    def stem(self, op: float | Real = 0.0, position: float | Real | None = None) -> Stem:
        """Start at rest with the output at `op`; the stem at `position`, at `op` if not given."""
        return _HeStem(self.fs, self.fd, op if position is None else position)

    def one_stem(self, op: float = 0.0, position: float | None = None) -> OneStem:
        """Start one valve at rest, in floats; fs and fd are numbers."""
        return he_of_one(float(self.fs), float(self.fd), op if position is None else position)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DeadBand:
    """Backlash: the stem stays until the output has taken up the play, and then follows.

    It is the case J = 0 of `Choudhury` and `Kano` and fs = fd of `He`.

    Attributes
    ----------
    width : float or ndarray, shape (m,)
        What a reversing output moves before the stem does. [OP]
    """

    width: float | Real

    def __post_init__(self) -> None:
        _check_not_negative(width=self.width)

    def stem(self, op: float | Real = 0.0, position: float | Real | None = None) -> Stem:
        """Start at rest with the output at `op`; the stem at `position`, at `op` if not given."""
        half = np.asarray(self.width) / 2
        return _HeStem(half, half, op if position is None else position)

    def one_stem(self, op: float = 0.0, position: float | None = None) -> OneStem:
        """Start one valve at rest, in floats; the width is a number."""
        half = float(self.width) / 2
        return he_of_one(half, half, op if position is None else position)


Valve: TypeAlias = Choudhury | Kano | He | DeadBand


def _check_not_negative(**values: float | Real) -> None:
    for name, value in values.items():
        given = np.asarray(value, dtype=np.float64)
        if given.ndim > 1 or not np.all((given >= 0) & np.isfinite(given)):
            raise ValueError(
                f"{name} must be 0 or positive, one number or one for each valve, got {value}"
            )


def stem_positions(valve: Valve, op: Real, *, position: float | Real | None = None) -> Real:
    """Move valves through whole signals.

    Parameters
    ----------
    valve : Choudhury, Kano, He or DeadBand
        Valve with numbers, or with arrays of shape (m,) for m valves.
    op : ndarray, shape (n,) or (n, m)
        Controller output scan by scan; a signal of shape (n,) drives all m valves. Before the
        first scan it rests at the first value. [OP]
    position : float or ndarray, shape (m,), optional
        Position before the first scan; the first output if not given. [OP]

    Returns
    -------
    ndarray, shape (n,) or (n, m)
        Stem position. [OP]

    Raises
    ------
    ValueError
        The output has gaps or no values, or valves and outputs do not make pairs.
    """
    op = np.asarray(op, dtype=np.float64)
    if op.ndim not in (1, 2) or op.size == 0 or not np.all(np.isfinite(op)):
        raise ValueError(f"op must be a signal without gaps, (n,) or (n, m), got shape {op.shape}")
    sizes = [np.shape(getattr(valve, item.name)) for item in fields(valve)]
    start = op[0] if position is None else np.asarray(position, dtype=np.float64)
    try:
        shape = np.broadcast_shapes(op.shape[1:], start.shape, *sizes)
    except ValueError:
        raise ValueError(
            f"valves of shapes {sizes} and outputs of shape {op.shape} do not make pairs"
        ) from None
    if not shape:
        move = valve.one_stem(float(op[0]), float(start))
        return np.array([move(u) for u in op.tolist()])
    rows = np.broadcast_to(op[:, None] if op.ndim == 1 else op, (op.shape[0], *shape))
    stems = valve.stem(rows[0], np.broadcast_to(start, shape))
    positions = np.empty(rows.shape)
    for k, outputs in enumerate(rows):
        positions[k] = stems.step(outputs)
    return positions


class _ChoudhuryStem:
    """States of the flow chart: stuck, output where it stuck, last output and its direction."""

    def __init__(self, valve: Choudhury, op: float | Real, position: float | Real) -> None:
        S, J = np.asarray(valve.S), np.asarray(valve.J)
        self._J, self._follow, self._let_go = J, (S - J) / 2, (S + J) / 2
        self._op, self._position = np.asarray(op), np.asarray(position)
        self._stuck_at: Real = self._position
        self._stuck: Flags = np.array(True)
        self._way: Real = np.array(0.0)

    def step(self, op: Real) -> Real:
        """Take the outputs of one scan; give the positions."""
        way = np.sign(op - self._op)
        turned = way != self._way
        self._stuck_at = np.where(turned & ~self._stuck, self._op, self._stuck_at)
        onward = np.sign(op - self._stuck_at) * np.sign(self._stuck_at - self._position) > 0
        distance = np.abs(op - np.where(onward & ~turned, self._stuck_at, self._position))
        past = distance > np.where(onward & ~turned, self._J, self._let_go)
        moves = np.where(turned | self._stuck, past & (way != 0), True)
        self._position = np.where(moves, op - way * self._follow, self._position)
        self._stuck, self._op, self._way = ~moves, op, way
        return self._position


class _KanoStem:
    """States of the model: stuck, output where it stuck, direction of friction, last output."""

    def __init__(self, valve: Kano, op: float | Real, position: float | Real) -> None:
        S, J = np.asarray(valve.S), np.asarray(valve.J)
        self._S, self._J, self._follow = S, J, (S - J) / 2
        self._op, self._position = np.asarray(op), np.asarray(position)
        self._direction: Real = np.array(-1.0)
        # Stuck in the middle of its band: S above is as far from the position as J below.
        self._stuck_at: Real = self._position - self._follow
        self._stuck: Flags = np.array(True)
        self._way: Real = np.array(0.0)

    def step(self, op: Real) -> Real:
        """Take the outputs of one scan; give the positions."""
        way = np.sign(op - self._op)
        stops = ~self._stuck & ((way != self._way) | (way == 0))
        self._stuck_at = np.where(stops, self._op, self._stuck_at)
        stuck = self._stuck | stops
        gone = self._direction * (op - self._stuck_at)
        reverses = stuck & (-gone > self._S)
        moves = ~stuck | reverses | (gone > self._J)
        self._direction = np.where(reverses, -self._direction, self._direction)
        self._position = np.where(moves, op - self._direction * self._follow, self._position)
        self._stuck, self._op, self._way = ~moves, op, way
        return self._position


class _HeStem:
    """The position is the only state: the residual force is op - position."""

    def __init__(self, fs: float | Real, fd: float | Real, position: float | Real) -> None:
        self._fs, self._fd, self._position = fs, fd, np.asarray(position)

    def step(self, op: Real) -> Real:
        """Take the outputs of one scan; give the positions."""
        residual = op - self._position
        moved = op - np.sign(residual) * self._fd
        self._position = np.where(np.abs(residual) > self._fs, moved, self._position)
        return self._position
