"""To and from python-control, which has no dead time: it goes out as a Padé approximation."""

from typing import TYPE_CHECKING

import numpy as np

from loop.controller import PID
from loop.process import Process, TransferFunction
from loop.signals import Real

if TYPE_CHECKING:
    import control

# Coefficients of higher orders span more digits than a float has.
HIGHEST_PADE = 12
ROUNDING = 1e-13


def from_control(
    system: "control.TransferFunction | control.StateSpace", *, theta: float = 0.0
) -> TransferFunction:
    """Take a continuous single-loop system over from python-control.

    Parameters
    ----------
    system : control.TransferFunction or control.StateSpace
        Continuous system with one input and one output.
    theta : float
        Dead time to add, which python-control cannot carry. [s]

    Raises
    ------
    TypeError
        It is neither a transfer function nor a state-space system.
    ValueError
        The system is discrete, has several inputs or outputs, or is not proper.
    """
    import control

    if not isinstance(system, control.TransferFunction | control.StateSpace):
        raise TypeError(
            f"a transfer function or a state-space system is needed, got {type(system).__name__}"
        )
    if control.isdtime(system, strict=True):
        raise ValueError(
            f"the system is discrete (sample time {system.dt}); a continuous one is needed"
        )
    if not control.issiso(system):
        raise ValueError(
            f"the system has {system.ninputs} inputs and {system.noutputs} outputs; "
            "one of each is needed"
        )
    if isinstance(system, control.StateSpace):
        lost = _relative_degree(system.A, system.B, system.C, system.D)
        rational = control.ss2tf(system)
        numerator, denominator = rational.num[0][0], rational.den[0][0]
        # Rounding leaves ghosts of these coefficients, and each would be a zero far away.
        numerator = np.where(
            np.arange(numerator.size, 0, -1) > denominator.size - lost, 0, numerator
        )
    else:
        numerator, denominator = system.num[0][0], system.den[0][0]
    return TransferFunction(tuple(map(float, numerator)), tuple(map(float, denominator)), theta)


def _relative_degree(A: Real, B: Real, C: Real, D: Real) -> int:
    """How many of D, CB, CAB, CA^2 B ... are zero to rounding before the first that is not."""
    if D.item():
        return 0
    order = int(A.shape[0])
    column, size = B, np.abs(B)
    for degree in range(1, order + 1):
        if abs((C @ column).item()) > ROUNDING * (np.abs(C) @ size).item():
            return degree
        column, size = A @ column, np.abs(A) @ size
    return order


def to_control(process: Process, *, pade_order: int) -> "control.TransferFunction":
    """Hand a process to python-control with its dead time as a Padé approximation.

    Order 1 overstates the gain margin by 27 % on a common loop, order 2 by 0.7 %, order 3 by under
    0.1 %; margins from here never see one.

    Parameters
    ----------
    process : Process
        Process model.
    pade_order : int
        Order of the approximation, 1 to 12. [-]

    Raises
    ------
    ValueError
        The order lies outside 1 to 12.
    """
    import control

    if not 1 <= pade_order <= HIGHEST_PADE:
        raise ValueError(f"pade_order must lie within 1 and {HIGHEST_PADE}, got {pade_order}")
    rational = control.TransferFunction(list(process.numerator), list(process.denominator))
    if not process.theta:
        return rational
    return rational * control.TransferFunction(*control.pade(process.theta, pade_order))


def controller_to_control(controller: PID) -> "control.TransferFunction":
    """Hand a controller to python-control, from control error to output, sign included.

    Parameters
    ----------
    controller : PID
        Controller settings; with N = inf the result is not proper.
    """
    import control

    numerator = controller.action.sign * np.asarray(controller.numerator)
    return control.TransferFunction(list(numerator), list(controller.denominator))
