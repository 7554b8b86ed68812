"""A simulated camera: it renders what the arm's true pose shows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from calib.chain import rigid
from calib.chain.model import CellModel, Errors, evaluate
from calib.chain.state import ChainState
from calib.views import FloatArray, Views
from drivers.camera import FocusSetting, Frame
from drivers.errors import DeviceRefused, DeviceUnreachable, FrameMissing
from sim.arm import ArmTruth
from sim.cell import SENSOR_STREAM, SimulatedCell
from sim.clock import Clock
from sim.log import Row, temperature_c, views_of
from sim.render import Blur, Image, expose, render

READOUT_S = 0.02
FOCUSING_S = 0.3
_EXPOSURE_RANGE_S = (1e-5, 1.0)
_GAIN_RANGE_DB = (0.0, 24.0)


class KnowsItsTruth(Protocol):
    """An arm that reports where it is; `SimArm` does."""

    def truth(self) -> ArmTruth:
        """Joints now, and by how much the flange misses the reported pose."""


@dataclass
class CameraFaults:
    """What tests and demonstrations let go wrong.

    Attributes
    ----------
    lose_frames:
        So many of the next triggers bring no frame.
    dead:
        Every call raises `DeviceUnreachable`.
    """

    lose_frames: int = 0
    dead: bool = False


class SimCamera:
    """A camera in this process; see `drivers.camera.Camera`.

    Parameters
    ----------
    cell:
        The truth it shows.
    arm:
        Whose flange it rides on, or whose flange carries the board.
    clock:
        The time it shares with the arm.
    render_ahead:
        Render while the lens still moves, for a clock that goes on meanwhile: light needs no time
        to compute a picture. Where the arm or the lens is elsewhere then, it is rendered anew.
    """

    tried_on_hardware = False

    def __init__(
        self, cell: SimulatedCell, arm: KnowsItsTruth, clock: Clock, *, render_ahead: bool = False
    ) -> None:
        self.faults = CameraFaults()
        self._cell, self._arm, self._clock = cell, arm, clock
        self._render_ahead = render_ahead
        self._rendered: tuple[bytes, Image] | None = None
        self._noise = cell.placed_noise(SENSOR_STREAM)
        self._connected_s: float | None = None
        self._exposure_s = 0.8 * cell.camera.sensor.white_exposure_s
        self._gain_db = 0.0
        self._focus_distance_m = cell.camera.focus_distance_m
        self._seen: list[tuple[Row, FloatArray]] = []  # effects with a memory need them all

    # -- the protocol ------------------------------------------------------------------------

    def connect(self) -> None:
        """Open; a lens without a set focus is focused on the board as it stands."""
        self._check_alive(connected=True)
        if self._connected_s is None:
            self._connected_s = self._clock.now()
        if self._focus_distance_m is None:
            self._focus_distance_m = self._distance_m()

    def configure(
        self, *, exposure_s: float | None = None, gain_db: float | None = None
    ) -> Mapping[str, float]:
        """Set exposure and gain; raises `DeviceRefused` outside their ranges."""
        self._check_alive(self._connected_s is not None)
        if exposure_s is not None:
            self._exposure_s = _within("exposure_s", exposure_s, _EXPOSURE_RANGE_S)
        if gain_db is not None:
            self._gain_db = _within("gain_db", gain_db, _GAIN_RANGE_DB)
        return {"exposure_s": self._exposure_s, "gain_db": self._gain_db}

    def focus(self, setting: FocusSetting) -> float | None:
        """Focus and wait; returns the drive's step, None for a lens without a drive.

        Raises
        ------
        DeviceRefused
            A lens without a drive is asked to move, or a step lies outside the drive's range.
        """
        self._check_alive(self._connected_s is not None)
        spec = self._cell.camera
        if setting.mode != "hold":
            if spec.focus not in ("auto", "motorised"):
                raise DeviceRefused(
                    f"simulated camera: its lens is {spec.focus} and cannot focus by itself; "
                    "use focus: hold in the plan"
                )
            began_s = self._clock.now()
            self._focus_distance_m = self._focused(setting)
            if self._render_ahead:
                self._picture(*self._look([self._seen_now()]))
            self._clock.sleep(began_s + FOCUSING_S - self._clock.now())
        return self._focus_position()

    def grab(self, timeout_s: float) -> Frame:
        """Expose and render; raises `FrameMissing` where that was asked for."""
        self._check_alive(self._connected_s is not None)
        if self.faults.lose_frames > 0:
            self.faults.lose_frames -= 1
            self._clock.sleep(timeout_s)
            raise FrameMissing(f"simulated camera: no frame within {timeout_s} s")
        self._clock.sleep(0.5 * self._exposure_s)
        middle_s = self._clock.now()
        self._seen.append(self._seen_now())
        frame = self._frame(self._picture(*self._look()), middle_s)
        self._clock.sleep(middle_s + 0.5 * self._exposure_s + READOUT_S - self._clock.now())
        return frame

    def close(self) -> None:
        """Let go."""
        self._connected_s = None

    def has_seen(
        self, row: Row, flange_error: FloatArray, connected_s: float, focus_m: float | None
    ) -> None:
        """Take in a frame of an interrupted run, before connecting to go on with it.

        Parameters
        ----------
        row, flange_error:
            As the frame was taken; its time counts from `connected_s`.
        connected_s:
            When the interrupted run connected, on the clock.
        focus_m:
            Where the lens stood focused, or None where nothing states.
        """
        self._connected_s = connected_s
        self._focus_distance_m = self._focus_distance_m if focus_m is None else focus_m
        self._seen.append((row, flange_error))
        self._noise.at(row.joints_rad)

    # -- inside ------------------------------------------------------------------------------

    def _focused(self, setting: FocusSetting) -> float:
        if setting.mode == "auto":
            return self._distance_m()
        if setting.mode != "position" or setting.position is None:
            raise DeviceRefused(
                f"simulated camera: cannot focus by mode {setting.mode!r} at {setting.position}; "
                "it knows hold, auto, and position with a step"
            )
        spec = self._cell.camera
        steps = _within("focus position", setting.position, (0.0, float(spec.focus_steps)))
        return spec.focus_distance_at(steps)

    def _focus_position(self) -> float | None:
        spec = self._cell.camera
        if spec.focus not in ("auto", "motorised") or self._focus_distance_m is None:
            return None
        share = 1.0 - spec.nearest_focus_m / self._focus_distance_m
        return float(np.clip(round(spec.focus_steps * share), 0, spec.focus_steps))

    def _distance_m(self) -> float:
        """Depth of the board's centre as the arm stands now."""
        return float(self._evaluate([self._seen_now()])[1].distance_m[-1])

    def _seen_now(self) -> tuple[Row, FloatArray]:
        """The arm as it stands, and its flange's error."""
        truth = self._arm.truth()
        return self._row(truth, self._clock.now()), truth.flange_error

    def _row(self, truth: ArmTruth, t_s: float) -> Row:
        return Row(
            t_s - (self._connected_s or 0.0),
            truth.joints_rad,
            truth.joint_velocity_rad_s,
            truth.approach_joints_rad,
            self._exposure_s,
        )

    def _evaluate(self, more: list[tuple[Row, FloatArray]]) -> tuple[Views, ChainState]:
        """The chain over every frame so far and `more`."""
        seen = [*self._seen, *more]
        views = views_of(self._cell, [row for row, _ in seen])
        errors = np.array([error for _, error in seen])
        return views, evaluate(self._cell.model, views, errors=Errors(errors))

    def _look(
        self, more: list[tuple[Row, FloatArray]] | None = None
    ) -> tuple[ChainState, FloatArray]:
        views, state = self._evaluate(more or [])
        focus = self._focus_distance_m
        if focus is None or abs(focus - state.distance_m[-1]) < 1e-6:
            return state, state.optics[-1]
        return state, optics_focused_at(self._cell.model, views, state, focus)

    def _picture(self, state: ChainState, optics: FloatArray) -> Image:
        spec = self._cell.camera
        focus = self._focus_distance_m or float(state.distance_m[-1])
        pose = state.camera_from_board[-1]
        shown = b"".join(a.tobytes() for a in (state.points_m, optics, pose, np.array(focus)))
        if self._rendered is None or self._rendered[0] != shown:
            image = render(
                self._cell.board,
                state.points_m,
                optics,
                pose,
                width_px=spec.width_px,
                height_px=spec.height_px,
                blur=Blur(spec.aperture_m, focus, spec.lens_sigma_px),
                straightened=state.straightened if state.picture_fields else None,
            )
            self._rendered = shown, image
        return self._rendered[1]

    def _frame(self, reflectance: Image, middle_s: float) -> Frame:
        image = expose(
            reflectance,
            self._cell.camera.sensor,
            exposure_s=self._exposure_s,
            gain_db=self._gain_db,
            rng=self._noise.at(self._seen[-1][0].joints_rad),
        )
        since_connect_s = middle_s - (self._connected_s or 0.0)
        return Frame(
            image=image,
            host_t_s=middle_s,
            device_t_s=since_connect_s,
            exposure_s=self._exposure_s,
            gain_db=self._gain_db,
            focus_position=self._focus_position(),
            focus_distance_m=self._focus_distance_m,
            temperature_c=float(temperature_c(since_connect_s)),
        )

    def _check_alive(self, connected: bool) -> None:
        if self.faults.dead:
            raise DeviceUnreachable("simulated camera: it does not answer")
        if not connected:
            raise DeviceUnreachable("simulated camera: not connected; call connect() first")


def optics_focused_at(
    model: CellModel, views: Views, state: ChainState, focus_distance_m: float
) -> FloatArray:
    """(K,) optics of the last frame with the lens focused elsewhere than on the board.

    The chain's lens focuses on the board's centre; so the board is put where the lens is focused
    and the chain is asked again.
    """
    shift = np.eye(4)
    shift[2, 3] = focus_distance_m - state.distance_m[-1]
    base_from_board = state.base_from_camera[-1] @ shift @ state.camera_from_board[-1]
    if state.in_hand:
        moved = replace(model, base_from_fixed=base_from_board)
    else:
        flange_from_base = rigid.inverse(state.base_from_flange[-1])
        moved = replace(model, flange_from_mounted=flange_from_base @ base_from_board)
    return np.asarray(evaluate(moved, views).optics[-1])


def _within(name: str, value: float, bounds: tuple[float, float]) -> float:
    if not bounds[0] <= value <= bounds[1]:
        raise DeviceRefused(f"simulated camera: {name} {value} is outside {bounds[0]}..{bounds[1]}")
    return value
