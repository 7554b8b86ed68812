"""What the calibration works on: a board, and views of it with what the robot logged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from calib.mount import Mount as Mount

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Board:
    """A planar target; its corners are named (row, col).

    For a chessboard `rows` and `cols` count inner corners; for a ChArUco board they are
    `squares_y - 1` and `squares_x - 1`; for an AprilGrid they count the corners of tags, two a tag.
    With tag 0 at the bottom left, as Kalibr prints it, an AprilGrid's row 0 is the uppermost.

    Attributes
    ----------
    kind, rows, cols, square_m:
        What it is, its inner corners, and the side of a square (of a tag) in metres.
    marker_m, dictionary:
        ChArUco: marker side in metres, OpenCV dictionary name; AprilGrid: the latter alone.
    gap_m:
        AprilGrid only: between two tags.
    """

    kind: Literal["chessboard", "charuco", "aprilgrid"]
    rows: int
    cols: int
    square_m: float
    marker_m: float | None = None
    dictionary: str | None = None
    gap_m: float | None = None

    @property
    def identified(self) -> bool:
        """Whether markers name its corners, so that any part of it will do."""
        return self.kind != "chessboard"

    @property
    def places(self) -> tuple[FloatArray, FloatArray]:
        """(cols,) and (rows,) where the corners stand along the board, in squares."""
        return self._along(self.cols), self._along(self.rows)

    def _along(self, count: int) -> FloatArray:
        if self.kind != "aprilgrid":
            return np.arange(count, dtype=float)
        tag, corner = np.divmod(np.arange(count), 2)
        return np.asarray(tag * (1 + float(self.gap_m or 0.0) / self.square_m) + corner)

    @property
    def extent_m(self) -> tuple[float, float]:
        """From the first corner to the last, along columns and along rows."""
        across, down = self.places
        return float(across[-1] * self.square_m), float(down[-1] * self.square_m)

    @property
    def corner_count(self) -> int:
        """Number of inner corners."""
        return self.rows * self.cols

    @property
    def corners_m(self) -> FloatArray:
        """(rows*cols, 3) nominal corners in the board frame, metres, row by row, z = 0.

        Origin at corner (0, 0), x along columns, y along rows, z away from the viewer.
        """
        x, y = (part.ravel() for part in np.meshgrid(*self.places))
        return np.stack([x, y, 0 * x], axis=1) * self.square_m


@dataclass(frozen=True)
class Views:
    """N views of one board, as plain arrays; a value that was not logged is NaN.

    Attributes
    ----------
    board, mount, width_px, height_px:
        The target, where the camera sits, the image's size.
    frame:
        (N,) frame numbers, in the order of the recording.
    corners_px:
        (N, M, 2) detected corners, pixels, (0, 0) at the centre of the top-left pixel.
    base_from_flange:
        (N, 4, 4) logged flange poses.
    joints_rad, joint_velocity_rad_s, approach_joints_rad:
        (N, J) logged joints, their speeds, and the joints the move came from.
    t_s, temperature_c, focus_position, focus_distance_m, exposure_s:
        (N,) further columns of the log.
    corner_sigma_px:
        (N, M) the detector's own one-sigma per axis.
    blur_px:
        (N,) edge blur (Gaussian sigma) of the frame, where pictures were seen.
    robot_model:
        Name of the arm's kinematic model, or None.
    payload_kg:
        Mass at the flange, where known.
    moving:
        True when the frames were captured in motion.
    extra:
        Key to (N,) further numbers of the log, whatever they are called.
    labels:
        Key to (N,) words of the log (the name of a station); empty where there is none.
    """

    board: Board
    mount: Mount
    width_px: int
    height_px: int
    frame: NDArray[np.int64]
    corners_px: FloatArray
    base_from_flange: FloatArray
    joints_rad: FloatArray
    joint_velocity_rad_s: FloatArray
    approach_joints_rad: FloatArray
    t_s: FloatArray
    temperature_c: FloatArray
    focus_position: FloatArray
    focus_distance_m: FloatArray
    exposure_s: FloatArray
    corner_sigma_px: FloatArray
    blur_px: FloatArray
    robot_model: str | None = None
    payload_kg: float | None = None
    moving: bool = False
    extra: Mapping[str, FloatArray] = field(default_factory=dict)
    labels: Mapping[str, NDArray[np.str_]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.frame)

    @cached_property
    def seen(self) -> BoolArray:
        """(N, M) which corners were detected."""
        return np.asarray(np.isfinite(self.corners_px).all(axis=2))

    @cached_property
    def has_pose(self) -> BoolArray:
        """(N,) which frames have a logged flange pose."""
        return np.asarray(np.isfinite(self.base_from_flange).all(axis=(1, 2)))

    def logged(self, key: str) -> FloatArray:
        """(N,) that number of the log, one of the named columns or a further key; else NaN."""
        if key in _PER_FRAME:
            return np.asarray(getattr(self, key))
        return self.extra.get(key, np.full(len(self), np.nan))

    def take(self, index: NDArray[np.int64] | BoolArray) -> Views:
        """The views at `index` (integers or a mask), in that order."""
        return replace(
            self,
            extra={key: column[index] for key, column in self.extra.items()},
            labels={key: column[index] for key, column in self.labels.items()},
            **{name: getattr(self, name)[index] for name in _PER_FRAME},
        )

    def joined(self, other: Views) -> Views:
        """These views and those of `other` (of the same cell), in the order of their frames."""
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in _PER_FRAME
        }
        both = replace(
            self,
            extra=_end_to_end(self, other, "extra", np.nan),
            labels=_end_to_end(self, other, "labels", ""),
            **columns,
        )
        return both.take(np.argsort(both.frame, kind="stable"))

    @classmethod
    def from_corners(
        cls,
        board: Board,
        corners_px: FloatArray,
        *,
        image_size_px: tuple[int, int],
        base_from_flange: FloatArray | RigidTransform | None = None,
        mount: Mount = "eye_in_hand",
        robot_model: str | None = None,
        **logged: FloatArray,
    ) -> Views:
        """Views of corners found elsewhere.

        Parameters
        ----------
        board:
            The target.
        corners_px:
            (N, M, 2) or (N, rows, cols, 2) pixels, row by row, (0, 0) at the centre of the
            top-left pixel; NaN where a corner was not found. Every frame names the corners alike.
        image_size_px:
            (width, height).
        base_from_flange:
            N flange poses in the robot's base, metres: (N, 4, 4), or a
            `scipy.spatial.transform.RigidTransform`; NaN or None where none was logged.
        mount:
            Whether the camera or the board sits on the flange.
        robot_model:
            Name of the arm's kinematic model, where joints are given.
        **logged:
            Further columns of the class: `joints_rad`, `t_s`, `temperature_c`, ...

        Raises
        ------
        ValueError
            An array has the wrong shape, or a column is not known.
        """
        corners = _checked_corners(corners_px, board)
        width_px, height_px = image_size_px
        views = cls.blank(
            board, width_px=width_px, height_px=height_px, frames=len(corners), mount=mount
        )
        columns: dict[str, Any] = {"corners_px": corners}
        if base_from_flange is not None:
            given = base_from_flange
            logged["base_from_flange"] = given.as_matrix() if hasattr(given, "as_matrix") else given
        for name, value in logged.items():
            if name not in _PER_FRAME:
                raise ValueError(f"{name} is not a column; known are {', '.join(_PER_FRAME)}")
            columns[name] = _checked_column(name, value, getattr(views, name))
        if "frame" in columns:
            columns["frame"] = columns["frame"].astype(np.int64)
        return replace(views, robot_model=robot_model, **columns)

    @classmethod
    def blank(
        cls,
        board: Board,
        *,
        width_px: int,
        height_px: int,
        frames: int,
        mount: Mount = "eye_in_hand",
        joints: int = 6,
    ) -> Views:
        """Views with every logged value missing, to be filled with `dataclasses.replace`."""

        def missing(*shape: int) -> FloatArray:
            return np.full((frames, *shape), np.nan)

        return cls(
            board=board,
            mount=mount,
            width_px=width_px,
            height_px=height_px,
            frame=np.arange(frames),
            corners_px=missing(board.corner_count, 2),
            base_from_flange=missing(4, 4),
            joints_rad=missing(joints),
            joint_velocity_rad_s=missing(joints),
            approach_joints_rad=missing(joints),
            t_s=missing(),
            temperature_c=missing(),
            focus_position=missing(),
            focus_distance_m=missing(),
            exposure_s=missing(),
            corner_sigma_px=missing(board.corner_count),
            blur_px=missing(),
        )


def _end_to_end(first: Views, second: Views, name: str, missing: float | str) -> dict[str, Any]:
    """Further columns of both, with `missing` where one of them does not have a key."""
    columns = [(getattr(views, name), len(views)) for views in (first, second)]
    keys = list(dict.fromkeys(key for column, _ in columns for key in column))
    return {
        key: np.concatenate([c[key] if key in c else np.full(n, missing) for c, n in columns])
        for key in keys
    }


def _checked_corners(corners_px: FloatArray, board: Board) -> FloatArray:
    """(N, M, 2) of corners given so or as (N, rows, cols, 2)."""
    corners = np.asarray(corners_px, dtype=np.float64)
    if corners.ndim == 4 and corners.shape[1:] == (board.rows, board.cols, 2):
        return corners.reshape(len(corners), -1, 2)
    if corners.ndim == 3 and corners.shape[1:] == (board.corner_count, 2):
        return corners
    raise ValueError(
        f"corners_px has the shape {corners.shape}; a board of {board.rows} rows and {board.cols}"
        f" columns needs (N, {board.corner_count}, 2) or (N, {board.rows}, {board.cols}, 2)"
    )


def _checked_column(name: str, value: FloatArray, blank: FloatArray) -> FloatArray:
    column = np.asarray(value, dtype=np.float64)
    if column.shape[0] != len(blank) or column.ndim != blank.ndim:
        raise ValueError(f"{name} has the shape {column.shape}; {blank.shape} is needed")
    return column


_PER_FRAME = (
    "frame",
    "corners_px",
    "base_from_flange",
    "joints_rad",
    "joint_velocity_rad_s",
    "approach_joints_rad",
    "t_s",
    "temperature_c",
    "focus_position",
    "focus_distance_m",
    "exposure_s",
    "corner_sigma_px",
    "blur_px",
)
