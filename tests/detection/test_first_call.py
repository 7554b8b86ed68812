import cv2
import numpy as np
import pytest
from board_rendering import photograph, pose_homography, render_board

from calib.detection import candidates, detect, lattice, make_ready, marks, saddle
from calib.views import Board

KERNELS = (candidates._rays, lattice._nearest_along, marks._cover, saddle._fit)
CHARUCO = Board("charuco", 6, 4, 0.03, 0.022, "DICT_5X5_100")


def compiled():
    """What the kernels that Python calls have been compiled for in this process."""
    return [list(kernel.signatures) for kernel in KERNELS]


def test_once_made_ready_no_picture_and_no_board_compiles_anything_more():
    make_ready()
    before = compiled()
    assert all(before)
    H = pose_homography(7, 10, square_px=40, centre=(320.0, 240.0), tilt_deg=20)
    clean, _ = render_board((480, 640), H, 7, 10, blur_px=4.0, samples=3)
    grey = photograph(clean)
    for picture in (grey, np.dstack([grey] * 3), grey.astype(np.uint16) * 16, clean, grey[::-1]):
        detect(picture, Board("chessboard", 7, 10, 0.025))
    layout = cv2.aruco.CharucoBoard(
        (5, 7), 0.03, 0.022, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    )
    drawn = layout.generateImage((500, 700), marginSize=40)
    for picture in (drawn, cv2.GaussianBlur(drawn, (0, 0), 5.0)):
        assert detect(picture, CHARUCO)
    assert compiled() == before


@pytest.mark.parametrize("kernel", KERNELS)
def test_kernels_let_the_thread_that_watches_the_arm_run(kernel):
    assert kernel.targetoptions["nogil"]
