import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.paper.extrinsics import board_poses, nearest_rotation
from calib.paper.zhang import camera_matrix
from tests.paper.scene import mixed_scene


@pytest.mark.parametrize("sign", [1.0, -3.7])
def test_poses_come_back_whatever_the_homography_s_scale_and_sign(sign: float) -> None:
    true = mixed_scene()
    A = camera_matrix(true.optics)
    columns = true.camera_from_board[:, :3, [0, 1, 3]]
    found = board_poses(sign * A @ columns, A)
    assert np.allclose(found, true.camera_from_board, atol=1e-12)


def test_nearest_rotation_is_a_rotation_where_u_vt_is_a_reflection() -> None:
    rng = np.random.default_rng(0)
    noisy = -Rotation.random(20, rng=rng).as_matrix() + rng.normal(0, 0.1, (20, 3, 3))
    assert np.allclose(np.linalg.det(nearest_rotation(noisy)), 1.0)
