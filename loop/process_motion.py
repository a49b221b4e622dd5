"""Sampled processes scan by scan: in floats for one process, in arrays for many."""

from collections import deque
from collections.abc import Callable
from operator import mul

import numpy as np

from loop.sampled_process import SampledProcesses
from loop.signals import Real


def motion_of_one(plant: SampledProcesses) -> Callable[[float], float]:
    """Start the first process of a plant at rest.

    Parameters
    ----------
    plant : SampledProcesses
        Processes between scans.

    Returns
    -------
    callable
        From the input that holds over the next scan to the output at its end, without the
        input's own jump; the output before the first call is 0.
    """
    if plant.C.shape[1] == 1:
        return _motion_of_first_order(plant)
    if plant.C.shape[1] > 2:
        return _motion_of_any_order(plant)
    a11, a12, a21, a22, late1, late2, early1, early2, c1, c2, D = _two_states(plant)
    waiting = deque([0.0] * int(plant.q[0]))
    x1 = x2 = late = 0.0

    def move(u: float) -> float:
        nonlocal x1, x2, late
        waiting.append(u)
        early = waiting.popleft()
        x1, x2 = (
            a11 * x1 + a12 * x2 + late1 * late + early1 * early,
            a21 * x1 + a22 * x2 + late2 * late + early2 * early,
        )
        late = early
        return c1 * x1 + c2 * x2 + D * early

    return move


def _motion_of_first_order(plant: SampledProcesses) -> Callable[[float], float]:
    parts = (plant.Phi[0, 0], plant.late[0], plant.early[0], plant.C[0], plant.D[:1])
    a, late_weight, early_weight, c, D = (float(v) for v in np.concatenate(parts))
    waiting = deque([0.0] * int(plant.q[0]))
    x = late = 0.0

    def move(u: float) -> float:
        nonlocal x, late
        waiting.append(u)
        early = waiting.popleft()
        x = a * x + late_weight * late + early_weight * early
        late = early
        return c * x + D * early

    return move


def _two_states(plant: SampledProcesses) -> list[float]:
    """Phi row by row, late, early, C and D of the first process."""
    vectors = (plant.Phi[0].ravel(), plant.late[0], plant.early[0], plant.C[0], plant.D[:1])
    return [float(a) for a in np.concatenate(vectors)]


def _motion_of_any_order(plant: SampledProcesses) -> Callable[[float], float]:
    C, D = plant.C[0].tolist(), float(plant.D[0])
    parts = (a[0].tolist() for a in (plant.Phi, plant.late, plant.early))
    rows = list(zip(*parts, strict=True))
    waiting = deque([0.0] * int(plant.q[0]))
    x, late = [0.0] * len(C), 0.0

    def move(u: float) -> float:
        nonlocal x, late
        waiting.append(u)
        early = waiting.popleft()
        x = [sum(map(mul, row, x), a * late + b * early) for row, a, b in rows]
        late = early
        return float(sum(map(mul, C, x), D * late))

    return move


class ManyMotions:
    """Processes on their way; every state is an array of shape (m,)."""

    def __init__(self, plant: SampledProcesses, scans: int) -> None:
        loops = plant.q.size
        states = range(plant.C.shape[1])
        self._C, self._D = plant.C.T.copy(), plant.D if np.any(plant.D) else None
        self._weights = list(zip(plant.late.T.copy(), plant.early.T.copy(), strict=True))
        self._changes_within = [bool(np.any(late)) for late, _ in self._weights]
        # Zeros of Phi are left out.
        self._couplings = [
            [(plant.Phi[:, i, j].copy(), j) for j in states if np.any(plant.Phi[:, i, j])]
            for i in states
        ]
        self._x: list[Real] = [np.zeros(loops) for _ in states]
        self._late: Real = np.zeros(loops)
        # Row k + longest holds the input of scan k, and every loop looks back by its own dead time.
        # Where all look back alike the rows go round in a ring, which stays in the cache: those
        # that wait, the one that arrives and the one that arrived before it.
        self._longest = int(plant.q.max())
        self._alike = bool(np.all(plant.q == self._longest))
        self._inputs = np.zeros((self._longest + (2 if self._alike else scans), loops))
        self._ring = list(self._inputs) if self._alike else []
        self._look_back = (self._longest - plant.q) * loops + np.arange(loops)
        self._k = 0

    def read(self, disturbance: float | Real, out: Real) -> None:
        """Write the outputs before the input moves, disturbance added, to `out`, shape (m,)."""
        np.multiply(self._C[0], self._x[0], out=out)
        for c, x in zip(self._C[1:], self._x[1:], strict=True):
            out += c * x
        if not isinstance(disturbance, float) or disturbance:
            out += disturbance
        if self._D is not None:
            out += self._D * self._late

    def move(self, u: Real, load: float | Real) -> None:
        """Hold the inputs u + load over the next scan."""
        if self._alike:
            held = self._ring[(self._k + self._longest) % len(self._ring)]
            early = self._ring[self._k % len(self._ring)]
        else:
            held = self._inputs[self._k + self._longest]
        if isinstance(load, float) and not load:
            held[:] = u
        else:
            np.add(u, load, out=held)
        if not self._alike:
            early = self._inputs.take(self._look_back + self._k * self._inputs.shape[1])
        self._x = [self._next(i, early) for i in range(len(self._x))]
        self._late, self._k = early, self._k + 1

    def _next(self, i: int, early: Real) -> Real:
        late_weight, early_weight = self._weights[i]
        state: Real = early_weight * early
        if self._changes_within[i]:
            state += late_weight * self._late
        for a, j in self._couplings[i]:
            state += a * self._x[j]
        return state
