"""The valve models of `loop.valve` for one valve, in plain floats: ten times faster than arrays.

Each function starts a valve at rest and gives a function from the output of a scan to the stem
position. A property test holds them equal to the arrays.
"""

from collections.abc import Callable


def choudhury_of_one(S: float, J: float, op: float, position: float) -> Callable[[float], float]:
    """Start one valve of Choudhury's model.

    Parameters
    ----------
    S, J : float
        Dead band plus stick band, and slip jump. [OP]
    op, position : float
        Output and stem position at rest. [OP]
    """
    follow, let_go = (S - J) / 2, (S + J) / 2
    before, stuck_at, way_before, stuck = op, position, 0, True

    def move(op: float) -> float:
        nonlocal before, stuck_at, way_before, stuck, position
        way = (op > before) - (op < before)
        turned = way != way_before
        if turned or stuck:
            if not stuck:
                stuck_at = before
            onward = not turned and (op - stuck_at > 0) == (stuck_at > position)
            if onward and op != stuck_at and stuck_at != position:
                past = abs(op - stuck_at) > J
            else:
                past = abs(op - position) > let_go
            stuck = way == 0 or not past
        if not stuck:
            position = op - way * follow
        before, way_before = op, way
        return position

    return move


def kano_of_one(S: float, J: float, op: float, position: float) -> Callable[[float], float]:
    """Start one valve of Kano's model.

    Parameters
    ----------
    S, J : float
        Dead band plus stick band, and slip jump. [OP]
    op, position : float
        Output and stem position at rest. [OP]
    """
    follow = (S - J) / 2
    before, stuck_at, way_before, stuck, direction = op, position - follow, 0, True, -1.0

    def move(op: float) -> float:
        nonlocal before, stuck_at, way_before, stuck, direction, position
        way = (op > before) - (op < before)
        if not stuck and (way != way_before or way == 0):
            stuck_at, stuck = before, True
        if stuck:
            gone = direction * (op - stuck_at)
            if -gone > S:
                direction, stuck = -direction, False
            elif gone > J:
                stuck = False
        if not stuck:
            position = op - direction * follow
        before, way_before = op, way
        return position

    return move


def he_of_one(fs: float, fd: float, position: float) -> Callable[[float], float]:
    """Start one valve of He's model.

    Parameters
    ----------
    fs, fd : float
        Static and kinetic friction. [OP]
    position : float
        Stem position at rest. [OP]
    """

    def move(op: float) -> float:
        nonlocal position
        residual = op - position
        if residual > fs:
            position = op - fd
        elif -residual > fs:
            position = op + fd
        return position

    return move
