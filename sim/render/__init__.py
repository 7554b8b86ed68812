"""Pictures of a board: pattern, surface, coverage, defocus, sensor, in that order."""

from __future__ import annotations

from collections.abc import Callable

from calib.chain.optics import COLUMN
from calib.views import Board, FloatArray
from sim.render.coverage import integrate
from sim.render.defocus import Blur, defocus
from sim.render.pattern import pattern_of
from sim.render.sensor import Sensor, expose
from sim.render.surface import Image, Surface, look

__all__ = ["Blur", "Image", "Sensor", "expose", "render"]


def render(
    board: Board,
    points_m: FloatArray,
    optics: FloatArray,
    camera_from_board: FloatArray,
    *,
    width_px: int,
    height_px: int,
    blur: Blur | None = None,
    straightened: Callable[[FloatArray], FloatArray] | None = None,
) -> Image:
    """Mean reflectance seen by every pixel.

    Parameters
    ----------
    board:
        What is printed.
    points_m:
        (M, 3) its corners as they are, board frame, metres.
    optics, camera_from_board:
        (K,) columns of `calib.chain.optics.OPTICS` and (4, 4) pose for this frame.
    width_px, height_px:
        Size of the image.
    blur:
        The lens's focus; sharp everywhere where it is None.
    straightened:
        Where the lens alone would show what is seen at (Q, 2) pixels; there where it is None.

    Returns
    -------
    (height_px, width_px) float32 between 0 and 1. Raises `ValueError` for a board that cannot
    be printed.
    """
    surface = Surface(board, points_m)
    nodes = look(surface, optics, camera_from_board, width_px, height_px, straightened)
    image = integrate(pattern_of(board), nodes, width_px, height_px)
    if blur is None:
        return image
    radius = blur.radius_px(nodes.depth_m, float(optics[COLUMN["alpha_px"]]))
    return defocus(image, radius, blur.lens_sigma_px)
