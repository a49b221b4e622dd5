"""All indices of one loop over one period, together."""

from dataclasses import dataclass

from monitoring.acf_decay import AcfDecay
from monitoring.achievable_variance import AchievableVariance
from monitoring.desired_settling import DesiredSettling
from monitoring.error_statistics import ErrorStatistics
from monitoring.expected_response import ExpectedResponse
from monitoring.half_periods import HalfPeriods
from monitoring.load_responses import LoadResponses
from monitoring.minimum_variance import MinimumVariance
from monitoring.model_mismatch import ModelMismatch
from monitoring.oscillation import Oscillation
from monitoring.sensor import SensorHealth
from monitoring.set_point_line import SetPointLine
from monitoring.set_point_moves import SetPointMoves
from monitoring.stiction_result import Stiction
from monitoring.usage import Usage
from monitoring.valve_size import ValveRange


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelIndices:
    """Indices that need a process model.

    Attributes
    ----------
    best_PI, best_PID : AchievableVariance
        The error against the best that a PI and a PID could do.
    mismatch : ModelMismatch
        Whether the model still describes the loop.
    expected_response : ExpectedResponse
        Set-point moves against what model and settings lead to expect.
    """

    best_PI: AchievableVariance
    best_PID: AchievableVariance
    mismatch: ModelMismatch
    expected_response: ExpectedResponse


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlIndices:
    """Indices of the part of a record in which the controller was free to act.

    Attributes
    ----------
    oscillation : Oscillation
        Oscillations of the error.
    set_point_line : SetPointLine or None
        Whether the set point swings with the strongest of them; None without one, and without a
        set point.
    half_periods, acf_decay, load_responses, set_point_moves
        Indices of the same name.
    stiction : Stiction
        Whether the valve sticks.
    minimum_variance : MinimumVariance
        The error against the best possible.
    desired_settling : DesiredSettling or None
        The error against one that settles as wished; None without a dead time and a wish.
    model : ModelIndices or None
        What needs a process model; None without one.
    """

    oscillation: Oscillation
    set_point_line: SetPointLine | None
    half_periods: HalfPeriods
    acf_decay: AcfDecay
    set_point_moves: SetPointMoves
    load_responses: LoadResponses
    stiction: Stiction
    minimum_variance: MinimumVariance
    desired_settling: DesiredSettling | None = None
    model: ModelIndices | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Indices:
    """Every index of one loop over one period.

    Attributes
    ----------
    usage : Usage
        How much it was used.
    error : ErrorStatistics
        How far PV was from its set point.
    sensor : SensorHealth
        What the measurement is worth.
    valve_range : ValveRange
        Where the valve works in its range.
    control : ControlIndices or None
        How it controls; None where the controller was never free to act for long enough.
    """

    usage: Usage
    error: ErrorStatistics
    sensor: SensorHealth
    valve_range: ValveRange
    control: ControlIndices | None
