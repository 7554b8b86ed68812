"""What is asked of the camera, so that its loss is not taken for the arm's."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from drivers.errors import DeviceUnreachable

Result = TypeVar("Result")


class CameraLost(DeviceUnreachable):
    """The camera does not answer any more; opening it anew may mend that."""


def asked_of_camera(job: Callable[[], Result]) -> Callable[[], Result]:
    """`job`, raising `CameraLost` where the camera is unreachable."""

    def ask() -> Result:
        try:
            return job()
        except DeviceUnreachable as lost:
            raise CameraLost(str(lost)) from None

    return ask
