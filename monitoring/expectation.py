"""What model and settings lead to expect of a set-point move, the model's doubt included."""

import numpy as np

from loop.controller import PID
from loop.digital_pid import OutputLimits
from loop.process import Process, static_gain
from loop.process_variation import varied
from loop.signals import Real
from loop.simulation import simulate
from monitoring.known_loop import KnownLoop, lags

MOST_SCANS = 1500
FEWEST_SAMPLES = 10
# A response that ends below this part of the move has not begun.
UNANSWERED = 0.01


class Expectation:
    """Responses to a unit step of the model and of those around it, at the recorded instants.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Instants from the move on. [s]
    settled : int
        Samples after which every response has settled.
    length : int
        Half as many again, so that what goes on swinging is seen.

    Raises
    ------
    LoopDiverged
        Model and settings make an unstable loop.
    """

    def __init__(self, dt: float, known: KnownLoop, pid: PID, longest: float) -> None:
        self.dt, self.known, self.pid = dt, known, pid
        self.processes = _around(known)
        # What settles only beyond the record cannot be compared with it.
        horizon = min(_horizon(known.process, pid), longest)
        usual = known.scan_time or min(dt, known.pace / 20 if known.pace else dt)
        self.scan = max(usual, horizon / MOST_SCANS)
        t = np.arange(int(horizon / dt) + 1) * dt
        self.t = t
        runs = [self._run(process, 1.0, horizon, t, None) for process in self.processes]
        self.settled = max(_last_outside(pv, pv[-1]) for pv, _ in runs)
        self.length = int(np.clip(1.5 * self.settled + 2, FEWEST_SAMPLES, t.size))
        self.runs = [(pv[: self.length], op[: self.length]) for pv, op in runs]

    def of(self, size: float, op0: float, length: int) -> list[tuple[Real, Real]]:
        """PV and OP as deviations; only where the output meets a limit each is run anew."""
        limits = self.known.limits
        scaled = [(size * pv[:length], op0 + size * op[:length]) for pv, op in self.runs]
        free = np.isinf(limits.rate) and all(
            op.min() >= limits.low and op.max() <= limits.high for _, op in scaled
        )
        if free or not limits.low <= op0 <= limits.high:
            return scaled
        t = self.t[:length]
        return [self._run(process, size, float(t[-1]), t, op0) for process in self.processes]

    def _run(
        self, process: Process, size: float, horizon: float, t: Real, op0: float | None
    ) -> tuple[Real, Real]:
        run = simulate(
            process,
            self.pid,
            t_end=max(horizon, 2 * self.scan),
            dt=self.scan,
            sp=size,
            op0=0.0 if op0 is None else op0,
            limits=OutputLimits() if op0 is None else self.known.limits,
        )
        held = np.minimum(np.searchsorted(run.t, t * (1 + 1e-12), side="right") - 1, run.t.size - 1)
        return np.interp(t, run.t, run.pv), run.op[held]


def _around(known: KnownLoop) -> list[Process]:
    """The model first, then each parameter off by the uncertainty, one at a time."""
    u = known.uncertainty
    factors = [1 - u, 1 + u] if u > 0 else []
    names = ["K"]
    if lags(known.process) > 0:
        names.append("lag")
    if known.process.theta > 0:
        names.append("theta")
    return [
        known.process,
        *(varied(known.process, **{name: f}) for name in names for f in factors),
    ]


def _horizon(process: Process, pid: PID) -> float:
    """Long enough for the loop to settle. [s]"""
    gain = abs(static_gain(process))
    Ti = pid.Ti if np.isfinite(pid.Ti) else 0.0
    tail = Ti / (pid.Kc * gain) if np.isfinite(gain) else 0.0
    slope = abs(process.numerator[-1] / process.denominator[-2]) if not np.isfinite(gain) else 0.0
    rise = 1 / (pid.Kc * slope) if slope > 0 else 0.0
    return 6 * tail + 6 * rise + 4 * lags(process) + 12 * process.theta + 3 * Ti + 4 * pid.tauF


def _last_outside(pv: Real, end: float) -> int:
    """Samples until PV stays within 2 % of its end; all of them where it does not answer."""
    if abs(end) < UNANSWERED:
        return pv.size
    outside = np.flatnonzero(np.abs(pv - end) > 0.02 * abs(end))
    return int(outside[-1]) + 1 if outside.size else 0
