"""A process model as a short script for other tools, with its numbers in full precision.

A dead time is exact where the tool has one. Where it has none the script says so beside the Padé
approximation, or keeps it as whole samples.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from loop.process import Process
from loop.sampled_process import SampledProcesses, sampled
from loop.signals import Real

PADE_ORDER = 5
SAMPLES_A_LAG = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Script:
    """A script for one tool.

    Attributes
    ----------
    target : str
        Key in `TARGETS`.
    file_name : str
        Name to store it under.
    text : str
        The script.
    """

    target: str
    file_name: str
    text: str


def export_model(process: Process, target: str, *, sample_time: float | None = None) -> Script:
    """Write a process model as a script for another tool.

    Parameters
    ----------
    process : Process
        Process model.
    target : str
        One of `TARGETS`.
    sample_time : float, optional
        Sample time for GEKKO and do-mpc; a twentieth of what matters first if not given. [s]

    Raises
    ------
    ValueError
        There is no such target, or the sample time does not fit the process.
    """
    if target not in TARGETS:
        raise ValueError(f"target must be one of {', '.join(TARGETS)}, got {target}")
    h = _sample_time(process) if sample_time is None else sample_time
    if not (h > 0 and math.isfinite(h)):
        raise ValueError(f"the sample time must be positive, got {h}")
    if process.theta / h > 1000:
        raise ValueError(
            f"the dead time of {process.theta:g} s is {process.theta / h:.4g} samples of {h:g} s; "
            "1000 is the most"
        )
    name, write = TARGETS[target]
    return Script(target=target, file_name=name, text=write(process, h))


def _sample_time(process: Process) -> float:
    """A twentieth of the dead time or of the fastest corner, whichever is longer. [s]"""
    poles = np.abs(np.roots(process.denominator))
    lags = [1 / float(p) for p in poles if p > 0]
    return max([process.theta, *([min(lags)] if lags else [])], default=0.0) / SAMPLES_A_LAG or 1.0


def _listed(values: tuple[float, ...], *, between: str = ", ") -> str:
    return between.join(repr(float(v)) for v in values)


def _matrix(values: Real) -> str:
    rows = ", ".join(f"[{_listed(tuple(row))}]" for row in np.atleast_2d(values))
    return f"[{rows}]"


def _python(process: Process, _: float) -> str:
    answer = "_, y = signal.step((numerator, denominator), T=grid)"
    if len(process.denominator) == 1:
        answer = "y = np.full(grid.shape, numerator[0] / denominator[0])"
    return f'''"""Process n(s)/d(s) e^(-theta s) with its step response; time in s."""

import numpy as np
from scipy import signal

numerator = [{_listed(process.numerator)}]
denominator = [{_listed(process.denominator)}]
theta = {float(process.theta)!r}  # dead time [s], exact


def step_response(t):
    """PV after a unit step of OP at t = 0."""
    moving = np.maximum(np.asarray(t, dtype=float) - theta, 0.0)
    grid = np.linspace(0.0, max(float(np.max(moving)), 1e-9), 20001)
    {answer}
    return np.where(np.asarray(t) < theta, 0.0, np.interp(moving, grid, y))
'''


def _python_control(process: Process, _: float) -> str:
    delay = ""
    if process.theta:
        delay = f"""
# python-control has no dead time: a Padé approximation of order {PADE_ORDER}. Margins from it err.
process = process * control.tf(*control.pade(theta, {PADE_ORDER}))
"""
    return f'''"""Process for python-control; time in s."""

import control

numerator = [{_listed(process.numerator)}]
denominator = [{_listed(process.denominator)}]
theta = {float(process.theta)!r}  # dead time [s]
process = control.tf(numerator, denominator)
{delay}'''


def _matlab(process: Process, _: float) -> str:
    delay = ""
    if process.theta:
        delay = f"""if exist('OCTAVE_VERSION', 'builtin')
  % Octave has no dead time: a Pade approximation of order {PADE_ORDER}. Margins from it err.
  [top, bottom] = padecoef(theta, {PADE_ORDER});
  G = G * tf(top, bottom);
else
  G.InputDelay = theta;
end
"""
    return f"""% Process for MATLAB and Octave; time in s.
if exist('OCTAVE_VERSION', 'builtin')
  pkg load control
end
numerator = [{_listed(process.numerator, between=" ")}];
denominator = [{_listed(process.denominator, between=" ")}];
theta = {float(process.theta)!r};  % dead time
G = tf(numerator, denominator);
{delay}step(G)
"""


def _julia(process: Process, _: float) -> str:
    delay = " * delay(theta)" if process.theta else ""
    return f"""# Process for ControlSystems.jl; time in s, dead time exact.
