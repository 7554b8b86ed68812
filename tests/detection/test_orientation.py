import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from calib.detection import turned_order, turns_to_agree
from calib.views import Board

K = np.array([[900.0, 0, 640], [0, 900, 360], [0, 0, 1]])
FRAMES = 14


def pose(rotvec, p_m):
    return RigidTransform.from_components(p_m, Rotation.from_rotvec(rotvec))


def recording(board, mount, rng):
    """Flange poses and corners of a board in front of the camera, all in one true order."""
    mounted = pose([0.3, -0.2, 1.1], [0.02, 0.05, 0.1])
    fixed = pose([2.0, 0.4, -0.3], [0.5, -0.2, 0.1])
    middle = board.corners_m.mean(axis=0)
    flanges, corners = [], []
    for _ in range(FRAMES):
        turn = Rotation.from_rotvec(rng.normal(0, 0.35, 3)) * Rotation.from_rotvec(
            [0, 0, rng.uniform(-np.pi, np.pi)]
        )
        offset = np.array([*rng.uniform(-0.05, 0.05, 2), 0.6])
        camera_from_board = RigidTransform.from_components(offset - turn.apply(middle), turn)
        if mount == "eye_in_hand":
            base_from_flange = fixed * camera_from_board.inv() * mounted.inv()
        else:
            base_from_flange = fixed * camera_from_board * mounted.inv()
        in_camera = camera_from_board.apply(board.corners_m)
        corners.append((in_camera @ K.T)[:, :2] / in_camera[:, 2:])
        flanges.append(base_from_flange.as_matrix())
    return np.array(flanges), np.array(corners) + rng.normal(
        0, 0.1, (FRAMES, board.corner_count, 2)
    )


def shuffled(board, corners, turns):
    return np.array([c[turned_order(board, int(t))] for c, t in zip(corners, turns, strict=True)])


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize(
    ("rows", "cols", "possible"),
    [(7, 9, (0, 2)), (6, 6, (0, 1, 2, 3)), (7, 7, (0, 2)), (14, 14, (0, 1, 2, 3))],
)
def test_robot_poses_undo_any_turns(rows, cols, possible, mount):
    board = Board("chessboard", rows, cols, 0.02)
    rng = np.random.default_rng(rows + cols)
    base_from_flange, corners = recording(board, mount, rng)
    turns = rng.choice(possible, FRAMES)
    undone = turns_to_agree(shuffled(board, corners, turns), board, base_from_flange, mount)
    assert len(np.unique((turns + undone) % 4)) == 1
    assert undone[0] == 0


def test_a_frame_with_another_frames_pose_spoils_none_of_the_others():
    board = Board("chessboard", 7, 9, 0.02)
    rng = np.random.default_rng(2)
    base_from_flange, corners = recording(board, "eye_in_hand", rng)
    turns = rng.choice((0, 2), FRAMES)
    base_from_flange[[4, 9]] = base_from_flange[[9, 4]]
    undone = turns_to_agree(shuffled(board, corners, turns), board, base_from_flange)
    right = (turns + undone) % 4 == turns[0]
    assert np.delete(right, [4, 9]).all()


def test_frames_without_a_pose_follow_their_neighbours():
    board = Board("chessboard", 7, 9, 0.02)
    rng = np.random.default_rng(3)
    base_from_flange, corners = recording(board, "eye_in_hand", rng)
    corners[6] = corners[5] + 3.0
    base_from_flange[6] = np.nan
    turns = rng.choice((0, 2), FRAMES)
    undone = turns_to_agree(shuffled(board, corners, turns), board, base_from_flange)
    assert len(np.unique((turns + undone) % 4)) == 1


def test_without_poses_the_order_follows_the_least_rotation():
    board = Board("chessboard", 7, 9, 0.02)
    grid = board.corners_m[:, :2] * 3000 + 200
    rolls = np.deg2rad(np.arange(0, 360, 30))
    spin = np.stack([np.cos(rolls), -np.sin(rolls), np.sin(rolls), np.cos(rolls)], axis=-1)
    corners = (grid - 400) @ spin.reshape(-1, 2, 2).transpose(0, 2, 1) + 400
    turns = np.random.default_rng(4).choice((0, 2), len(rolls))
    turns[0] = 0
    undone = turns_to_agree(shuffled(board, corners, turns), board)
    np.testing.assert_array_equal((turns + undone) % 4, 0)


def test_where_colours_name_the_ends_nothing_is_turned():
    board = Board("chessboard", 7, 10, 0.02)
    rng = np.random.default_rng(5)
    base_from_flange, corners = recording(board, "eye_in_hand", rng)
    np.testing.assert_array_equal(turns_to_agree(corners, board, base_from_flange), 0)
