"""What all parts of the results' files have in common."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class ResultPart(BaseModel):
    """A part of a file that we write: nothing unknown, no NaN."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False
    )


class LeftOutPart(ResultPart):
    """A frame left out."""

    frame: int
    reason: str
