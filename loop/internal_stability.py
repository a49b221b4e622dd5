"""Internal stability: no unstable mode may hide behind a cancellation of controller and process."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from loop.compensators import Compensator, in_series
from loop.controller import PID
from loop.factors import polynomial_roots
from loop.process import Process, TransferFunction
from loop.signals import Complex
from loop.stability import unstable_poles

# A zero as close as this to a pole, over its size, cancels it for every purpose but stability.
CANCELS = 1e-6
ON_THE_AXIS = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Cancellation:
    """A pole that a zero hides from the loop.

    Attributes
    ----------
    root : complex
        The pole. [rad/s]
    pole_of : str
        Whose pole it is: process or controller; the other has the zero.
    sentence : str
        What it means.
    """

    root: complex
    pole_of: str
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class InternalStability:
    """Whether all four closed-loop responses S, T, GS and CS are stable.

    Attributes
    ----------
    stable : bool
        No closed-loop pole, hidden or not, lies in the closed right half-plane.
    unstable : int
        Number of closed-loop poles there, hidden ones among them.
    cancellations : tuple of Cancellation
        Hidden poles in the closed right half-plane.
    """

    stable: bool
    unstable: int
    cancellations: tuple[Cancellation, ...]


def internal_stability(
    process: Process,
    controller: PID,
    *,
    compensators: Sequence[Compensator] = (),
) -> InternalStability:
    """Check that every signal in the loop is stable, and name what hides where one is not.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    compensators : sequence of Compensator
        Compensators in series with the controller.
    """
    count = unstable_poles(in_series(process, compensators), controller)
    gain = TransferFunction((1.0,), (1.0,))
    own = in_series(gain, compensators)
    zeros = np.concatenate(
        [polynomial_roots(_trimmed(part)) for part in (controller.numerator, own.numerator)]
    )
    poles = np.concatenate(
        [polynomial_roots(_trimmed(part)) for part in (controller.denominator, own.denominator)]
    )
    found = [
        *_hidden(polynomial_roots(process.denominator), zeros, "process", "controller"),
        *_hidden(poles, polynomial_roots(process.numerator), "controller", "process"),
    ]
    return InternalStability(stable=count == 0, unstable=count, cancellations=tuple(found))


def _trimmed(coefficients: Sequence[float]) -> tuple[float, ...]:
    return tuple(float(c) for c in np.trim_zeros(np.asarray(coefficients), "f"))


def _hidden(poles: Complex, zeros: Complex, of: str, other: str) -> list[Cancellation]:
    found = []
    left = list(zeros)
    for pole in poles:
        size = abs(pole)
        if pole.real < -ON_THE_AXIS * size:
            continue
        near = next((z for z in left if abs(z - pole) <= CANCELS * size), None)
        if near is None:
            continue
        left.remove(near)
        where = "at the origin" if not size else f"at {_written(pole)} rad/s"
        found.append(
            Cancellation(
                root=complex(pole),
                pole_of=of,
                sentence=f"A zero of the {other} hides the {of}'s pole {where}: the loop cannot "
                "see it, and a disturbance or an offset there grows without bound.",
            )
        )
    return found


def _written(pole: complex) -> str:
    if math.isclose(pole.imag, 0.0, abs_tol=1e-12 * abs(pole)):
        return f"{pole.real:.6g}"
    return f"{pole.real:.6g} {'+' if pole.imag > 0 else '-'} {abs(pole.imag):.6g}j"
