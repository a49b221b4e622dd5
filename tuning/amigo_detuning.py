"""AMIGO PI with less gain: the integral gain that goes with it.

Source: K. J. Åström and T. Hägglund, Advanced PID Control, ISA, 2006, section 7.5 (from memory).
Two public versions differ in which gain stands inside the test that chooses between the two
branches. Both branches are derived here, and the derivation decides:

- For a small integral gain the loop leaves low frequency along the vertical line Re L =
  K k - K ki (theta + tau). It stays outside the circle of Ms while that is above -alpha,
  alpha = (Ms - 1)/Ms, so that alpha + K k bounds ki: the branch is the straight line through the
  AMIGO settings and (-alpha, 0).
- Where the lag dominates the process is K/(tau s), S is s^2/(s^2 + 2 zeta wn s + wn^2) with the
  peak 1/(2 zeta sqrt(1 - zeta^2)), and that peak is Ms at ki = beta K k^2/tau, beta =
  Ms (Ms + sqrt(Ms^2 - 1))/2: the branch is a parabola. alpha + K k and theta + tau stand in place
  of K k and tau.

The line and the parabola meet where alpha + K k_new = ki K (theta + tau)/(beta (alpha + K k)): with
the gain k of AMIGO inside, the integral gain is continuous in k_new. With k_new inside it would
jump there, by a factor of 2.6 and Ms to 1.77 at theta/tau = .01 (computed).

Range: as AMIGO. Computed, Ms never rises above that of AMIGO itself for theta/tau of .01 to 5. On
an integrator it is 1.53 at 13 % of AMIGO's gain, where the dead time is felt, and below 1.46 from
5 % down.
"""

import math

from loop.controller import PID, Action
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, IPDT
from tuning.amigo import amigo_pi

TITLE = "Detuned AMIGO PI"
DESIGN_MS = 1.4
ALPHA = (DESIGN_MS - 1) / DESIGN_MS
BETA = DESIGN_MS * (DESIGN_MS + math.sqrt(DESIGN_MS**2 - 1)) / 2
# theta/(theta + tau) above which the line alone is followed.
BALANCED = 0.1


def detuned_amigo_pi(process: FOPDT | IPDT, Kc: float) -> PID:
    """Tune an AMIGO PI with a smaller gain than its own [1]_.

    ki_new = ki (alpha + K Kc)/(alpha + K k) for theta/(theta + tau) > 0.1 or
    alpha + K Kc >= ki K (theta + tau)/(beta (alpha + K k)); otherwise
    ki_new = beta (alpha + K Kc)^2/(K (theta + tau)). An integrator is the limit of a long lag:
    ki_new = ki Kc/k, and beta K Kc^2 below Kc = ki/(beta K k).

    Parameters
    ----------
    process : FOPDT or IPDT
        Process model. [s]
    Kc : float
        Gain wanted, up to AMIGO's own. [OP/PV]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the gain is above AMIGO's.
    ValueError
        The gain is not positive.

    References
    ----------
    .. [1] K. J. Åström, T. Hägglund, Advanced PID Control, ISA, 2006 (from memory).

    Examples
    --------
    >>> pid = detuned_amigo_pi(FOPDT(K=2.0, tau=120.0, theta=30.0), 0.2)
    >>> round(pid.Ti, 1)
    75.4
    """
    if not (Kc > 0 and math.isfinite(Kc)):
        raise ValueError(f"Kc must be positive, got {Kc}")
    full = amigo_pi(process)
    if Kc > full.Kc:
        raise RuleNotApplicable(
            TITLE, f"a gain of {Kc:.4g} is above AMIGO's own of {full.Kc:.4g}: it only detunes"
        )
    ki, size = full.Kc / full.Ti, abs(process.K)
    match process:
        case FOPDT(tau=tau, theta=theta):
            alpha, lag, ratio = ALPHA, theta + tau, theta / (theta + tau)
        case _:
            alpha, lag, ratio = 0.0, 1.0, 0.0
    before, now = alpha + size * full.Kc, alpha + size * Kc
    if ratio > BALANCED or now >= ki * size * lag / (BETA * before):
        ki = ki * now / before
    else:
        ki = BETA * now**2 / (size * lag)
    return PID(Kc=Kc, Ti=Kc / ki, action=Action.for_gain(process.K))
