"""PID controllers: one canonical form inside, other forms as types that convert at the edge."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Self

import numpy as np

from loop.errors import ConversionRefused
from loop.process import LARGEST, SMALLEST, Polynomial
from loop.signals import Complex

# Practice is 8 to 20; 10 keeps most of the phase lead at a tenth of the gain at high frequency.
DEFAULT_N = 10.0


class Action(StrEnum):
    """Direction in which the output moves when PV rises."""

    REVERSE = "reverse"
    DIRECT = "direct"

    @property
    def sign(self) -> float:
        """+1 for e = sp - pv, -1 for e = pv - sp."""
        return 1.0 if self is Action.REVERSE else -1.0

    @classmethod
    def for_gain(cls, K: float) -> Self:
        """Choose the action that gives negative feedback around a process gain."""
        return cls.REVERSE if K > 0 else cls.DIRECT


def _check_times(**times: float) -> None:
    for name, value in times.items():
        if not 0 <= value <= LARGEST:
            raise ValueError(f"{name} must lie within 0 and {LARGEST:g} s, got {value}")


def _check_gain(name: str, value: float) -> None:
    if not SMALLEST <= value <= LARGEST:
        raise ValueError(
            f"{name} must lie within {SMALLEST:g} and {LARGEST:g}, got {value}; "
            "a negative process gain takes the direct action, not a negative gain"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PID:
    """PID controller in the ISA standard form.

    u = Kc [(b sp - pv) + (1/(Ti s)) (sp - pv) + Td s/(1 + Td s/N) (c sp - pv)] / (tauF s + 1),
    with every sign turned for the direct action.

    Attributes
    ----------
    Kc : float
        Controller gain, positive; `action` carries the sign. [OP/PV]
    Ti : float
        Integral time, infinite for no integral action. [s]
    Td : float
        Derivative time. [s]
    N : float
        Derivative filter ratio, infinite for no filter. The filter time is Td/N. [-]
    b : float
        Set-point weight of the proportional part. [-]
    c : float
        Set-point weight of the derivative part; 0 takes the derivative of PV alone. [-]
    tauF : float
        Lag in series with the whole controller, as some IMC rules ask for. [s]
    action : Action
        Reverse (e = sp - pv) for a positive process gain, direct for a negative one.
    """

    Kc: float
    Ti: float = math.inf
    Td: float = 0.0
    N: float = DEFAULT_N
    b: float = 1.0
    c: float = 0.0
    tauF: float = 0.0
    action: Action = Action.REVERSE

    def __post_init__(self) -> None:
        _check_gain("Kc", self.Kc)
        if not (self.Ti == math.inf or SMALLEST <= self.Ti <= LARGEST):
            raise ValueError(
                f"Ti must be infinite or within {SMALLEST:g} and {LARGEST:g} s, got {self.Ti}"
            )
        _check_times(Td=self.Td, tauF=self.tauF)
        if not self.N > 0:
            raise ValueError(f"N must be positive, got {self.N}")
        for name, weight in (("b", self.b), ("c", self.c)):
            if not 0 <= weight <= 2:
                raise ValueError(f"{name} must lie within 0 and 2, got {weight}")

    @property
    def filter_time(self) -> float:
        """Time constant of the derivative filter, Td/N. [s]"""
        return self.Td / self.N

    @property
    def structure(self) -> str:
        """The terms in use: P, PI, PD or PID."""
        return "P" + ("I" if self.Ti < math.inf else "") + ("D" if self.Td > 0 else "")

    @property
    def numerator(self) -> Polynomial:
        """Coefficients from pv to op, without the action's sign, highest power first."""
        Tf = self.filter_time
        if self.Ti == math.inf:
            return (self.Kc * (self.Td + Tf), self.Kc) if self.Td else (self.Kc,)
        if not self.Td:
            return (self.Kc * self.Ti, self.Kc)
        return (self.Kc * self.Ti * (self.Td + Tf), self.Kc * (self.Ti + Tf), self.Kc)

    @property
    def denominator(self) -> Polynomial:
        """Coefficients from pv to op, highest power first; the lag tauF included."""
        Tf, tauF = self.filter_time, self.tauF
        below: Polynomial = (Tf * tauF, Tf + tauF, 1.0)
        if self.Ti < math.inf:
            below = (*(self.Ti * a for a in below), 0.0)
        first = next(i for i, a in enumerate(below) if a)
        return below[first:]


def controller_response(controller: PID, s: Complex) -> Complex:
    """Evaluate the controller from error to output at s, negative for the direct action.

    Parameters
    ----------
    controller : PID
        Controller settings.
    s : ndarray of complex
        Points of the complex plane. [rad/s]
    """
    n = np.polyval(controller.numerator, s)
    return controller.action.sign * n / np.polyval(controller.denominator, s)


