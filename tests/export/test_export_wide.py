"""A wide lens, read back by the programs that have its model, and refitted for the one without."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from ruamel.yaml import YAML

from calib.chain.projection import project
from calib.chain.sight import unproject
from calib.views import FloatArray
from cell.errors import InputError
from cell.storage.files.calibration_source import DISTORTION, read_calibration
from cell.verbs.export import Camera, export_calibration
from cell.verbs.export.domain import domain_of
from cell.verbs.export.formats import colmap, kalibr, mrcal, opencv, ros
from cell.verbs.export.refit import refit
from tests.export.calibrations import STILL, with_joint, write
from tests.export.test_export_tools import MRCAL_PROJECTS, _run, mrcals, new_mrcal

__all__ = ["mrcals", "new_mrcal"]

TERMS = {"k1": 0.03, "k2": -0.01, "k3": 0.003, "k4": -0.0006}
WIDE = Camera(
    image_size_px=(1280, 960),
    alpha_px=445.123456789,
    beta_px=446.0,
    u0_px=645.3,
    v0_px=471.6,
    distortion=tuple(TERMS.get(name, 0.0) for name in DISTORTION),
    about="a test",
    wide=True,
)
AGREES_PX = 1e-6


def _rays(widest_deg: float) -> FloatArray:
    angle, around = np.meshgrid(np.radians(np.linspace(0.01, widest_deg, 9)), np.arange(0, 6.2, 1))
    aside = np.sin(angle.ravel())[:, None] * np.stack(
        [np.cos(around.ravel()), np.sin(around.ravel())], axis=1
    )
    return np.column_stack([aside, np.cos(angle.ravel())])


def _own(camera: Camera, rays: FloatArray) -> FloatArray:
    return project(camera.optics[None], np.eye(4)[None], rays)[0]


def _by_cv2(K: FloatArray, D: FloatArray, rays: FloatArray) -> FloatArray:
    seen, _ = cv2.fisheye.projectPoints(rays[:, None], np.zeros(3), np.zeros(3), K, D)
    return np.asarray(seen[:, 0])


def test_opencv_reads_it(tmp_path: Path) -> None:
    (tmp_path / "camera.yaml").write_text(opencv.text(WIDE))
    storage = cv2.FileStorage(str(tmp_path / "camera.yaml"), cv2.FILE_STORAGE_READ)
    assert storage.getNode("fisheye_model").real() == 1
    K, D = (storage.getNode(n).mat() for n in ("camera_matrix", "distortion_coefficients"))
    assert np.abs(_by_cv2(K, D, _rays(85)) - _own(WIDE, _rays(85))).max() < AGREES_PX


def test_ros_equidistant_by_the_published_formula() -> None:
    info = YAML(typ="safe").load(ros.text(WIDE))
    assert info["distortion_model"] == "equidistant"
    K = np.reshape(info["camera_matrix"]["data"], (3, 3))
    D = np.array(info["distortion_coefficients"]["data"])
    assert len(D) == 4
    assert np.abs(_by_cv2(K, D, _rays(85)) - _own(WIDE, _rays(85))).max() < AGREES_PX


def test_kalibr_pinhole_equi_by_the_published_formula() -> None:
    chain = YAML(typ="safe").load(kalibr.text(WIDE))["cam0"]
    assert (chain["camera_model"], chain["distortion_model"]) == ("pinhole", "equidistant")
    fu, fv, pu, pv = chain["intrinsics"]
    x, y, z = _rays(85).T
    r = np.hypot(x, y)
    t = np.arctan2(r, z)
    k = chain["distortion_coeffs"]
    d = t * (1 + k[0] * t**2 + k[1] * t**4 + k[2] * t**6 + k[3] * t**8)
    found = np.stack([fu * d * x / r + pu, fv * d * y / r + pv], axis=1)
    assert np.abs(found - _own(WIDE, _rays(85))).max() < AGREES_PX


def test_colmap_reads_it_to_ninety_degrees(tmp_path: Path) -> None:
    """Beyond, pycolmap 4.2 takes the angle for its tangent: what we export is right, it is not."""
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap has no wheel for this machine")
    (tmp_path / "cameras.txt").write_text(colmap.text(WIDE))
    for empty in ("images.txt", "points3D.txt", "rigs.txt", "frames.txt"):
        (tmp_path / empty).write_text("")
    reconstruction = pycolmap.Reconstruction()
    reconstruction.read_text(str(tmp_path))
    (read,) = reconstruction.cameras.values()
    assert read.model.name == "OPENCV_FISHEYE"
    assert np.abs(read.img_from_cam(_rays(85)) - 0.5 - _own(WIDE, _rays(85))).max() < AGREES_PX


def test_mrcal_has_no_such_model_and_gets_a_refit(new_mrcal: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"mrcal has no equidistant image.*--refit"):
        mrcal.text(WIDE)
    found = refit(WIDE, mrcal.LENGTHS)
    assert found.rms_px < 0.2
    path = tmp_path / "camera.cameramodel"
    path.write_text(mrcal.text(found.camera))
    rays = _rays(70)
    output = json.loads(_run([new_mrcal, "-c", MRCAL_PROJECTS, path, json.dumps(rays.tolist())]))
    off = np.linalg.norm(np.array(output["pixels"]) - _own(WIDE, rays), axis=1)
    assert off.max() < 1.1 * found.worst_px


def test_further_terms_are_refused_and_refitted(tmp_path: Path) -> None:
    more = {"projection": "equidistant", "alpha_px": 372.0, "beta_px": 373.0, "u0_px": 645.0,
            "v0_px": 471.0, **TERMS, "p1": 4e-4}  # fmt: skip
    content = with_joint(STILL | {"image_size_px": [1280, 960]}, **more)
    source = read_calibration(write(tmp_path, content))
    for tool in ("ros", "opencv", "kalibr", "colmap"):
        with pytest.raises(InputError, match="coefficient p1 of a wide lens"):
            export_calibration(source, tool)
        assert "px rms" in export_calibration(source, tool, refit=True).warnings[0]
    assert json.loads(export_calibration(source, "json").text)["projection"] == "equidistant"


def test_where_it_folds_inside_the_picture_the_export_says_so() -> None:
    assert domain_of(WIDE) is None
    folding = replace(WIDE, distortion=(-0.15, *[0.0] * 13))  # t - 0.15 t³ ends at 85.4 degrees
    found = domain_of(folding)
    assert found is not None
    assert np.degrees(found.angle_rad) == pytest.approx(85.41, abs=0.01)


def test_pycolmap_beyond_ninety_degrees_is_not_asked() -> None:
    """It takes the angle for its tangent there: our own chain goes on to the same side."""
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap has no wheel for this machine")
    values = (WIDE.alpha_px, WIDE.beta_px, WIDE.u0_px + 0.5, WIDE.v0_px + 0.5, *TERMS.values())
    read = pycolmap.Camera(model="OPENCV_FISHEYE", width=1280, height=960, params=values)
    angle = np.radians([85.0, 100.0])
    rays = np.column_stack([np.sin(angle), np.zeros(2), np.cos(angle)])
    ours, theirs = _own(WIDE, rays), np.asarray(read.img_from_cam(rays), dtype=float) - 0.5
    assert ours[0] == pytest.approx(theirs[0], abs=AGREES_PX)
    assert ours[1, 0] > ours[0, 0]
    assert not np.allclose(ours[1], theirs[1], atol=1.0), "COLMAP has mended it: say so in the docs"


def test_mrcal_unprojects_to_other_lengths_and_the_same_direction(
    new_mrcal: Path, tmp_path: Path
) -> None:
    """Its vectors have neither unit length nor z = 1; ours have unit length."""
    flat = replace(WIDE, wide=False, distortion=(-0.1, 0.01, 1e-3, -5e-4, *[0.0] * 10))
    path = tmp_path / "camera.cameramodel"
    path.write_text(mrcal.text(flat))
    pixels = np.array([[700.0, 500.0], [200.0, 300.0], [1100.0, 900.0]])
    asked = (
        "import json, sys, mrcal, numpy as np\n"
        "model = mrcal.cameramodel(sys.argv[1])\n"
        "q = np.array(json.loads(sys.argv[2]))\n"
        "print(json.dumps(mrcal.unproject(q, *model.intrinsics()).tolist()))"
    )
    theirs = np.array(json.loads(_run([new_mrcal, "-c", asked, path, json.dumps(pixels.tolist())])))
    length = np.linalg.norm(theirs, axis=1)
    assert np.abs(theirs / length[:, None] - unproject(flat.optics, pixels)).max() < 1e-6
    assert np.abs(length - 1).max() > 1e-3
    assert np.abs(theirs[:, 2] - 1).max() > 1e-3
