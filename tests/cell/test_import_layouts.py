"""Poses in the layouts that people have: read by names, numbers and pictures, and reported."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.rigid import inverse
from calib.detection.orientation import Closure, RoughPoses
from calib.views import FloatArray, Mount
from cell.errors import InputError
from cell.verbs.importing import RotationName
from cell.verbs.importing.conventions import (
    NOTHING_STATED,
    Candidate,
    Convention,
    PictureCheck,
    StatedConvention,
    conclude,
)
from cell.verbs.importing.pairing import apply, pairings
from cell.verbs.importing.pose_files import flange_series, read_poses, read_series
from cell.verbs.importing.raw import RawPose
from tests.cell.pose_layouts import LAYOUTS, picture_names, table
from tests.paper.scene import BOARD, mixed_scene

FRAMES = 9
SQUARE_M = BOARD.square_m


@cache
def scene(mount: Mount = "eye_in_hand") -> tuple[FloatArray, RoughPoses]:
    views = mixed_scene(2, FRAMES - 2, noise_px=0.3, robot_mm=0.1, mount=mount).views
    return views.base_from_flange, RoughPoses.of(views.corners_px, views.board, mount)


def check(mount: Mount = "eye_in_hand") -> PictureCheck:
    return scene(mount)[1].closure


FLANGE = scene()[0]
P_M, TURNS = FLANGE[:, :3, 3], Rotation.from_matrix(FLANGE[:, :3, :3])
XYZW = TURNS.as_quat()


def read(
    path: Path,
    pictures: Sequence[str],
    stated: StatedConvention = NOTHING_STATED,
    check: PictureCheck | None = None,
    square_m: float = SQUARE_M,
) -> tuple[FloatArray, Convention]:
    """(P, 4, 4) the pictures' poses out of a pose file, and how it was understood."""
    candidates = [
        Candidate(series.poses, pairing, series.notes)
        for series in flange_series(path, read_series(path))
        for pairing in pairings(pictures, series.poses)
    ]
    chosen, convention = conclude(candidates, stated, check, square_m)
    poses = np.array([convention.transform(pose).as_matrix() for pose in chosen.poses])
    return apply(chosen.pairing, poses), convention


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_is_understood_and_reported(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]
    path = layout.write(tmp_path, FLANGE)
    stated = StatedConvention(layout.stated.get("rotation"))
    found, convention = read(path, picture_names(layout, FRAMES), stated, check())
    tolerance = 1e-3 * layout.digits_mm
    np.testing.assert_allclose(found[:, :3, 3], FLANGE[:, :3, 3], atol=tolerance)
    np.testing.assert_allclose(found[:, :3, :3], FLANGE[:, :3, :3], atol=3e-6)
    reported = " ".join(convention.guessed)
    for words in ("positions are in", "are paired", "bear this out"):
        assert words in reported
    assert not convention.contradicted


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize("write", ["quaternions", "matrices"])
def test_poses_the_other_way_round_are_found_out(tmp_path: Path, mount: Mount, write: str) -> None:
    flange = scene(mount)[0]
    back = inverse(flange)
    text = table(back.reshape(FRAMES, 16))
    if write == "quaternions":
        text = table(back[:, :3, 3], Rotation.from_matrix(back[:, :3, :3]).as_quat())
    (tmp_path / "p.txt").write_text(text)
    pictures = [f"{n}.png" for n in range(FRAMES)]
    found, convention = read(tmp_path / "p.txt", pictures, check=check(mount))
    assert convention.inverted
    np.testing.assert_allclose(found, flange, atol=1e-7)


def concluded(
    tmp_path: Path, text: str, stated: StatedConvention = NOTHING_STATED, **more: float
) -> Convention:
    """How rows of poses, in the pictures' order, are understood."""
    (tmp_path / "p.txt").write_text(text)
    pictures = [f"{n}.png" for n in range(FRAMES)]
    return read(tmp_path / "p.txt", pictures, stated, check(), **more)[1]


def test_what_is_stated_wrongly_is_taken_and_contradicted(tmp_path: Path) -> None:
    text = table(P_M, XYZW)
    found = concluded(tmp_path, text, StatedConvention("quat_wxyz", "m", False))
    assert found.rotation == "quat_wxyz"
    assert any("agree with the pictures only to" in words for words in found.contradicted)
    found = concluded(tmp_path, text, StatedConvention("quat_wxyz"))
    assert found.contradicted


def test_poses_of_other_pictures_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="check the poses and which picture each is of"):
        concluded(tmp_path, table(P_M[::-1], XYZW[::-1]))


