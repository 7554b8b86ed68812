"""Whether the camera still is what the old calibration says, and if not, what changed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calib.chain.rigid import inverse, to_vector
from calib.distributions import chi2_limit, chi2_tail
from calib.errors import CalibrationError
from calib.solver.noise import Noise
from calib.views import BoolArray, FloatArray, Views
from cell.verbs.verify.board import board_before, board_now
from cell.verbs.verify.change import Change, explain
from cell.verbs.verify.old_cell import OldCell

Verdict = Literal["good", "moved", "lens_changed", "moved_and_lens_changed", "changed"]

SIGNIFICANT = 0.01
"""A camera that nothing happened to falls below it once in a hundred times."""

FRAMES_NEEDED = 4
_WRONG_FRAME = 1e-6
_WRONG_CORNER_SIGMA = 5.0
_MOST_WRONG = 0.25
_ARM_ALARM = 1e-3
_TELLS_APART = 10.0
"""In chi square: odds of 150 to 1 between a moved camera and a changed lens."""

_FAR_M, _FAR_RAD = 0.02, 0.02
"""A board farther off than this was moved, without any arithmetic of chances."""


@dataclass(frozen=True)
class Board:
    """Where the board is against where it was; moving it is no fault of the camera.

    Attributes
    ----------
    moved:
        Whether by more than chance.
    p_value:
        Of the place it has; zero where it is far off.
    shift_m, turn_rad:
        How far.
    """

    moved: bool
    p_value: float
    shift_m: float
    turn_rad: float


@dataclass(frozen=True)
class Judgement:
    """What the new pictures say of the old calibration.

    Attributes
    ----------
    views, weight:
        The frames and corners that count.
    wrong:
        Frame numbers left out because robot and picture disagree in them as in no other.
    noise:
        Corners and flange now.
    arm_ratio, arm_p_value:
        The flange's scatter now over the old calibration's (one or less: no worse), its chance.
    p_value:
        That neither mount nor lens changed.
    verdict:
        By the pictures alone, before power and known length are looked at.
    because:
        What decided, as text; empty where nothing needs saying.
    board:
        The board's place.
    still, moved, lens, both:
        The best explanations: nothing changed but the board's place; that and the mount; that
        and the lens; all three.
    """

    views: Views
    weight: FloatArray
    wrong: tuple[int, ...]
    noise: Noise
    arm_ratio: float
    arm_p_value: float
    p_value: float
    verdict: Verdict
    because: str
    board: Board
    still: Change
    moved: Change
    lens: Change
    both: Change

    @property
    def explanation(self) -> Change:
        """The explanation that goes with the verdict; all three where it is still good."""
        found = {"moved": self.moved, "lens_changed": self.lens}
        return found.get(self.verdict, self.both)


def judge(old: OldCell, views: Views) -> Judgement:
    """Hold new views against an old calibration.

    Raises
    ------
    CalibrationError
        Too few frames can be used, or in too many of them robot and picture disagree.
    """
    board_at, views = board_now(old, views)
    if len(views) < FRAMES_NEEDED:
        raise CalibrationError(
            f"{len(views)} frames have both a flange pose and the board; {FRAMES_NEEDED} are needed"
        )
    views, weight, noise, wrong = _clean(old, views, board_at)
    both = explain(old, views, weight, noise, ("board", "mount", "lens"), board_at)
    noise, ratio, arm_p = _arm(both, noise)

    def by(*free: str) -> Change:
        return explain(old, views, weight, noise, ("board", *free), board_at)

    still, moved, lens, both = by(), by("mount"), by("lens"), by("mount", "lens")
    p_value = _p(still, both)
    verdict, because = _verdict(p_value, moved, lens, both)
    free, explanation = {
        "good": ((), still),
        "moved": (("mount",), moved),
        "lens_changed": (("lens",), lens),
    }.get(verdict, (("mount", "lens"), both))
    unmoved = explain(old, views, weight, noise, free)
    return Judgement(
        views, weight, wrong, noise, ratio, arm_p, p_value, verdict, because,
        _board(old, unmoved, explanation), still, moved, lens, both,
    )  # fmt: skip


def _p(fewer: Change, more: Change) -> float:
    return chi2_tail(fewer.chi2 - more.chi2, len(more.at) - len(fewer.at))


def _clean(
    old: OldCell, views: Views, board_at: FloatArray
) -> tuple[Views, FloatArray, Noise, tuple[int, ...]]:
    """Leave wrong corners and wrong frames out, and measure the corner noise, all changes free."""
    wrong: list[int] = []
    noise = old.noise
    weight = views.seen.astype(np.float64)
    limit = chi2_limit(_WRONG_FRAME, 6)
    while True:
        for _ in range(2):
            found = explain(old, views, weight, noise, ("board", "mount", "lens"), board_at)
            noise = replace(noise, corner_px=_corner_px(found, weight))
            weight = _good_corners(found, views, noise)
        pull = (found.flange_error @ noise.flange_information * found.flange_error).sum(axis=1)
        worst = int(pull.argmax())
        rest = np.delete(pull, worst)
        if pull[worst] < limit or pull[worst] < 10 * float(np.median(rest)):
            return views, weight, noise, tuple(wrong)
        wrong.append(int(views.frame[worst]))
        if len(wrong) > _MOST_WRONG * (len(views) + len(wrong) - 1) or len(rest) < FRAMES_NEEDED:
            named = ", ".join(str(frame) for frame in wrong)
            raise CalibrationError(
                f"robot and picture disagree in too many frames ({named} among them), each in a"
                " way of its own: look at the log's poses and at the board's fixing first"
            )
        kept: BoolArray = np.arange(len(views)) != worst
        views, weight = views.take(kept), weight[kept]


def _corner_px(found: Change, weight: FloatArray) -> float:
    square = float(np.nansum(weight[..., None] * found.residual_px**2))
    degrees = 2 * float(weight.sum()) - found.absorbed - len(found.at)
    return float(np.sqrt(square / max(degrees, 1.0)))


def _good_corners(found: Change, views: Views, noise: Noise) -> FloatArray:
    length = np.linalg.norm(np.nan_to_num(found.residual_px), axis=2)
    typical = max(noise.corner_px, float(np.median(length[views.seen])) / 1.18)
    return np.asarray(views.seen & (length < _WRONG_CORNER_SIGMA * typical), dtype=np.float64)


def _arm(found: Change, noise: Noise) -> tuple[Noise, float, float]:
    """The arm's scatter; where it is clearly more than it was, the larger one counts."""
    pull = float((found.flange_error @ noise.flange_information * found.flange_error).sum())
    ratio = pull / max(found.absorbed, 1e-9)
    p_value = chi2_tail(pull, max(found.absorbed, 1e-9))
    if p_value >= _ARM_ALARM:
        return noise, float(np.sqrt(ratio)), p_value
    scale = np.sqrt(ratio)
    more = replace(noise, flange_m=noise.flange_m * scale, flange_rad=noise.flange_rad * scale)
    return more, float(scale), p_value


