"""A calibration as it was fitted, read back by the tools, against the chain it was fitted with."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.chain.model import evaluate
from calib.chain.projection import project
from calib.views import Board, FloatArray, Views
from cell.errors import InputError
from cell.storage.files.calibration_source import CalibrationSource
from cell.verbs.export import export_calibration
from cell.verbs.verify.old_cell import old_cell
from tests.export.test_export_tools import AGREES_PX, MRCAL, MRCAL_PROJECTS
from tests.verify.new_views import calibration_text

DISTANCES_M = (0.4, 0.9)


def _chain(source: CalibrationSource, distance_m: float) -> tuple[FloatArray, FloatArray]:
    """(G, 3) points over the image at a distance, and (G, 2) where the fitted chain has them."""
    old = old_cell(source)
    width, height = old.image_size_px
    board = Board("chessboard", rows=2, cols=2, square_m=0.01)
    blank = Views.blank(board, width_px=width, height_px=height, frames=1, mount=old.mount)
    focused = replace(
        blank, base_from_flange=np.eye(4)[None], focus_distance_m=np.array([distance_m])
    )
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 7), np.linspace(-0.3, 0.3, 5))
    points = distance_m * np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])
    return points, project(evaluate(old.model, focused).optics, np.eye(4)[None], points)[0]


@pytest.mark.parametrize("distance_m", DISTANCES_M)
def test_opencv_has_it_where_the_chain_does(distance_m: float, tmp_path: Path) -> None:
    source = calibration_text()
    file = tmp_path / "camera.yaml"
    file.write_text(export_calibration(source, "opencv", distance_m=distance_m).text)
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_READ)
    matrix, distortion = (
        storage.getNode(name).mat() for name in ("camera_matrix", "distortion_coefficients")
    )
    points, expected = _chain(source, distance_m)
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, distortion)
    assert np.abs(pixels[:, 0] - expected).max() < AGREES_PX


@pytest.mark.parametrize("distance_m", DISTANCES_M)
def test_colmap_has_it_where_the_chain_does(distance_m: float, tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap has no wheel for this machine")
    source = calibration_text()
    text = export_calibration(source, "colmap", distance_m=distance_m).text
    (tmp_path / "cameras.txt").write_text(text)
    for empty in ("images.txt", "points3D.txt", "rigs.txt", "frames.txt"):
        (tmp_path / empty).write_text("")
    reconstruction = pycolmap.Reconstruction()
    reconstruction.read_text(str(tmp_path))
    (read,) = reconstruction.cameras.values()
    points, expected = _chain(source, distance_m)
    assert np.abs(read.img_from_cam(points) - 0.5 - expected).max() < AGREES_PX


def test_mrcal_has_it_where_the_chain_does(tmp_path: Path) -> None:
    if not MRCAL.exists():
        pytest.skip("mrcal is not installed from PyPI: run tools/install-mrcal")
    source, distance_m = calibration_text(), DISTANCES_M[0]
    file = tmp_path / "camera.cameramodel"
    file.write_text(export_calibration(source, "mrcal", distance_m=distance_m).text)
    points, expected = _chain(source, distance_m)
    command = [MRCAL, "-c", MRCAL_PROJECTS, file, json.dumps(points.tolist())]
    output = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout
    assert np.abs(np.array(json.loads(output)["pixels"]) - expected).max() < AGREES_PX


@pytest.mark.parametrize("tool", ["ros", "opencv", "mrcal", "kalibr", "colmap"])
def test_without_a_distance_it_is_refused_with_the_range_to_choose_from(tool: str) -> None:
    source = calibration_text()
    assert source.range_m is not None
    with pytest.raises(InputError, match="--distance M") as refused:
        export_calibration(source, tool)
    for distance_m in source.range_m:
        assert f"{distance_m:.3f}" in str(refused.value)
