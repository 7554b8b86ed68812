"""The columns that describe a camera while one frame is exposed."""

from __future__ import annotations

import numpy as np

from calib.views import FloatArray

OPTICS: tuple[str, ...] = (
    "alpha_px",
    "beta_px",
    "skew_px",
    "u0_px",
    "v0_px",
    "k1",
    "k2",
    "p1",
    "p2",
    "k3",
    "k4",
    "k5",
    "k6",
    "s1",
    "s2",
    "s3",
    "s4",
    "tilt_x_rad",
    "tilt_y_rad",
    "pupil_m_rad2",
    "window_m",
    "sweep_x_m",
    "sweep_y_m",
    "sweep_z_m",
    "sweep_rx_rad",
    "sweep_ry_rad",
    "sweep_rz_rad",
    "height_px",
    "pose_row",
    "equidistant",
)
"""Names of the K columns of an optics array.

alpha, beta, skew, u0, v0 are the matrix A of the paper's Eq. 2. k1..k6, p1, p2, s1..s4 and the
sensor's tilt are Brown's and OpenCV's distortion on normalised coordinates. `pupil_m_rad2` moves
the entrance pupil along the axis by that much per squared radian of field angle; `window_m` is
the thickness of a plane-parallel glass of index `WINDOW_INDEX` in front of the lens. The sweep is
how the board moves in the camera's frame while a rolling shutter reads from the first row to the
last of `height_px` rows; `pose_row` is how far below the middle, as a share of the rows, the row
lies at whose moment the pose stands. `equidistant` is one for a wide lens whose ideal image grows
with the angle from the axis instead of its tangent; distortion then acts on that image, k1 to k4
are Kannala and Brandt's terms (OpenCV's `fisheye`), and k5 and k6 are not looked at.
"""

NEVER_FREE = ("height_px", "pose_row", "equidistant")
"""Columns that say what a camera is: no pixel has a derivative by them."""

COLUMN = {name: index for index, name in enumerate(OPTICS)}

WINDOW_INDEX = 1.5
"""Refractive index of the protective window: crown glass and acrylic lie within 0.02 of it."""


def optics_row(**values: float) -> FloatArray:
    """(K,) optics with the named columns set and every other one zero; unknown names raise."""
    row = np.zeros(len(OPTICS))
    row[COLUMN["height_px"]] = 1.0
    for name, value in values.items():
        row[COLUMN[name]] = value
    return row
