"""Kalibr: a camchain with one camera, pinhole with radial-tangential or equidistant distortion."""

from __future__ import annotations

from cell.verbs.export.camera import Camera

LENGTHS = (4,)


def text(camera: Camera) -> str:
    """A `camchain.yaml`: intrinsics fu, fv, pu, pv, and k1, k2, r1, r2.

    Kalibr's radtan has four coefficients: a third radial term is refused, not dropped. Pixel
    coordinates are OpenCV's. A wide lens is Kalibr's pinhole-equi, with k1 to k4.
    """
    wide = camera.wide
    d = camera.fisheye_coefficients("kalibr") if wide else camera.coefficients(LENGTHS, "kalibr")
    width, height = camera.size_px("kalibr")
    intrinsics = (camera.alpha_px, camera.beta_px, camera.u0_px, camera.v0_px)
    return (
        f"# {camera.about}\n"
        "cam0:\n"
        "  cam_overlaps: []\n"
        "  camera_model: pinhole\n"
        f"  distortion_coeffs: {_list(d)}\n"
        f"  distortion_model: {'equidistant' if wide else 'radtan'}\n"
        f"  intrinsics: {_list(intrinsics)}\n"
        f"  resolution: [{width}, {height}]\n"
        "  rostopic: /camera/image_raw\n"
    )


def _list(values: tuple[float, ...]) -> str:
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"
