"""Processes and controllers as they are typed on a command line."""

import math

import typer

from loop.compensators import Compensator, Lag, Lead, LeadLag, Notch
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
CONTROLLER_HELP = (
    "KC,TI,TD[,N[,TAUF]] (ISA form, seconds; TI and N may be inf), and b=B or c=C, the weights of "
    "the set point, after them."
)
COMPENSATOR_HELP = "Lead:T,ALPHA, Lag:T,BETA, LeadLag:T_LEAD,T_LAG or Notch:W0,ZETA_ZERO,ZETA_POLE."


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


def first_order_from_text(text: str, question: str) -> FOPDT:
    """Read a first-order process with dead time.

    Parameters
    ----------
    text : str
        FOPDT:K,TAU,THETA.
    question : str
        What asks for it, for the sentence of the refusal.

    Raises
    ------
    typer.BadParameter
        The text is no such process.
    """
    process = process_from_text(text)
    if not isinstance(process, FOPDT):
        raise typer.BadParameter(
            f"{question} takes FOPDT:K,TAU,THETA, not {type(process).__name__}"
        )
    return process


def compensator_from_text(text: str) -> Compensator:
    """Read a compensator from `KIND:NUMBERS`.

    Raises
    ------
    typer.BadParameter
        The text is not of that form, or a number is out of its range.

    Examples
    --------
    >>> compensator_from_text("Notch:503,0.05,0.5")
    Notch(w0=503.0, zeta_zero=0.05, zeta_pole=0.5)
    """
    kind, _, rest = text.partition(":")
    try:
        match kind.strip().lower(), _numbers(rest, None):
            case "lead", [T, alpha]:
                return Lead(T=T, alpha=alpha)
            case "lag", [T, beta]:
                return Lag(T=T, beta=beta)
            case "leadlag", [T_lead, T_lag]:
                return LeadLag(T_lead=T_lead, T_lag=T_lag)
            case "notch", [w0, zeta_zero, zeta_pole]:
                return Notch(w0=w0, zeta_zero=zeta_zero, zeta_pole=zeta_pole)
    except ValueError as error:
        raise typer.BadParameter(f"{error}. A compensator is {COMPENSATOR_HELP}") from error
    raise typer.BadParameter(f"there is no compensator {text!r}. One is {COMPENSATOR_HELP}")


def controller_from_text(text: str, process: Process) -> PID:
    """Read controller settings from `KC,TI,TD[,N[,TAUF]]`; the action follows the process.

    Raises
    ------
    typer.BadParameter
        The text is not of that form, or a number is out of its range.

    Examples
    --------
    >>> controller_from_text("0.45,135,13.3,b=0.7", FOPDT(K=2, tau=120, theta=30)).b
    0.7
    """
    parts = text.split(",")
    plain = [part for part in parts if "=" not in part]
    try:
        weights = _weights(parts[len(plain) :])
        values = _settings(",".join(plain))
        Kc, Ti, Td, N, tauF = [*values, *(math.inf, 0.0, 10.0, 0.0)[len(values) - 1 :]]
        own = feedback_action(process)
        return PID(Kc=Kc, Ti=Ti, Td=Td, N=N, tauF=tauF, action=own, **weights)
    except ValueError as error:
        raise typer.BadParameter(f"{error}. A controller is {CONTROLLER_HELP}") from error


def _weights(parts: list[str]) -> dict[str, float]:
    """Set-point weights from `b=0.7` and `c=1`, which stand at the end."""
    weights = {}
    for part in parts:
        name, _, value = part.partition("=")
        if name.strip() not in ("b", "c"):
            raise ValueError(f"only b=B and c=C may follow the numbers, got {part!r}")
        weights[name.strip()] = _numbers(value, 1)[0]
    return weights


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
