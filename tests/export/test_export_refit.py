"""What a format cannot say exactly: its best fit, how far that is off, and where it holds."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cell.errors import InputError
from cell.storage.files.calibration_source import read_calibration
from cell.verbs.export import Camera, export_calibration
from cell.verbs.export.domain import domain_of
from cell.verbs.export.refit import refit
from tests.export.calibrations import STILL, with_joint, write
from tests.export.test_export_tools import _camera


def pixels(camera: Camera, rays: np.ndarray) -> np.ndarray:
    """OpenCV's own projection."""
    matrix = np.array([[camera.alpha_px, 0, camera.u0_px], [0, camera.beta_px, camera.v0_px],
                       [0, 0, 1]])  # fmt: skip
    seen, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, np.array(camera.distortion))
    return np.asarray(seen[:, 0])


@pytest.mark.parametrize(("kind", "worst_px"), [("three radial", 0.5), ("rational", 30.0)])
def test_the_best_fit_with_four_coefficients_is_as_far_off_as_it_says(
    kind: str, worst_px: float
) -> None:
    exact = _camera(kind)
    found = refit(exact, (4,))
    assert not any(found.camera.distortion[4:])
    across, down = np.meshgrid(np.linspace(-0.4, 0.4, 41), np.linspace(-0.3, 0.3, 31))
    rays = np.stack([across.ravel(), down.ravel(), np.ones(across.size)], axis=1)
    seen = pixels(exact, rays)
    inside = ((seen > 0) & (seen < [4095, 3071])).all(axis=1)
    off = np.linalg.norm(pixels(found.camera, rays) - seen, axis=1)[inside]
    assert np.sqrt((off**2).mean()) == pytest.approx(found.rms_px, rel=0.25)
    assert off.max() < 1.1 * found.worst_px
    dropped = replace(exact, distortion=(*exact.distortion[:4], *[0.0] * 10))
    left_out = np.linalg.norm(pixels(dropped, rays) - seen, axis=1)[inside]
    assert np.sqrt((off**2).mean()) < 0.3 * np.sqrt((left_out**2).mean())
    assert found.worst_px < worst_px


def test_a_longer_list_that_holds_the_camera_is_exact() -> None:
    found = refit(_camera("three radial"), (4, 5))
    assert found.worst_px < 1e-6
    assert found.camera.distortion == pytest.approx(_camera("three radial").distortion, abs=1e-6)


def test_refit_is_a_choice_and_says_what_it_costs(tmp_path) -> None:  # type: ignore[no-untyped-def]
    source = read_calibration(write(tmp_path, with_joint(STILL, k3=-0.02)))
    with pytest.raises(InputError, match=r"cannot say the distortion coefficient k3: .* --refit"):
        export_calibration(source, "kalibr")
    exported = export_calibration(source, "kalibr", refit=True)
    (warning,) = exported.warnings
    assert "px rms" in warning
    assert warning in exported.text.splitlines()[0]
    exact = export_calibration(source, "opencv", refit=True)
    assert exact.text == export_calibration(source, "opencv").text
    assert exact.warnings == ("nothing to refit: opencv says this camera exactly",)
    with pytest.raises(InputError, match="--refit: json loses nothing"):
        export_calibration(source, "json", refit=True)


def test_a_polynomial_that_folds_inside_the_picture_says_where(tmp_path) -> None:  # type: ignore[no-untyped-def]
    folding = {"alpha_px": 1500.0, "beta_px": 1500.0, "k1": -0.2, "k2": 0.0}
    source = read_calibration(write(tmp_path, with_joint(STILL, **folding)))
    exported = export_calibration(source, "opencv")
    (warning,) = exported.warnings
    # r - 0.2 r³ turns at r² = 1/0.6, where it is 2/3 r
    turn = np.sqrt(1 / 0.6)
    assert f"folds {1500 * 2 / 3 * turn:.0f} px from the principal point" in warning
    assert f"{np.degrees(np.arctan(turn)):.0f} degrees off the axis" in warning
    assert warning in exported.text.replace("\n#", "")
    assert domain_of(_camera("two radial")) is None
    assert domain_of(_camera("rational")) is None
