"""Series settings of a rule as the ISA controller that will run, derivative filter included."""

from loop.controller import PID, Action, SeriesPID


def series_to_isa(*, Kc: float, Ti: float, Td: float, alpha: float, K: float) -> PID:
    """Convert Kc (1 + 1/(Ti s)) (Td s + 1) with a filter of alpha times the shorter time.

    The two times may change places, Kc (1 + 1/(Ti s)) (Td s + 1) =
    Kc Td/Ti (1 + 1/(Td s)) (Ti s + 1), so the shorter one is the derivative's. Then a filter of
    alpha gives an N between about 1/(2 alpha) - 1 and 1/alpha - 1.

    Parameters
    ----------
    Kc : float
        Series gain, positive. [OP/PV]
    Ti, Td : float
        Series times. [s]
    alpha : float
        Filter time over the shorter of the two, 0 for no filter. [-]
    K : float
        Process gain, for the action. [PV/OP]

    Examples
    --------
    >>> pid = series_to_isa(Kc=0.5, Ti=1.0, Td=4.0, alpha=0.0, K=1.0)
    >>> pid == series_to_isa(Kc=2.0, Ti=4.0, Td=1.0, alpha=0.0, K=1.0)
    True
    >>> pid.Kc, pid.Ti, pid.Td
    (2.5, 5.0, 0.8)
    """
    if Td > Ti:
        Kc, Ti, Td = Kc * Td / Ti, Td, Ti
    return SeriesPID(Kc=Kc, Ti=Ti, Td=Td, alpha=alpha, action=Action.for_gain(K)).to_isa()
