"""Recordings: folders of frames with what the robot logged, read and written.

Public: `read_recording`, `Recording`, `Header`, `FrameRecord`, `Corners`, `RecordingWriter`,
`read_frames`, `frames_as_views`.
"""

from cell.storage.recording.corners import Corners, read_corners, write_corners
from cell.storage.recording.frame_log import read_frames
from cell.storage.recording.frames import FrameRecord, PoseRecord
from cell.storage.recording.header import Header
from cell.storage.recording.recording import Recording, frames_as_views, read_recording
from cell.storage.recording.writer import RecordingWriter

__all__ = [
    "Corners",
    "FrameRecord",
    "Header",
    "PoseRecord",
    "Recording",
    "RecordingWriter",
    "frames_as_views",
    "read_corners",
    "read_frames",
    "read_recording",
    "write_corners",
]
