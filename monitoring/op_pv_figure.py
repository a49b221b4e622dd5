"""The figure that PV draws over OP, once the delay between them is taken out."""

import numpy as np

from loop.signals import Real
from monitoring.cross_correlation import correlations
from monitoring.spectrum import band_pass

# Harmonics of the cycle are kept up to twice its frequency: beyond, noise widens the figure.
BAND = 2.0
# An ellipse thinner than this correlation leaves has no width that could be told from noise.
LARGEST_CORRELATION = 0.999


def apparent_stiction(op: Real, pv: Real, period: float) -> float | None:
    r"""Width along OP of the ellipse through the filtered OP-PV figure [1]_. [OP]

    PV is shifted to where it correlates best with OP. The ellipse has the second moments of the
    figure, and its chord along OP through the middle is

    .. math:: 2 \sqrt 2\, s_{op} \sqrt{1 - \rho^2}

    which equals 2 m n/sqrt(m^2 sin^2 a + n^2 cos^2 a) for half axes m and n at the angle a.

    Parameters
    ----------
    op, pv : ndarray, shape (n,)
        Output and process variable without gaps. [OP], [PV]
    period : float
        Period of the oscillation. [samples]

    Returns
    -------
    float or None
        None where a signal does not move in the band, or the figure is a line.

    References
    ----------
    .. [1] M. A. A. S. Choudhury, S. L. Shah, N. F. Thornhill and D. S. Shook, "Automatic detection
       and quantification of stiction in control valves", Control Engineering Practice 14 (2006);
       from memory.
    """
    u, y = (band_pass(signal, period, width=BAND) for signal in (op, pv))
    reach = min(round(period / 2), u.size // 3)
    r = correlations(u, y, reach)
    if r is None:
        return None
    lag = int(np.argmax(np.abs(r))) - reach
    if lag >= 0:
        u, y = u[: u.size - lag], y[lag:]
    else:
        u, y = u[-lag:], y[: y.size + lag]
    spread = float(np.std(u) * np.std(y))
    rho = float(np.mean((u - u.mean()) * (y - y.mean())) / spread) if spread > 0 else 1.0
    if abs(rho) > LARGEST_CORRELATION:
        return None
    return float(2 * np.sqrt(2) * np.std(u) * np.sqrt(1 - rho**2))
