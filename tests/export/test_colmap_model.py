"""A recording as a COLMAP model: pycolmap finds every corner where the chain has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from calibrations import STILL, write
from scipy.spatial.transform import RigidTransform, Rotation
from test_export_poses import part
from typer.testing import CliRunner

from calib.chain.optics import optics_row
from calib.chain.projection import project
from calib.views import Board, FloatArray
from cell.cli.app import app
from cell.errors import InputError
from cell.storage.recording import (
    Corners,
    FrameRecord,
    Header,
    PoseRecord,
    RecordingWriter,
    write_corners,
)

BOARD = Board("chessboard", 5, 6, 0.03)
HAND = RigidTransform.from_components([0.01, -0.04, 0.07], Rotation.from_rotvec([0.1, -0.2, 0.7]))
SPOT = RigidTransform.from_components([0.6, 0.1, 0.02], Rotation.from_rotvec([3.0, 0.1, 0.2]))
OPTICS = {name: STILL["solutions"]["joint_ml"][name] for name in
          ("alpha_px", "beta_px", "u0_px", "v0_px", "k1", "k2")}  # fmt: skip
AGREES_PX = 1e-4
"""`detections.csv` keeps as much."""
UNSEEN = 7


def _camera_from_board() -> list[RigidTransform]:
    turns = Rotation.from_euler("xyz", [[0, 0, 0], [20, 0, 10], [0, -25, 40], [-15, 10, 95]], True)
    return [
        RigidTransform.from_components([-0.07, -0.05, 0.5 + 0.05 * k], turn)
        for k, turn in enumerate(turns)
    ]


def _recorded(folder: Path, mount: str) -> FloatArray:
    """A recording and its calibration; (frames, corners, 2) where the chain has the corners."""
    header = Header.model_validate(
        {
            "schema": "cell.recording/1",
            "camera": {"width": 4096, "height": 3072},
            "board": {"type": "chessboard", "rows": 5, "cols": 6, "square_m": 0.03},
            "mount": mount,
        }
    )
    in_hand = mount == "eye_in_hand"
    places = _camera_from_board()
    with RecordingWriter.create(folder, header) as writer:
        for k, place in enumerate(places):
            flange = SPOT * (HAND * place).inv() if in_hand else HAND * place * SPOT.inv()
            writer.append(FrameRecord(frame=2 * k, base_from_flange=PoseRecord.of(flange)))
        writer.append(FrameRecord(frame=99))
    matrices = np.array([place.as_matrix() for place in places])
    pixels = project(
        np.repeat(optics_row(**OPTICS)[None], len(places), axis=0), matrices, BOARD.corners_m
    )
    pixels[1, UNSEEN] = np.nan
    found = Corners({2 * k: px for k, px in enumerate(pixels)})
    write_corners(folder / "detections.csv", found, BOARD)
    camera, board = ("flange_from_camera", "base_from_board") if in_hand else (
        "base_from_camera", "flange_from_board")  # fmt: skip
    write(folder, STILL | {camera: part(HAND), board: part(SPOT)})
    return pixels


def _exported(folder: Path, mount: str) -> tuple[Path, FloatArray]:
    recording, model = folder / "recording", folder / "model"
    pixels = _recorded(recording, mount)
    arguments = ["export", str(recording), "--format", "colmap", "--views", str(recording)]
    done = CliRunner().invoke(app, [*arguments, "-o", str(model)])
    assert done.exit_code == 0, done.output
    return model, pixels


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize("newer", [True, False], ids=["rigs and frames", "images alone"])
def test_pycolmap_sees_every_corner_where_the_chain_does(
    newer: bool, mount: str, tmp_path: Path
) -> None:
    """With `rigs.txt` and `frames.txt`, which newer versions take, and as older ones read it."""
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap has no wheel for this machine")
    model, pixels = _exported(tmp_path, mount)
    if not newer:
        (model / "rigs.txt").unlink()
        (model / "frames.txt").unlink()
    read = pycolmap.Reconstruction()
    read.read_text(str(model))
    assert sorted(read.images) == [1, 3, 5, 7]
    for k, seen in enumerate(read.images[name] for name in sorted(read.images)):
        assert seen.has_pose
        expected = pixels[k][np.isfinite(pixels[k]).all(axis=1)]
        assert seen.num_points3D == len(expected) == BOARD.corner_count - (k == 1)
        for corner, px in zip(seen.points2D, expected, strict=True):
            point = read.points3D[corner.point3D_id].xyz
            assert np.abs(corner.xy - 0.5 - px).max() < AGREES_PX
            assert np.abs(seen.project_point(point) - 0.5 - px).max() < AGREES_PX
    assert read.points3D[1 + UNSEEN].track.length() == 3


def test_a_pose_in_images_and_in_frames_is_the_same(tmp_path: Path) -> None:
    """pycolmap takes that of `frames.txt` and does not say where the other differs."""
    model, _ = _exported(tmp_path, "eye_in_hand")
    images = [line.split() for line in _lines(model / "images.txt")[::2]]
    frames = [line.split() for line in _lines(model / "frames.txt")]
    assert [line[1:8] for line in images] == [line[2:9] for line in frames]
    assert all(line[9:] == ["1", "CAMERA", "1", line[0]] for line in frames)


def _lines(path: Path) -> list[str]:
    return [line for line in path.read_text().splitlines() if not line.startswith("#")]


@pytest.mark.parametrize(
    ("tool", "output", "words"),
    [("colmap", [], "say which with -o FOLDER"), ("ros", ["-o", "x"], "no pictures; colmap does")],
)
def test_a_model_needs_a_folder_and_colmap(
    tool: str, output: list[str], words: str, tmp_path: Path
) -> None:
    _recorded(tmp_path / "r", "eye_in_hand")
    arguments = ["export", str(tmp_path / "r"), "--format", tool, "--views", str(tmp_path / "r")]
    refused = CliRunner().invoke(app, [*arguments, *output])
    assert isinstance(refused.exception, InputError)
    assert words in str(refused.exception)


def test_a_calibration_of_the_other_mount_is_refused(tmp_path: Path) -> None:
    _recorded(tmp_path / "r", "eye_in_hand")
    write(tmp_path / "r", STILL | {"base_from_camera": part(HAND), "flange_from_board": part(SPOT)})
    arguments = ["export", str(tmp_path / "r"), "--format", "colmap", "-o", str(tmp_path / "m")]
    refused = CliRunner().invoke(app, [*arguments, "--views", str(tmp_path / "r")])
    assert isinstance(refused.exception, InputError)
    assert "with this recording's mount" in str(refused.exception)
    assert not (tmp_path / "m").exists()
