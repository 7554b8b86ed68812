"""ROS: the YAML of `camera_calibration_parsers`, which drivers publish as CameraInfo."""

from __future__ import annotations

from cell.verbs.export.camera import Camera

_MODELS = {5: "plumb_bob", 8: "rational_polynomial"}
_WIDE = "equidistant"
LENGTHS = tuple(_MODELS)


def text(camera: Camera) -> str:
    """A `camera_info` file: K, D, R and P at full resolution (REP 104, sensor_msgs/CameraInfo).

    R is the identity and P repeats K: the camera is one, and its rectified picture keeps its
    focal length. ROS takes pixel coordinates as OpenCV does. A wide lens is `equidistant`, which
    readers that look at the coefficients and not at the name take for `plumb_bob`.
    """
    wide = camera.wide
    d = camera.fisheye_coefficients("ros") if wide else camera.coefficients(LENGTHS, "ros")
    a, b, u, v = camera.alpha_px, camera.beta_px, camera.u0_px, camera.v0_px
    width, height = camera.size_px("ros")
    lines = [
        f"# {camera.about}",
        f"image_width: {width}",
        f"image_height: {height}",
        "camera_name: camera",
        *_matrix("camera_matrix", 3, 3, (a, 0, u, 0, b, v, 0, 0, 1)),
        f"distortion_model: {_WIDE if wide else _MODELS[len(d)]}",
        *_matrix("distortion_coefficients", 1, len(d), d),
        *_matrix("rectification_matrix", 3, 3, (1, 0, 0, 0, 1, 0, 0, 0, 1)),
        *_matrix("projection_matrix", 3, 4, (a, 0, u, 0, 0, b, v, 0, 0, 0, 1, 0)),
    ]
    return "\n".join(lines) + "\n"


def _matrix(name: str, rows: int, cols: int, values: tuple[float, ...]) -> list[str]:
    data = ", ".join(repr(float(value)) for value in values)
    return [f"{name}:", f"  rows: {rows}", f"  cols: {cols}", f"  data: [{data}]"]
