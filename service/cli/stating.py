"""Processes and controllers as they are typed on a command line."""

import math

import typer

from loop.controller import PID
from loop.feedback_sign import feedback_action
from loop.process import (
    FOPDT,
    IPDT,
    SOPDT,
    DoubleIntegrator,
    Process,
    PureDelay,
    TransferFunction,
)

PROCESS_HELP = (
    "FOPDT:K,TAU,THETA, SOPDT:K,TAU1,TAU2,THETA, IPDT:K,THETA, DoubleIntegrator:K,THETA, "
    "PureDelay:K,THETA or TF:NUM/DEN,THETA with coefficients such as 1,2/1,3,2 (highest power "
    "first), in seconds."
)
CONTROLLER_HELP = "KC,TI,TD[,N[,TAUF]] (ISA form, seconds; TI and N may be inf)."


def process_from_text(text: str) -> Process:
    """Read a process from `KIND:NUMBERS`.

    Raises
    ------
    typer.BadParameter
        The text is not of that form, or a number is out of its range.

    Examples
    --------
    >>> process_from_text("FOPDT:2,120,30")
    FOPDT(K=2.0, tau=120.0, theta=30.0)
    >>> process_from_text("TF:1/1,3,2,0.5")
    TransferFunction(numerator=(1.0,), denominator=(1.0, 3.0, 2.0), theta=0.5)
    """
    kind, _, rest = text.partition(":")
    try:
        return _process(kind.strip().upper(), rest)
    except ValueError as error:
        raise typer.BadParameter(f"{error}. A process is {PROCESS_HELP}") from error


def _process(kind: str, rest: str) -> Process:
    match kind, rest.split("/"):
        case "FOPDT", [numbers]:
            K, tau, theta = _numbers(numbers, 3)
            return FOPDT(K=K, tau=tau, theta=theta)
        case "SOPDT", [numbers]:
            K, tau1, tau2, theta = _numbers(numbers, 4)
            return SOPDT(K=K, tau1=tau1, tau2=tau2, theta=theta)
        case "IPDT", [numbers]:
            K, theta = _numbers(numbers, 2)
            return IPDT(K=K, theta=theta)
        case "DOUBLEINTEGRATOR", [numbers]:
            K, theta = _numbers(numbers, 2)
            return DoubleIntegrator(K=K, theta=theta)
        case "PUREDELAY", [numbers]:
            K, theta = _numbers(numbers, 2)
            return PureDelay(K=K, theta=theta)
        case "TF", [above, below]:
            *denominator, theta = _numbers(below, None)
            return TransferFunction(tuple(_numbers(above, None)), tuple(denominator), theta)
        case _:
            raise ValueError(f"there is no process {kind}:{rest}")


def controller_from_text(text: str, process: Process) -> PID:
    """Read controller settings from `KC,TI,TD[,N[,TAUF]]`; the action follows the process.

    Raises
    ------
    typer.BadParameter
        The text is not of that form, or a number is out of its range.

    Examples
    --------
    >>> controller_from_text("0.45,135,13.3", FOPDT(K=2, tau=120, theta=30)).Ti
    135.0
    """
    try:
        values = _settings(text)
        Kc, Ti, Td, N, tauF = [*values, *(math.inf, 0.0, 10.0, 0.0)[len(values) - 1 :]]
        return PID(Kc=Kc, Ti=Ti, Td=Td, N=N, tauF=tauF, action=feedback_action(process))
    except ValueError as error:
        raise typer.BadParameter(f"{error}. A controller is {CONTROLLER_HELP}") from error


def _settings(text: str) -> list[float]:
    values = _numbers(text, None)
    if not 1 <= len(values) <= 5:
        raise ValueError(f"1 to 5 numbers are needed, got {len(values)}")
    return values


def _numbers(text: str, count: int | None) -> list[float]:
    parts = text.split(",")
    if count is not None and len(parts) != count:
        raise ValueError(f"{count} numbers are needed, got {len(parts)} in {text!r}")
    try:
        return [float(part) for part in parts]
    except ValueError as error:
        raise ValueError(f"numbers separated by commas are needed, got {text!r}") from error