@dataclass(frozen=True, slots=True, kw_only=True)
class ParallelPID:
    """PID controller with independent gains, Kp + Ki/s + Kd s/(Tf s + 1).

    Attributes
    ----------
    Kp : float
        Proportional gain. [OP/PV]
    Ki : float
        Integral gain, 0 for no integral action. [OP/PV/s]
    Kd : float
        Derivative gain. [OP s/PV]
    Tf : float
        Time constant of the derivative filter, 0 for none. [s]
    b, c : float
        Set-point weights of the proportional and the derivative part. [-]
    tauF : float
        Lag in series with the whole controller. [s]
    action : Action
        Reverse (e = sp - pv) for a positive process gain, direct for a negative one.
    """

    Kp: float
    Ki: float = 0.0
    Kd: float = 0.0
    Tf: float = 0.0
    b: float = 1.0
    c: float = 0.0
    tauF: float = 0.0
    action: Action = Action.REVERSE

    def __post_init__(self) -> None:
        if not 0 <= self.Kp <= LARGEST:
            raise ValueError(f"Kp must lie within 0 and {LARGEST:g}, got {self.Kp}")
        for name, gain in (("Ki", self.Ki), ("Kd", self.Kd)):
            if not (gain >= 0 and math.isfinite(gain)):
                raise ValueError(f"{name} must be 0 or positive, got {gain}")
        _check_times(Tf=self.Tf, tauF=self.tauF)

    @classmethod
    def from_isa(cls, pid: PID) -> Self:
        """Convert from the ISA form; always exact."""
        return cls(
            Kp=pid.Kc,
            Ki=pid.Kc / pid.Ti,
            Kd=pid.Kc * pid.Td,
            Tf=pid.filter_time,
            b=pid.b,
            c=pid.c,
            tauF=pid.tauF,
            action=pid.action,
        )

    def to_isa(self) -> PID:
        """Convert to the ISA form.

        Raises
        ------
        ConversionRefused
            There is no proportional part, or a derivative filter without a derivative.
        """
        if self.Kp < SMALLEST:
            raise ConversionRefused("ISA", "without a proportional part Ti and Td are undefined")
        Td = self.Kd / self.Kp
        return PID(
            Kc=self.Kp,
            Ti=self.Kp / self.Ki if self.Ki else math.inf,
            Td=Td,
            N=_filter_ratio(Td, self.Tf),
            b=self.b,
            c=self.c,
            tauF=self.tauF,
            action=self.action,
        )


def _filter_ratio(Td: float, Tf: float) -> float:
    """N = Td/Tf; without a derivative the default, since no filter is in use. [-]"""
    if Td == 0:
        return DEFAULT_N
    return Td / Tf if Tf else math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesPID:
    """PID controller in the series form, Kc (1 + 1/(Ti s)) (Td s + 1)/(alpha Td s + 1).

    Attributes
    ----------
    Kc : float
        Controller gain. [OP/PV]
    Ti : float
        Integral time, infinite for no integral action. [s]
    Td : float
        Derivative time. [s]
    alpha : float
        Filter time over derivative time, 0 for no filter. [-]
    b, c : float
        Set-point weights of the ISA form's proportional and derivative part. [-]
    tauF : float
        Lag in series with the whole controller. [s]
    action : Action
        Reverse (e = sp - pv) for a positive process gain, direct for a negative one.
    """

    Kc: float
    Ti: float = math.inf
    Td: float = 0.0
    alpha: float = 0.1
    b: float = 1.0
    c: float = 0.0
    tauF: float = 0.0
    action: Action = Action.REVERSE

    def __post_init__(self) -> None:
        _check_gain("Kc", self.Kc)
        if not (self.Ti == math.inf or SMALLEST <= self.Ti <= LARGEST):
            raise ValueError(
                f"Ti must be infinite or within {SMALLEST:g} and {LARGEST:g} s, got {self.Ti}"
            )
        _check_times(Td=self.Td, tauF=self.tauF)
        if not 0 <= self.alpha <= 1:
            raise ValueError(f"alpha must lie within 0 and 1, got {self.alpha}")

    def to_isa(self) -> PID:
        """Convert to the ISA form, derivative filter included; exact.

        Ti = Ti' + Td' - Tf, Kc = Kc' Ti/Ti', Td = Ti' Td'/Ti - Tf, N = Td/Tf with Tf = alpha Td'.

        Raises
        ------
        ConversionRefused
            The ISA derivative time would be negative: the filter is too slow.
        """
        Tf = self.alpha * self.Td
        if self.Ti == math.inf:
            Ti, Kc, Td = math.inf, self.Kc, self.Td - Tf
        else:
            Ti = self.Ti + self.Td - Tf
            Kc = self.Kc * Ti / self.Ti
            Td = self.Ti * self.Td / Ti - Tf
        if self.Td > 0 and Td < 0:
            raise ConversionRefused("ISA", f"its Td would be negative ({Td:.4g} s)")
        return PID(
            Kc=Kc,
            Ti=Ti,
            Td=max(Td, 0.0),
            N=_filter_ratio(max(Td, 0.0), Tf),
            b=self.b,
            c=self.c,
            tauF=self.tauF,
            action=self.action,
        )

    @classmethod
    def from_isa(cls, pid: PID) -> Self:
        """Convert from the ISA form, derivative filter included; exact where it exists.

        Raises
        ------
        ConversionRefused
            The zeros are complex: (Ti + Tf)^2 < 4 Ti (Td + Tf), without filter Ti < 4 Td.
        """
        Tf = pid.filter_time
        Kc, Ti, Td = pid.Kc, pid.Ti, pid.Td + Tf
        if Ti < math.inf and pid.Td > 0:
            half, product = (pid.Ti + Tf) / 2, pid.Ti * (pid.Td + Tf)
            square = half * half - product
            if square < -1e-12 * product:  # a double zero may round below nothing
                raise ConversionRefused(
                    "series", f"Ti = {pid.Ti:.4g} s is too short for Td = {pid.Td:.4g} s"
                )
            Ti = half + math.sqrt(max(square, 0.0))
            Td = product / Ti
            Kc = pid.Kc * Ti / pid.Ti
        return cls(
            Kc=Kc,
            Ti=Ti,
            Td=Td,
            alpha=Tf / Td if Td else 0.1,
            b=pid.b,
            c=pid.c,
            tauF=pid.tauF,
            action=pid.action,
        )
