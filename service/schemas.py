"""What every body has in common."""

from pydantic import BaseModel, ConfigDict


class Strict(BaseModel):
    """A request body: no unknown field, no silent conversion, no NaN or infinity."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class Answer(BaseModel):
    """An answer, read from a row or a result. A number that is not finite would be an error."""

    model_config = ConfigDict(from_attributes=True, allow_inf_nan=False)
