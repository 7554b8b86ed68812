"""What a result file says of when, by which program and of which devices it was made."""

from __future__ import annotations

from cell.storage.files.result_part import ResultPart


class DevicePart(ResultPart):
    """Which camera or robot, as far as the recording states."""

    model: str | None = None
    serial: str | None = None


class OriginPart(ResultPart):
    """The keys that every result file has in common."""

    recorded: str | None = None
    """When the recording was begun, as it says itself."""
    created: str | None = None
    """When this result was made, ISO 8601 with its zone."""
    program: str | None = None
    """Which program made it, with its version."""
    camera: DevicePart = DevicePart()


class ProvenancePart(OriginPart):
    """The same, where nothing more is said of the robot."""

    robot: DevicePart = DevicePart()
