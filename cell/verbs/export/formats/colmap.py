"""COLMAP: a `cameras.txt` with one camera."""

from __future__ import annotations

from cell.verbs.export.camera import Camera

_MODELS = {4: "OPENCV", 8: "FULL_OPENCV"}
_WIDE = "OPENCV_FISHEYE"
LENGTHS = tuple(_MODELS)
CORNER = 0.5
"""COLMAP puts (0, 0) at the top-left corner of the top-left pixel, its centre at (0.5, 0.5)."""


def text(camera: Camera) -> str:
    """The line `CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy ...`.

    The principal point is moved by half a pixel in each direction, for COLMAP's origin.
    """
    wide = camera.wide
    d = camera.fisheye_coefficients("colmap") if wide else camera.coefficients(LENGTHS, "colmap")
    width, height = camera.size_px("colmap")
    centre = (camera.u0_px + CORNER, camera.v0_px + CORNER)
    values = (camera.alpha_px, camera.beta_px, *centre, *d)
    return (
        f"# {camera.about}\n"
        "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]; pixel centres are at (0.5, 0.5)\n"
        f"1 {_WIDE if wide else _MODELS[len(d)]} {width} {height} "
        + " ".join(repr(float(value)) for value in values)
        + "\n"
    )
