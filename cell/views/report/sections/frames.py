"""Every frame as a thumbnail with its corners; rejected ones with the reason."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from calib.views import FloatArray
from cell.views.numbers import number
from cell.views.report import html
from cell.views.report.data import Image, ReportData

_WIDTH_PX = 220
_MOST = 240
_READERS = 4


def frames(data: ReportData) -> str:
    """A grid of thumbnails in the order of the recording."""
    rejected = {
        int(r["frame"]): str(r["reason"])
        for r in (data.calibration or {}).get("frames_rejected") or []
    }
    numbers = sorted({int(f) for f in data.views.frame} | set(rejected))
    shown = _thinned(numbers, rejected)
    message = f"{len(numbers) - len(rejected)} frames used, {len(rejected)} rejected."
    if len(shown) < len(numbers):
        message += f" {len(shown)} of {len(numbers)} are shown; every rejected one is."
    if data.thumbnail is None:
        message += " Pictures were not kept: only the corners are drawn."
    message += _wrong_corners((data.calibration or {}).get("corners_left_out") or [])
    # reading and shrinking pictures is most of a report's time, and both leave the interpreter free
    with ThreadPoolExecutor(max_workers=_READERS) as readers:
        grid = "".join(readers.map(lambda f: _frame(data, f, rejected.get(f)), shown))
    return html.section(
        "frames",
        "Every frame",
        html.paragraph(message),
        _reasons(rejected),
        _skipped(data.skipped),
        f'<div class="thumbs">{grid}</div>',
    )


def _thinned(numbers: list[int], rejected: dict[int, str]) -> list[int]:
    """All frames, or so many of them that the page stays small enough to mail."""
    step = -(-len(numbers) // _MOST)
    return [n for k, n in enumerate(numbers) if k % step == 0 or n in rejected]


def _wrong_corners(left_out: Sequence[Mapping[str, Any]]) -> str:
    if not left_out:
        return ""
    count = sum(len(one["corners"]) for one in left_out)
    corners, frames = ("corner lies", "frame") if count == 1 else ("corners lie", "frames")
    where = ", ".join(str(one["frame"]) for one in left_out)
    return f" {count} {corners} far from the board and had no say ({frames} {where})."


def _reasons(rejected: dict[int, str]) -> str:
    if not rejected:
        return ""
    table = html.table(("rejected frame", "reason"), sorted(rejected.items()))
    return html.fold(f"Rejected frames and why ({len(rejected)})", table)


def _skipped(skipped: Mapping[str, str]) -> str:
    if not skipped:
        return ""
    table = html.table(("skipped while running", "reason"), skipped.items())
    return html.fold(f"Skipped while running, and why ({len(skipped)})", table)


def _frame(data: ReportData, frame: int, reason: str | None) -> str:
    views = data.views
    at = np.flatnonzero(views.frame == frame)
    corners = views.corners_px[at[0]] if len(at) else np.full((0, 2), np.nan)
    picture = None if data.thumbnail is None else data.thumbnail(frame)
    note = f"rejected: {reason}" if reason else _note(data, at)
    return (
        f'<figure class="thumb{" rejected" if reason else ""}">'
        f'<svg role="img" aria-label="frame {frame}" viewBox="0 0 {views.width_px} '
        f'{views.height_px}">{_inline_image(picture, views.width_px, views.height_px)}'
        f"{''.join(_corner_paths(corners, views.board.cols, views.width_px))}</svg>"
        f"<figcaption><strong>{frame}</strong> {html.text(note)}</figcaption></figure>"
    )


def _note(data: ReportData, at: np.ndarray) -> str:
    name = data.best_of(data.residuals_px)
    if name is None or not len(at):
        return ""
    left = data.residuals_px[name][at[0]]
    if not np.isfinite(left).any():
        return ""
    return number(float(np.sqrt(np.nanmean((left**2).sum(axis=1)))), "px", 2)


def _corner_paths(corners: FloatArray, cols: int, width_px: int) -> Iterator[str]:
    """All corners as dots, the first row again as a line that marks its start."""
    dots = "".join(f"M{u:.0f} {v:.0f}h0" for u, v in corners if np.isfinite(u))
    if dots:
        yield f'<path class="halo" stroke-width="{width_px / 38:.0f}" d="{dots}"/>'
        yield f'<path class="corners" stroke-width="{width_px / 62:.0f}" d="{dots}"/>'
    first = [f"{u:.0f} {v:.0f}" for u, v in corners[:cols] if np.isfinite(u)]
    if len(first) > 1:
        path = "M" + "L".join(first)
        yield f'<path class="first-row" stroke-width="{width_px / 110:.1f}" d="{path}"/>'


def _inline_image(picture: Image | None, width_px: int, height_px: int) -> str:
    if picture is None:
        return f'<rect class="no-picture" width="{width_px}" height="{height_px}"/>'
    import cv2

    height = max(1, round(_WIDTH_PX * picture.shape[0] / picture.shape[1]))
    small = cv2.resize(picture, (_WIDTH_PX, height), interpolation=cv2.INTER_AREA)
    done, encoded = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 70])
    if not done:
        return ""
    text = base64.b64encode(encoded.tobytes()).decode()
    return (
        f'<image width="{width_px}" height="{height_px}" preserveAspectRatio="none" '
        f'href="data:image/jpeg;base64,{text}"/>'
    )