def _verdict(p_value: float, moved: Change, lens: Change, both: Change) -> tuple[Verdict, str]:
    if p_value >= SIGNIFICANT:
        return "good", ""
    by_mount, by_lens = _p(moved, both) >= SIGNIFICANT, _p(lens, both) >= SIGNIFICANT
    apart = moved.chi2 - lens.chi2
    if by_mount and by_lens and abs(apart) < _TELLS_APART:
        return "changed", "a moved camera and a changed lens explain these views alike"
    if by_mount and (not by_lens or apart < 0):
        return "moved", ""
    if by_lens:
        return "lens_changed", ""
    return "moved_and_lens_changed", "neither explains these views alone"


def _board(old: OldCell, unmoved: Change, explanation: Change) -> Board:
    """The board's place by the explanation that holds, against one with the board in its old."""
    held = old.mount == "eye_in_hand"
    now = explanation.model.base_from_fixed if held else explanation.model.flange_from_mounted
    shift = to_vector(inverse(board_before(old)) @ now)
    far, turn = float(np.linalg.norm(shift[:3])), float(np.linalg.norm(shift[3:]))
    if far > _FAR_M or turn > _FAR_RAD:
        return Board(True, 0.0, far, turn)
    p_value = _p(unmoved, explanation)
    return Board(p_value < SIGNIFICANT, p_value, far, turn)
