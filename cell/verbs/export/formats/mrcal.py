"""mrcal: a `.cameramodel` text file with one of its OpenCV lens models."""

from __future__ import annotations

from cell.verbs.export.camera import Camera

LENGTHS = (4, 5, 8, 12)
_IDENTITY = "[ 0., 0., 0., 0., 0., 0. ]"


def text(camera: Camera) -> str:
    """A `.cameramodel` with the extrinsics at the identity.

    mrcal's intrinsics are fx, fy, cx, cy, then OpenCV's coefficients; pixel coordinates are
    OpenCV's.
    """
    d = camera.coefficients(LENGTHS, "mrcal")
    width, height = camera.size_px("mrcal")
    intrinsics = (camera.alpha_px, camera.beta_px, camera.u0_px, camera.v0_px, *d)
    values = ", ".join(repr(float(value)) for value in intrinsics)
    return (
        f"# {camera.about}\n"
        "{\n"
        f"    'lensmodel':  'LENSMODEL_OPENCV{len(d)}',\n\n"
        f"    'intrinsics': [ {values} ],\n\n"
        f"    'rt_cam_ref': {_IDENTITY},\n"
        f"    'extrinsics': {_IDENTITY}, # what mrcal before 2.5 calls it\n\n"
        f"    'imagersize': [ {width}, {height} ],\n"
        "}\n"
    )
