"""OpenCV: a FileStorage YAML with the names its own calibration sample writes."""

from __future__ import annotations

import numpy as np

from cell.verbs.export.camera import Camera

LENGTHS = (5, 8, 12, 14)


def text(camera: Camera) -> str:
    """`camera_matrix` and `distortion_coefficients`, to be read with `cv2.FileStorage`.

    Pixel coordinates are OpenCV's: (0, 0) at the centre of the top-left pixel. The coefficients of
    a wide lens are those of `cv2.fisheye`, and `fisheye_model` is 1, as that sample writes it.
    """
    import cv2  # no other format needs it

    wide = camera.wide
    tool = "opencv"
    d = camera.fisheye_coefficients(tool) if wide else camera.coefficients(LENGTHS, tool)
    flags = cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML
    storage = cv2.FileStorage("camera.yaml", flags)
    storage.writeComment(camera.about)
    if camera.image_size_px is not None:
        storage.write("image_width", camera.image_size_px[0])
        storage.write("image_height", camera.image_size_px[1])
    storage.write("camera_matrix", camera_matrix(camera))
    storage.write("distortion_coefficients", np.array([d]).T)
    if wide:
        storage.write("fisheye_model", 1)
    return str(storage.releaseAndGetString())


def camera_matrix(camera: Camera) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """(3, 3) matrix A of the paper's Eq. 2, without skew."""
    return np.array(
        [[camera.alpha_px, 0, camera.u0_px], [0, camera.beta_px, camera.v0_px], [0, 0, 1]],
        dtype=np.float64,
    )
