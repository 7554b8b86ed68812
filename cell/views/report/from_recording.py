"""The report's data as far as the recording itself gives them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from calib.views import Views
from cell.errors import InputError
from cell.sequencer.journal import read_journal
from cell.storage.recording import Recording
from cell.views.report.data import Image, ReportData, Thumbnail


def recording_data(
    recording: Recording, views: Views, made: Mapping[str, str] | None = None
) -> ReportData:
    """A report of `recording` that still lacks its results; `dataclasses.replace` adds them.

    Parameters
    ----------
    recording, views:
        The recording, and all of its frames as views.
    made:
        How the results were made: versions, seed, dates.
    """
    content = recording.header.as_mapping()
    return ReportData(
        views=views,
        recording={**content, "name": recording.name},
        simulated=bool(content.get("simulated")),
        thumbnail=_thumbnail(recording) if recording.header.images else None,
        skipped=_skipped(recording),
        made=made or {},
    )


def _skipped(recording: Recording) -> dict[str, str]:
    """The views the run gave up, by its journal; none where no run of ours made the recording."""
    events = read_journal(recording.path)
    return {f"view {e['view']}": e["reason"] for e in events if e["event"] == "skip"}


def _thumbnail(recording: Recording) -> Thumbnail:
    frames = {frame.frame: frame for frame in recording.frames}

    def picture(number: int) -> Image | None:
        try:
            return _eight_bit(recording.thumbnail(frames[number]))
        except (InputError, KeyError):
            # its reason stands beside the frame; here it is only a picture that is not there
            return None

    return picture


def _eight_bit(image: np.ndarray) -> Image:
    """Grey or BGR, 8 bit: what a 12-bit camera stored is stretched to its own brightest pixel."""
    image = image[..., :3] if image.ndim == 3 else image
    if image.dtype == np.uint8:
        return np.asarray(image)
    brightest = max(float(image.max()), 1.0)
    return np.asarray(image * (255.0 / brightest), dtype=np.uint8)
