"""The paper's two cells, as far as its numbers let them be built.

Source: C. Ricolfe-Viala, "The influence of the focus in the camera calibration process". What
the paper says does not all fit together; this is what was taken, and why.

Taken from its Table 2 ("proposed method"): alpha, beta, u0, v0, gamma, k1, k2 of both cameras.
They are what its tables and figures compare, so simulated tables can stand beside them.

Not taken:

- The 12CXP+ with an 18 mm lens and 5.625 um pixels (23.04 mm over 4096) has alpha = 3200 px, not
  4755.8 px, which would be a 26.75 mm lens. "23.04 x 23.04 mm" for 4096 x 3072 pixels would need
  pixels that are not square; square pixels of 5.625 um are taken. The 18 mm serve for the
  aperture only, where no other number exists.
- "A4 fits in the picture at 300 mm" holds for 3200 px, not for 4755.8 px: there 4096 x 3072 pixels
  see 258 x 194 mm. The printed squares (275 x 200 mm) fit from 0.33 m on; runs begin at 0.35 m.
- "Zone 1 of the Robotiq camera ends at 150 mm": with alpha = 1370.8 px a board of that size is
  seen whole from 0.38 m on, its corners from 0.3 m. Runs begin at 0.34 m: in zone 2, like its own.
- Series up to 2.7 m (12CXP+) and 1.2 m (Robotiq): an IRB 140 reaches 0.8 m, a UR3 0.5 m. With the
  board upright 1.2 m in front of the IRB 140 the camera stands 0.35 m to 0.95 m away; with it
  0.76 m in front of the UR3, 0.34 m to 0.56 m. For farther views the board has to be moved.

Focus breathing: Eq. 25, alpha = alpha0 - k / d^2. The paper gives no k, and two of its statements
ask for different ones. If alpha is to be constant to a percent beyond 0.7 m, k is at most
23 px m^2; but its Zhang fit, all of whose views lie in zone 1, finds 4289.8 px, and a fit cannot
find less than the least alpha among its views. So k is taken such that alpha is 4289.8 px at the
nearest view, 0.35 m: k = (4755.8 - 4289.8) 0.35^2 = 57.1 px m^2. At 0.7 m, where the paper sees
zone 1 end in a plot of scattered points, alpha is then 2.45 % below alpha0; the same 2.45 % at the
Robotiq camera's 0.15 m give 0.756 px m^2. With a tolerance of 0.1 % zone 1 would reach to 3.5 m.
Eq. 25 lets alpha fall when the lens focuses near. A lens that focuses by moving as a whole does the
opposite (alpha = alpha_inf d / (d - f)); the sign stays the paper's here.

The board is a 10 x 7 grid of inner corners, 25 mm apart: 11 x 8 squares, 275 x 200 mm, the largest
with that square on an A4 sheet. The paper says 25 mm and A4, not how many.

Scatter: position repeatability RP by ISO 9283 of the data sheets (IRB 140 0.03 mm, UR3 0.1 mm).
RP is a mean radius plus three sigmas of it, 3.6 sigmas of one axis for round scatter.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.effects import make_effect
from calib.chain.model import CellModel
from calib.chain.optics import optics_row
from calib.views import Board, FloatArray
from sim.arm import Repeatability
from sim.cell import CameraSpec, SimulatedCell

BOARD = Board("chessboard", rows=7, cols=10, square_m=0.025)

_LOSS_AT_END_OF_ZONE_1 = 0.0245
"""Of alpha, see above."""
_RP_IN_SIGMAS = 3.6
_LEVER_M = 0.3
"""Rotation scatters by what position does at that lever; no data sheet states it."""


def irb140_eosens(seed: int = 0) -> SimulatedCell:
    """ABB IRB 140 with a Mikrotron EoSens 12CXP+ on its flange, focused before each picture."""
    optics = optics_row(
        alpha_px=4755.8,
        beta_px=4789.1,
        skew_px=0.0012,
        u0_px=2052.3,
        v0_px=1548.5,
        k1=0.0022,
        k2=0.0570,
        height_px=3072,
    )
    return SimulatedCell(
        name="irb140-eosens",
        robot_model="irb140",
        home_rad=np.array([0.0, -0.02, 0.23, 0.0, -0.21, 0.0]),
        board=BOARD,
        model=_paper_model(
            optics,
            _pose([0.0303, -0.0008, 0.1012], [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], [0.4, -0.7, 0.6]),
            _upright_board(1.2, 0.58, [-0.5, 0.3, 0.8]),
            zone_1_ends_m=0.7,
        ),
        camera=CameraSpec(
            width_px=4096,
            height_px=3072,
            pixel_size_m=5.625e-6,
            focal_length_m=0.018,
            f_number=8.0,
            nearest_focus_m=0.2,
        ),
        repeatability=_repeatability(3e-5),
        corner_sigma_px=0.05,
        payload_kg=1.2,
        seed=seed,
    )


def ur3_robotiq(seed: int = 0) -> SimulatedCell:
    """Universal Robots UR3 with a Robotiq wrist camera, focused before each picture.

    The camera sits 35.7 mm beside the flange's axis and looks 30 degrees towards it, as
    integrators measured it. Robotiq publishes neither focal length nor f-number of its liquid
    lens: 5 mm at f/2.8 are assumed, for the aperture only.
    """
    optics = optics_row(
        alpha_px=1370.8,
        beta_px=1373.8,
        skew_px=0.0001,
        u0_px=645.8,
        v0_px=359.3,
        k1=0.0087,
        k2=-0.072,
        height_px=724,
    )
    slant = Rotation.from_euler("x", 30, degrees=True).as_matrix()
    return SimulatedCell(
        name="ur3-robotiq",
        robot_model="ur3",
        home_rad=np.array([0.544, -1.337, -2.229, -0.169, 1.106, 0.294]),
        board=BOARD,
        model=_paper_model(
            optics,
            _pose([0.0006, 0.0357, -0.0001], slant, [0.5, 0.6, -0.4]),
            _upright_board(0.76, 0.30, [0.6, -0.4, 0.5]),
            zone_1_ends_m=0.15,
        ),
        camera=CameraSpec(
            width_px=1279,
            height_px=724,
            focal_length_m=0.005,
            f_number=2.8,
            nearest_focus_m=0.07,
        ),
        repeatability=_repeatability(1e-4),
        corner_sigma_px=0.05,
        payload_kg=0.16,
        seed=seed,
    )


def _paper_model(
    optics: FloatArray,
    flange_from_camera: FloatArray,
    base_from_board: FloatArray,
    *,
    zone_1_ends_m: float,
) -> CellModel:
    k_px_m2 = _LOSS_AT_END_OF_ZONE_1 * float(optics[0]) * zone_1_ends_m**2
    breathing = make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": k_px_m2})
    return CellModel(optics, flange_from_camera, base_from_board, effects=(breathing,))


def _upright_board(distance_m: float, height_m: float, tilt_deg: list[float]) -> FloatArray:
    """base_from_board of a board that faces the base; its middle straight ahead at that height."""
    half_width, half_height = 4.5 * BOARD.square_m, 3.0 * BOARD.square_m
    facing = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    return _pose([distance_m, half_width, height_m + half_height], facing, tilt_deg)


def _pose(
    position_m: list[float], axes: list[list[int]] | FloatArray, turn_deg: list[float]
) -> FloatArray:
    """A transform by its nominal axes and the small turn by which a bracket is never square."""
    turn = Rotation.from_matrix(np.asarray(axes, float)) * Rotation.from_rotvec(
        turn_deg, degrees=True
    )
    return np.asarray(RigidTransform.from_components(position_m, turn).as_matrix())


def _repeatability(rp_m: float) -> Repeatability:
    sigma_m = rp_m / _RP_IN_SIGMAS
    return Repeatability(sigma_m, sigma_m / _LEVER_M)