@pytest.mark.parametrize(("typed", "fits"), [(25.0, "0.025"), (0.018, "0.025"), (0.0025, "0.025")])
def test_a_square_that_contradicts_the_poses_is_refused_with_the_one_that_fits(
    tmp_path: Path, typed: float, fits: str
) -> None:
    (tmp_path / "p.txt").write_text(table(P_M, XYZW))
    rough = scene()[1]

    def typed_check(poses: FloatArray) -> Closure:
        """As the pictures of a board of other squares would close: depths grow with them."""
        found = rough.closure(poses)
        factor = found.length_factor * SQUARE_M / typed
        return Closure(found.angle_rad, found.place_share, factor)

    pictures = [f"{n}.png" for n in range(FRAMES)]
    if 0.6 < SQUARE_M / typed < 1.5:
        _, convention = read(tmp_path / "p.txt", pictures, StatedConvention(), typed_check, typed)
        assert any(f"squares of {fits}" in words for words in convention.contradicted)
        return
    with pytest.raises(InputError, match=f"squares of {fits[:5]}"):
        read(tmp_path / "p.txt", pictures, StatedConvention(), typed_check, typed)


def test_a_unit_stated_wrongly_is_contradicted(tmp_path: Path) -> None:
    found = concluded(tmp_path, table(P_M, XYZW), StatedConvention(unit="mm"))
    assert found.unit == "mm"
    assert any("by a factor of" in words for words in found.contradicted)


def test_mirrored_pictures_are_refused_as_such(tmp_path: Path) -> None:
    views = mixed_scene(2, FRAMES - 2, noise_px=0.3, robot_mm=0.1).views
    mirrored = views.corners_px.reshape(FRAMES, BOARD.rows, BOARD.cols, 2)[:, :, ::-1].copy()
    mirrored[..., 0] = views.width_px - 1 - mirrored[..., 0]
    rough = RoughPoses.of(mirrored.reshape(FRAMES, -1, 2), BOARD)
    (tmp_path / "p.txt").write_text(table(P_M, XYZW))
    pictures = [f"{n}.png" for n in range(FRAMES)]
    with pytest.raises(InputError, match="the pictures are mirrored"):
        read(tmp_path / "p.txt", pictures, check=rough.closure)


def test_undecided_pictures_leave_the_question_to_the_user(tmp_path: Path) -> None:
    still = np.repeat(TURNS[:1].as_rotvec(), FRAMES, axis=0)
    (tmp_path / "p.txt").write_text(table(P_M, still))

    def no_turn(poses: FloatArray) -> Closure:
        return Closure(0.0, 0.0, 1.0)

    with pytest.raises(InputError, match="nothing shows which"):
        read(tmp_path / "p.txt", [f"{n}.png" for n in range(FRAMES)], check=no_turn)


def test_poses_too_far_in_time_are_refused(tmp_path: Path) -> None:
    layout = LAYOUTS["timestamps around the pictures'"]
    path = layout.write(tmp_path, FLANGE)
    poses = flange_series(path, read_series(path))[0].poses
    with pytest.raises(InputError, match="no pose is near enough in time"):
        pairings(picture_names(layout, FRAMES), poses, 1e-4)


BROKEN: dict[str, Callable[[], tuple[str, str]]] = {
    "has 5 numbers": lambda: ("p.txt", "1 2 3 4 5\n"),
    "lacks numbers": lambda: ("p.csv", "x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n1,2,3,0,0,,1\n"),
    "is no JSON": lambda: ("p.json", "{"),
    "holds no pose": lambda: ("p.yaml", "[]\n"),
    "these are joint angles|holds no pose of the flange": lambda: (
        "p.yaml", "joint_names: [a, b, c, d, e, f]\njoint_values:\n  - [0, 1, 2, 3, 4, 5]\n"),
    "no whole OpenCV FileStorage": lambda: (
        "p.yaml", "%YAML:1.0\n---\nT: !!opencv-matrix\n   rows: 4\n   cols: 4\n   data: [ 1"),
}  # fmt: skip


@pytest.mark.parametrize("message", BROKEN)
def test_a_broken_file_is_refused_with_its_place(tmp_path: Path, message: str) -> None:
    name, text = BROKEN[message]()
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        read_poses(tmp_path / name)


def test_a_convention_reads_what_it_says() -> None:
    pose = RigidTransform.from_components(P_M[0], TURNS[0])
    raw = RawPose("here", None, np.concatenate([P_M[0], TURNS[0].as_euler("ZYZ", degrees=True)]))
    rotation: RotationName = "euler_zyz_deg"
    np.testing.assert_allclose(
        Convention(rotation, "m").transform(raw).as_matrix(), pose.as_matrix(), atol=1e-9
    )
