"""A camera's numbers as files name them: what writes a solution and what reads one share them."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, PositiveFloat


class CameraNumbers(BaseModel):
    """Scale factors, principal point, skew and distortion in OpenCV's model of that projection."""

    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True, allow_inf_nan=False)

    projection: Literal["perspective", "equidistant"] = "perspective"
    """How the image grows from its middle: with the tangent of the angle off the axis, or with the
    angle (a wide lens). Of the latter k1 to k4 are Kannala and Brandt's, OpenCV's `fisheye`."""
    alpha_px: PositiveFloat
    beta_px: PositiveFloat
    u0_px: float
    v0_px: float
    skew_px: float = 0.0
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    """Decentering and all that follow: given where the pictures deserve them."""
    p2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0
    s1: float = 0.0
    s2: float = 0.0
    s3: float = 0.0
    s4: float = 0.0
    tilt_x_rad: float = 0.0
    tilt_y_rad: float = 0.0
