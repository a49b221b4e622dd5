"""The dead time of a loop as a transport line: a matrix whose eigenvalues approximate its poles."""

import math

import numpy as np

from loop.factors import FactoredLoop
from loop.signals import Complex, Real


def transport_line_poles(loop: FactoredLoop, nodes: int) -> Complex:
    """Find eigenvalues of the loop with its delay as a transport line at Chebyshev points [1]_.

    They approximate closed-loop poles as far as the points resolve the delay; those beyond are the
    discretisation's own. Start values, not answers.

    Parameters
    ----------
    loop : FactoredLoop
        Open loop with dead time.
    nodes : int
        Chebyshev points along the delay.

    References
    ----------
    .. [1] D. Breda, S. Maset, R. Vermiglio, "Pseudospectral differencing methods for
       characteristic roots of delay differential equations", SIAM J. Sci. Comput. 27 (2005)
       482-495 (from memory).
    """
    theta = loop.theta
    # In units of 1/theta: dx/dt = A x + B z(1), z(0) = -(C x + D z(1)), dz/dt = -dz/dxi.
    d, n = expanded(loop.poles * theta), expanded(loop.zeros * theta)
    gain = loop.sign * math.exp(loop.log_k + loop.excess * math.log(theta))
    order = d.size - 1
    n = np.concatenate([np.zeros(d.size - n.size), gain * n])
    D = _differentiation(nodes)
    total = np.zeros((order + nodes, order + nodes))
    total[:order, :order] = np.eye(order, k=-1)
    direct = n[0]
    C = n[1:] - direct * d[1:]
    if order:
        total[0, :order] = -d[1:]
        total[0, -1] = 1.0
    # Rows of the line; column 0 of D goes with z(0), which the loop closes.
    total[order:, order:] = -D[1:, 1:]
    total[order:, :order] += D[1:, :1] * C[None, :]
    total[order:, -1] += D[1:, 0] * direct
    return np.asarray(np.linalg.eigvals(total) / theta, dtype=complex)


def _differentiation(nodes: int) -> Real:
    """Matrix that differentiates a polynomial at Chebyshev points of [0, 1], ascending."""
    k = np.arange(nodes + 1)
    x = 0.5 * (1 - np.cos(math.pi * k / nodes))
    c = np.where((k == 0) | (k == nodes), 2.0, 1.0) * (-1.0) ** k
    gap = x[:, None] - x
    D = np.outer(c, 1 / c) / (gap + np.eye(nodes + 1))
    D -= np.diag(D.sum(axis=1))
    return np.asarray(D)


def expanded(roots: Complex) -> Real:
    """Coefficients of the polynomial with these roots, highest power first."""
    return np.atleast_1d(np.poly(roots)).real
