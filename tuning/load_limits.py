"""What loads ask of a loop: the lowest peak, the crossover, the integrators and resonators."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from loop.compensators import Compensator, compensator_response
from loop.controller import PID
from loop.factors import FactoredLoop
from loop.frequency_curves import frequency_curves
from loop.open_loop import step_response
from loop.process import Process, TransferFunction, rational_response
from tuning.performance_limits import Bound, performance_limits

POINTS = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class LowestPeak:
    """The peak that no controller can pass below.

    Attributes
    ----------
    peak : float
        Deviation of PV that a load step makes before any correction can arrive. [PV]
    open_loop : float
        Deviation that it would end with without control; infinite if it never ends. [PV]
    allowed : float or None
        Deviation that may happen. [PV]
    possible : bool or None
        Whether the allowed deviation can be kept; None where none was stated.
    sentence : str
        The answer in words.
    """

    peak: float
    open_loop: float
    allowed: float | None
    possible: bool | None
    sentence: str


def lowest_peak(process: Process, load: float, *, allowed: float | None = None) -> LowestPeak:
    """Find the least peak any controller, linear or not, can reach for a load step.

    PV tells of the load no sooner than it moves, and a correction arrives theta later: until then
    PV follows the open-loop response. For a lag that is K d (1 - e^(-theta/tau)).

    Parameters
    ----------
    process : Process
        Process model.
    load : float
        Size of the load step at the process input. [OP]
    allowed : float, optional
        Deviation of PV that may happen. [PV]

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> round(lowest_peak(FOPDT(K=2, tau=120, theta=30), 10).peak, 2)
    4.42
    """
    if not math.isfinite(load):
        raise ValueError(f"the load must be finite, got {load}")
    if allowed is not None and not (allowed > 0 and math.isfinite(allowed)):
        raise ValueError(f"the allowed deviation must be positive, got {allowed}")
    moving = TransferFunction(process.numerator, process.denominator)
    peak = 0.0
    if process.theta:
        t = np.linspace(0.0, process.theta, POINTS)
        peak = abs(load) * float(np.max(np.abs(step_response(moving, t))))
    last = process.denominator[-1]
    final = abs(load * process.numerator[-1] / last) if last else math.inf
    sentence = (
        f"A load of {abs(load):.4g} moves PV by at least {peak:.4g} with any controller: the "
        f"correction arrives {process.theta:.4g} s after PV has moved."
    )
    possible = None if allowed is None else peak <= allowed
    if allowed is not None:
        verdict = "can be kept" if possible else "cannot be kept by feedback"
        sentence += f" The allowed {allowed:.4g} {verdict}."
    return LowestPeak(
        peak=peak, open_loop=final, allowed=allowed, possible=possible, sentence=sentence
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossoverWindow:
    """Between which crossovers the loop has to work.

    Attributes
    ----------
    low : float
        Crossover that the disturbance asks for, 0 for none. [rad/s]
    high : float
        Crossover that process and unmodelled dynamics allow, infinite for any. [rad/s]
    possible : bool
        Whether there is room between them.
    sentences : tuple of str
        Where both come from.
    """

    low: float
    high: float
    possible: bool
    sentences: tuple[str, ...]


def crossover_window(
    process: Process,
    *,
    load: float = 0.0,
    frequency: float | None = None,
    allowed: float | None = None,
    unmodelled: float = 0.0,
    spare_phase: float = 15.0,
) -> CrossoverWindow:
    """Hold the crossover against the fastest disturbance and against what the model leaves out.

    A load d sin(w t) at the process input moves PV by |G(jw)| d without control; control has to
    reduce that to `allowed`. Around the crossover L is about wc/s, so that |S| = w/sqrt(w^2 +
    wc^2) and wc = w sqrt((|G| d/allowed)^2 - 1). A lag T that the model leaves out takes
    atan(wc T) from the phase margin.

    Parameters
    ----------
    process : Process
        Process model.
    load : float
        Amplitude of the disturbance at the process input. [OP]
    frequency : float, optional
        Its highest frequency. [rad/s]
    allowed : float, optional
        Amplitude of PV that may be left. [PV]
    unmodelled : float
        Lags and dead times that the model leaves out, together. [s]
    spare_phase : float
        Phase margin to give up for them. [°]
    """
    low, high, said = 0.0, math.inf, []
    if frequency is not None and allowed is not None:
        if not (frequency > 0 and allowed > 0):
            raise ValueError(
                f"frequency and allowed must be positive, got {frequency} and {allowed}"
            )
        alone = abs(load) * float(np.abs(rational_response(process, np.array([1j * frequency]))[0]))
        ratio = alone / allowed
        low = frequency * math.sqrt(max(ratio * ratio - 1, 0.0))
        said.append(
            f"Without control the load of {abs(load):.4g} at {frequency:.4g} rad/s moves PV by "
            f"{alone:.4g}; to leave {allowed:.4g} the crossover must reach about {low:.4g} rad/s."
        )
    if unmodelled:
        if not (unmodelled > 0 and 0 < spare_phase < 90):
            raise ValueError(
                "unmodelled must be positive and spare_phase within 0° and 90°, "
                f"got {unmodelled} and {spare_phase}"
            )
        high = math.tan(math.radians(spare_phase)) / unmodelled
        said.append(
            f"{unmodelled:.4g} s that the model leaves out cost {spare_phase:.4g}° of phase at "
            f"{high:.4g} rad/s."
        )
    for limit in performance_limits(process):
        if limit.bound is Bound.WC_BELOW:
            high = min(high, limit.value)
            said.append(limit.sentence)
        elif limit.bound is Bound.WC_ABOVE:
            low = max(low, limit.value)
            said.append(limit.sentence)
    return CrossoverWindow(low=low, high=high, possible=low <= high, sentences=tuple(said))


class Disturbance(StrEnum):
    """Course of a disturbance."""

    STEP = "step"
    RAMP = "ramp"
    SINUSOID = "sinusoid"


@dataclass(frozen=True, slots=True, kw_only=True)
class DisturbanceAnswer:
    """What is left of a lasting disturbance at the process input, and what would remove it.

    Attributes
    ----------
    left : float
        Deviation of PV that remains; the amplitude for a sinusoid. Infinite where it grows. [PV]
    integrators : int
        Integrators that the controller needs to leave nothing; 0 for a sinusoid. [-]
    resonator : float or None
        Frequency at which the controller needs a resonator to leave nothing. [rad/s]
    sentence : str
        The answer in words.
    """

    left: float
    integrators: int
    resonator: float | None
    sentence: str


def disturbance_answer(
    process: Process,
    controller: PID,
    course: Disturbance,
    size: float,
    *,
    frequency: float | None = None,
    compensators: Sequence[Compensator] = (),
) -> DisturbanceAnswer:
    """Say what a stable loop leaves of a lasting load at the process input.

    A load is removed for good only by a controller that contains its course: one integrator for a
    step, two for a ramp, a resonator s/(s^2 + w^2) for a sinusoid; integrators of the process do
    not count, since the load enters in front of them. A PID leaves size Ti/Kc of a ramp.

    Parameters
    ----------
    process : Process
        Process model; the loop around it has to be stable.
    controller : PID
        Controller settings.
    course : Disturbance
        Step, ramp or sinusoid.
    size : float
        Height [OP], slope [OP/s] or amplitude [OP].
    frequency : float, optional
        Frequency of a sinusoid. [rad/s]
    compensators : sequence of Compensator
        Compensators in series with the controller.
    """
    if not math.isfinite(size):
        raise ValueError(f"the size of the disturbance must be finite, got {size}")
    integrates = controller.Ti < math.inf
    if course is Disturbance.SINUSOID:
        if frequency is None or not (frequency > 0 and math.isfinite(frequency)):
            raise ValueError(f"a sinusoid needs a positive frequency, got {frequency}")
        left = abs(size) * _load_gain(process, controller, frequency, compensators)
        return DisturbanceAnswer(
            left=left,
            integrators=0,
            resonator=frequency,
            sentence=f"Of a load with amplitude {abs(size):.4g} at {frequency:.4g} rad/s an "
            f"amplitude of {left:.4g} stays in PV. Only a resonator at that frequency in the "
            "controller, or feed-forward, removes it.",
        )
    needed = 1 if course is Disturbance.STEP else 2
    if course is Disturbance.STEP:
        left = (
            0.0 if integrates else abs(size) * _static_load_gain(process, controller, compensators)
        )
        unit = "A load step"
    else:
        gain = controller.Kc * float(
            compensator_response(compensators, np.zeros(1, dtype=complex))[0].real
        )
        left = abs(size) * controller.Ti / gain if size else 0.0
        unit = "A load ramp"
    has = int(integrates)
    if has >= needed:
        tail = "and the controller has it."
    elif math.isfinite(left):
        tail = f"and the controller has {has}: PV stays off by {left:.4g}."
    else:
        tail = f"and the controller has {has}: PV runs away."
    noun = "integrator" if needed == 1 else "integrators"
    return DisturbanceAnswer(
        left=left,
        integrators=needed,
        resonator=None,
        sentence=f"{unit} takes {needed} {noun} in the controller to vanish, {tail}",
    )


def _load_gain(
    process: Process, controller: PID, w: float, compensators: Sequence[Compensator]
) -> float:
    at = np.array([w])
    curves = frequency_curves(process, controller, compensators=compensators, w=at)
    return float(np.abs(curves.GS[0]))


def _static_load_gain(
    process: Process, controller: PID, compensators: Sequence[Compensator]
) -> float:
    """|G/(1 + G C)| far below every corner. [PV/OP]"""
    loop = FactoredLoop.of(process, controller)
    corners = np.abs(np.concatenate([loop.poles, loop.zeros]))
    low = float(np.min(corners[corners > 0], initial=1 / max(loop.theta, 1.0)))
    return _load_gain(process, controller, 1e-8 * low, compensators)
