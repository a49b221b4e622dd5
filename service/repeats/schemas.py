"""Bodies of questions on repeated tests."""

from pydantic import Field

from service.assessments.schemas import Period
from service.schemas import Answer, Strict


class PoolTests(Strict):
    """Ask what repeated step tests of a loop say together."""

    tests: list[Period] = Field(
        min_length=2, max_length=50, description="When each test was, with its rest before."
    )


class LeftOutBody(Answer):
    """A test that does not count."""

    test: int = Field(description="Place in the request, from 0.")
    reason: str


class RepeatsBody(Answer):
    """What the tests say together; the answer is that of `loopwright repeats --json`."""

    process: dict[str, float | str] = Field(description="Pooled first-order model.")
    standard_errors: dict[str, float | None] = Field(description="Of K, tau, theta.")
    spread: dict[str, float | None] = Field(
        description="Standard deviation from test to test beyond their own errors."
    )
    used: list[int]
    left_out: list[LeftOutBody]
    trends: dict[str, float | None] | None = Field(
        description="Drift of K, tau, theta per second of calendar time; null if none is certain."
    )
    gain_over_level: dict[str, float | bool | None] | None = Field(
        description="Gain at the lowest and highest mean output; null where the tests cannot tell."
    )
    notes: list[str]