using ControlSystems

numerator = [{_listed(process.numerator)}]
denominator = [{_listed(process.denominator)}]
theta = {float(process.theta)!r}
G = tf(numerator, denominator){delay}
y, t = step(G)
"""


def _modelica(process: Process, _: float) -> str:
    top, wire = "", "  connect(op, G.u);"
    if process.theta:
        top = (
            "  Modelica.Blocks.Nonlinear.FixedDelay deadTime(delayTime="
            f'{float(process.theta)!r}) "dead time [s]";\n'
        )
        wire = "  connect(op, deadTime.u);\n  connect(deadTime.y, G.u);"
    return f"""model Process "Process from OP to PV; time in s, dead time exact"
  Modelica.Blocks.Interfaces.RealInput op;
  Modelica.Blocks.Interfaces.RealOutput pv;
{top}  Modelica.Blocks.Continuous.TransferFunction G(
    b={{{_listed(process.numerator)}}},
    a={{{_listed(process.denominator)}}});
equation
{wire}
  connect(G.y, pv);
end Process;
"""


def _discrete(process: Process, h: float) -> tuple[SampledProcesses, int]:
    found = sampled([process], h)
    return found, int(found.q[0])


def _samples_text(process: Process, h: float) -> str:
    found, q = _discrete(process, h)
    return f"""h = {h!r}  # sample time [s]
# x[k+1] = A x[k] + late u[k-q-1] + early u[k-q], y[k] = C x[k] + D u[k-q-1]: exact at the samples.
A = np.array({_matrix(found.Phi[0])})
late = np.array([{_listed(tuple(found.late[0]))}])
early = np.array([{_listed(tuple(found.early[0]))}])
C = np.array([{_listed(tuple(found.C[0]))}])
D = {float(found.D[0])!r}
q = {q}  # whole samples of dead time
"""


def _gekko(process: Process, h: float) -> str:
    return f'''"""Process as a discrete model for GEKKO; time in s, dead time exact."""

import numpy as np
from gekko import GEKKO

{_samples_text(process, h)}
samples = 200
m = GEKKO(remote=False)
op = [m.Param(value=1.0 if k >= 0 else 0.0) for k in range(-q - 1, samples)]
x = [[m.Var(value=0.0) for _ in range(len(early))] for _ in range(samples)]
pv = [m.Var(value=0.0) for _ in range(samples)]
for i in range(len(early)):
    m.Equation(x[0][i] == 0)
for k in range(samples):
    older, newer = op[k], op[k + 1]  # u[k-q-1] and u[k-q]
    m.Equation(pv[k] == sum(C[i] * x[k][i] for i in range(len(early))) + D * older)
    if k + 1 < samples:
        for i in range(len(early)):
            moved = sum(A[i, j] * x[k][j] for j in range(len(early)))
            m.Equation(x[k + 1][i] == moved + late[i] * older + early[i] * newer)
m.options.IMODE = 1
m.options.SOLVER = 1
m.solve(disp=False)
t, y = h * np.arange(samples), np.array([float(value.value[0]) for value in pv])
'''


def _do_mpc(process: Process, h: float) -> str:
    return f'''"""Process as a discrete model for do-mpc; time in s, dead time exact."""

import do_mpc
import numpy as np
from casadi import vertcat

{_samples_text(process, h)}
model = do_mpc.model.Model("discrete")
x = model.set_variable("_x", "x", shape=(len(early), 1))
held = model.set_variable("_x", "held", shape=(q + 1, 1))  # u[k-1] ... u[k-q-1]
u = model.set_variable("_u", "op")
newer = held[q - 1] if q else u
model.set_rhs("x", A @ x + late.reshape(-1, 1) * held[q] + early.reshape(-1, 1) * newer)
model.set_rhs("held", vertcat(u, held[:q]) if q else vertcat(u))
model.set_expression("pv", C.reshape(1, -1) @ x + D * held[q])
model.setup()
'''


TARGETS: Mapping[str, tuple[str, Callable[[Process, float], str]]] = MappingProxyType(
    {
        "python": ("process_model.py", _python),
        "python-control": ("process_control.py", _python_control),
        "matlab": ("process_model.m", _matlab),
        "julia": ("process_model.jl", _julia),
        "gekko": ("process_gekko.py", _gekko),
        "do-mpc": ("process_do_mpc.py", _do_mpc),
        "modelica": ("Process.mo", _modelica),
    }
)
