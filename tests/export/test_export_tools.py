"""Every export read back by the program it is for: projections agree to 1e-6 px."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from ruamel.yaml import YAML

from calib.views import FloatArray
from cell.errors import InputError
from cell.storage.files.calibration_source import DISTORTION
from cell.verbs.export import Camera
from cell.verbs.export.formats import colmap, kalibr, mrcal, opencv, ros
from tests.export.calibrations import DISTORTIONS, POINTS_M, own_projection

AGREES_PX = 1e-6
MRCAL = Path(__file__).parents[2] / ".mrcal" / "bin" / "python"


def _camera(kind: str) -> Camera:
    given = DISTORTIONS[kind]
    return Camera(
        image_size_px=(4096, 3072),
        alpha_px=4755.8123456789,
        beta_px=4789.1,
        u0_px=2052.3,
        v0_px=1548.5,
        distortion=tuple(given.get(name, 0.0) for name in DISTORTION),
        about="a test",
    )


def _assert_agrees(found: FloatArray, camera: Camera) -> None:
    assert np.abs(found - own_projection(camera)).max() < AGREES_PX


def test_the_points_reach_all_over_the_image() -> None:
    pixels = own_projection(_camera("two radial"))
    assert (pixels.min(axis=0) < [350, 250]).all()
    assert (pixels.max(axis=0) > [3700, 2800]).all()


@pytest.mark.parametrize("kind", DISTORTIONS)
def test_opencv_reads_it(kind: str, tmp_path: Path) -> None:
    camera = _camera(kind)
    (tmp_path / "camera.yaml").write_text(opencv.text(camera))
    storage = cv2.FileStorage(str(tmp_path / "camera.yaml"), cv2.FILE_STORAGE_READ)
    assert storage.getNode("image_width").real() == 4096
    matrix = storage.getNode("camera_matrix").mat()
    distortion = storage.getNode("distortion_coefficients").mat()
    pixels, _ = cv2.projectPoints(POINTS_M, np.zeros(3), np.zeros(3), matrix, distortion)
    _assert_agrees(pixels[:, 0], camera)


@pytest.mark.parametrize("kind", ["two radial", "decentred", "three radial", "rational"])
def test_ros_camera_info_by_the_published_formula(kind: str) -> None:
    camera = _camera(kind)
    info = YAML(typ="safe").load(ros.text(camera))
    K = np.reshape(info["camera_matrix"]["data"], (3, 3))
    D = np.array(info["distortion_coefficients"]["data"])
    assert info["distortion_model"] == ("plumb_bob" if len(D) == 5 else "rational_polynomial")
    assert np.array_equal(np.reshape(info["projection_matrix"]["data"], (3, 4))[:, :3], K)
    assert np.array_equal(np.reshape(info["rectification_matrix"]["data"], (3, 3)), np.eye(3))
    pixels, _ = cv2.projectPoints(POINTS_M, np.zeros(3), np.zeros(3), K, D)
    _assert_agrees(pixels[:, 0], camera)


@pytest.mark.parametrize("kind", ["two radial", "decentred"])
def test_kalibr_by_the_published_formula(kind: str) -> None:
    camera = _camera(kind)
    chain = YAML(typ="safe").load(kalibr.text(camera))["cam0"]
    assert (chain["camera_model"], chain["distortion_model"]) == ("pinhole", "radtan")
    assert chain["resolution"] == [4096, 3072]
    _assert_agrees(_radtan(POINTS_M, *chain["intrinsics"], *chain["distortion_coeffs"]), camera)


def _radtan(
    points_m: FloatArray,
    fu: float,
    fv: float,
    pu: float,
    pv: float,
    k1: float,
    k2: float,
    r1: float,
    r2: float,
) -> FloatArray:
    """Kalibr wiki, "Supported models": pinhole with radial-tangential distortion."""
    x, y = (points_m[:, :2] / points_m[:, 2:]).T
    rr = x**2 + y**2
    radial = 1 + k1 * rr + k2 * rr**2
    xd = x * radial + 2 * r1 * x * y + r2 * (rr + 2 * x**2)
    yd = y * radial + 2 * r2 * x * y + r1 * (rr + 2 * y**2)
    return np.stack([fu * xd + pu, fv * yd + pv], axis=1)


@pytest.mark.parametrize("kind", ["two radial", "decentred", "three radial", "rational"])
def test_colmap_reads_it(kind: str, tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap has no wheel for this machine")
    camera = _camera(kind)
    (tmp_path / "cameras.txt").write_text(colmap.text(camera))
    for empty in ("images.txt", "points3D.txt", "rigs.txt", "frames.txt"):
        (tmp_path / empty).write_text("")
    reconstruction = pycolmap.Reconstruction()
    reconstruction.read_text(str(tmp_path))
    (read,) = reconstruction.cameras.values()
    assert (read.width, read.height) == (4096, 3072)
    _assert_agrees(read.img_from_cam(POINTS_M) - 0.5, camera)


MRCAL_PROJECTS = """
import json, sys
import mrcal, numpy as np
model = mrcal.cameramodel(sys.argv[1])
points = np.array(json.loads(sys.argv[2]))
pixels = mrcal.project(points, *model.intrinsics())
print(json.dumps({"pixels": pixels.tolist(), "size": [int(n) for n in model.imagersize()]}))
"""


def _has_mrcal(python: Path) -> bool:
    if not python.exists():
        return False
    asked = subprocess.run([python, "-c", "import mrcal"], capture_output=True, check=False)
    return asked.returncode == 0


@pytest.fixture(scope="session")
def mrcals() -> list[Path]:
    """Every Python with mrcal: PyPI's (2.5 or newer), and Debian's (2.2) where it happens to be."""
    found = [p for p in (MRCAL, Path("/usr/bin/python3")) if _has_mrcal(p)]
    if not found:
        pytest.skip("mrcal is not installed: run tools/install-mrcal (needs Python 3.12 or newer)")
    return found


@pytest.fixture(scope="session")
def new_mrcal(mrcals: list[Path]) -> Path:
    """PyPI's, which reads other programs' files, too."""
    if MRCAL not in mrcals:
        pytest.skip("mrcal is not installed from PyPI: run tools/install-mrcal")
    return MRCAL


def _mrcal_projection(python: Path, model: Path) -> FloatArray:
    command = [python, "-c", MRCAL_PROJECTS, model, json.dumps(POINTS_M.tolist())]
    output = json.loads(_run(command))
    assert output["size"] == [4096, 3072]
    return np.array(output["pixels"])


def _run(command: list[str | Path]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("kind", DISTORTIONS)
def test_mrcal_reads_it(kind: str, mrcals: list[Path], tmp_path: Path) -> None:
    camera, path = _camera(kind), tmp_path / "camera.cameramodel"
    path.write_text(mrcal.text(camera))
    for python in mrcals:
        _assert_agrees(_mrcal_projection(python, path), camera)


def test_mrcal_reads_the_ros_file_too(new_mrcal: Path, tmp_path: Path) -> None:
    camera, path = _camera("three radial"), tmp_path / "camera_info.yaml"
    path.write_text(ros.text(camera))
    _assert_agrees(_mrcal_projection(new_mrcal, path), camera)


def test_mrcal_reads_the_kalibr_file_too(new_mrcal: Path, tmp_path: Path) -> None:
    camera, path = _camera("decentred"), tmp_path / "camchain.yaml"
    path.write_text(kalibr.text(camera))
    _run([new_mrcal, new_mrcal.with_name("mrcal-from-kalibr"), path])
    model = tmp_path / "camchain-cam0.cameramodel"
    _assert_agrees(_mrcal_projection(new_mrcal, model), camera)


@pytest.mark.parametrize(
    ("write", "kind", "coefficient"),
    [
        (kalibr.text, "three radial", "k3"),
        (colmap.text, "thin prism", "s4"),
        (ros.text, "thin prism", "s4"),
    ],
)
def test_a_coefficient_that_the_format_cannot_say_is_refused_not_dropped(
    write: object, kind: str, coefficient: str
) -> None:
    assert callable(write)
    with pytest.raises(InputError, match=f"cannot say the distortion coefficient {coefficient}"):
        write(_camera(kind))
