"""The base of every AFarCloud type: immutable, and nothing unknown gets in."""

from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticCustomError

FIELD_RULE = "field_rule"
"""Type of the errors made by `field_error`; their context names the field."""


class Model(BaseModel):
    """Frozen; an unknown field, NaN or infinity is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def field_error(field: str, message: str) -> PydanticCustomError:
    """Make the error of a rule between fields, laid at the door of one of them."""
    return PydanticCustomError(FIELD_RULE, "{message}", {"field": field, "message": message})
