from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cell.recordings import HEADER, corner_rows, frame_line


@pytest.fixture
def recording_folder(tmp_path: Path) -> Callable[..., Path]:
    """Write a recording of corners only; any of its files' text can be given."""

    def write(
        header: str = HEADER, frames: str | None = None, detections: str | None = None
    ) -> Path:
        folder = tmp_path / "recording"
        folder.mkdir(exist_ok=True)
        (folder / "recording.yaml").write_text(header)
        (folder / "frames.jsonl").write_text(
            "".join(map(frame_line, range(3))) if frames is None else frames
        )
        if detections is None:
            detections = "frame,row,col,u_px,v_px\n" + "".join(map(corner_rows, range(3)))
        (folder / "detections.csv").write_text(detections)
        return folder

    return write
