"""Describing function of a sticking valve, and the limit cycle that it predicts."""

import numpy as np

from loop.signals import Complex, Real


def describing_function(amplitude: Real, *, S: float, J: float) -> Complex:
    """Gain from the output's sine to the first harmonic of the stem's position [1]_.

    N(A) = -(P - jQ)/(pi A), phi = asin((A - S)/A),
    P = A/2 sin 2phi - 2A cos phi - A(pi/2 + phi) + 2(S - J) cos phi,
    Q = -3A/2 + A/2 cos 2phi + 2A sin phi - 2(S - J) sin phi

    `loop.valve.Choudhury` and `Kano` have it for J <= S; for J > S only `Kano`.

    Parameters
    ----------
    amplitude : ndarray, shape (n,)
        Amplitude A of the output, more than S/2. [OP]
    S, J : float
        Dead band plus stick band, and slip jump. [OP]

    Returns
    -------
    ndarray of complex, shape (n,)
        Amplitude ratio and phase shift. [-]

    Raises
    ------
    ValueError
        S or J is negative, or an amplitude does not move the stem.

    References
    ----------
    .. [1] M. A. A. S. Choudhury, N. F. Thornhill and S. L. Shah, "Modelling valve stiction",
       Control Engineering Practice 13 (2005).
    """
    A = np.asarray(amplitude, dtype=np.float64)
    if not (S >= 0 and J >= 0):
        raise ValueError(f"S and J must be 0 or positive, got {S} and {J}")
    if not np.all((A > S / 2) & np.isfinite(A)):
        raise ValueError(f"the stem moves only for amplitudes above S/2 = {S / 2}")
    phi = np.arcsin((A - S) / A)
    sin, cos = np.sin(phi), np.cos(phi)
    P = A / 2 * np.sin(2 * phi) - 2 * A * cos - A * (np.pi / 2 + phi) + 2 * (S - J) * cos
    Q = -1.5 * A + A / 2 * np.cos(2 * phi) + 2 * A * sin - 2 * (S - J) * sin
    return np.asarray(-(P - 1j * Q) / (np.pi * A))
