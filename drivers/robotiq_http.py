"""The Robotiq vision server's HTTP interface, each request within a deadline.

`current.jpg` and its parameters are what users of the URCap rely on; `getcamerasettings` and
`setcamerasettings` are undocumented, were read off one firmware, and may be missing.
"""

from __future__ import annotations

import json
from typing import Any

from drivers.bounded_http import BoundedHttp, NoAnswer
from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable, FrameMissing
from drivers.jpeg import jpeg_size
from drivers.outside import parse_json

PORT = 4242
MOST_PIXELS = 1 << 24
"""The sensor has 5 million."""
_LARGEST_ANSWER_BYTES = 1 << 25
_OK = 200


class RobotiqHttp:
    """One keep-alive connection to the vision server at `host`, `port`."""

    def __init__(self, host: str, port: int) -> None:
        self.name = f"Robotiq camera {host}:{port}"
        self._http = BoundedHttp(host, port, _LARGEST_ANSWER_BYTES)

    def picture(self, deadline_s: float) -> bytes:
        """The newest picture, a JPEG file.

        Raises
        ------
        FrameMissing
            What came is cut short or no JPEG.
        DeviceRefused
            The picture has more pixels than `MOST_PIXELS`; it was not decoded.
        """
        body = self._request("GET", "/current.jpg?type=color", None, deadline_s)
        size = jpeg_size(body)
        if size is None or not body.rstrip(b"\0").endswith(b"\xff\xd9"):
            raise FrameMissing(f"{self.name}: what came as a picture is no whole JPEG file")
        if size[0] * size[1] > MOST_PIXELS:
            raise DeviceRefused(
                f"{self.name}: a picture of {size[0]} x {size[1]} pixels came, which no such camera"
                f" has (at most {MOST_PIXELS} pixels are taken). See what answers at that address"
            )
        return body

    def settings(self, deadline_s: float) -> dict[str, Any] | None:
        """The camera's settings by name, or None where this firmware does not report them."""
        try:
            body = self._request("GET", "/getcamerasettings", None, deadline_s)
            settings = parse_json(body)["cameraSettings"]
        except (DeviceError, ValueError, KeyError, TypeError) as error:
            if isinstance(error, DeviceUnreachable):
                raise
            return None
        return settings if isinstance(settings, dict) else None

    def change(self, settings: dict[str, Any], deadline_s: float) -> None:
        """Write all settings back, some of them changed."""
        body = json.dumps({"cameraSettings": settings}, separators=(",", ":"))
        self._request(
            "POST", "/setcamerasettings?setManualValuesIfModeChanged=true", body, deadline_s
        )

    def set_display_size(self, width: int, height: int, deadline_s: float) -> None:
        """Ask for pictures of that size; they may take seconds to come."""
        self._request("GET", f"/setdisplaysize?width={width}&height={height}", None, deadline_s)

    def close(self) -> None:
        """Close the connection. Idempotent."""
        self._http.close()

    def _request(self, verb: str, path: str, body: str | None, deadline_s: float) -> bytes:
        try:
            status, answer = self._http.ask(verb, path, deadline_s, body, "text/plain")
        except NoAnswer as error:
            if error.cut_short:
                raise FrameMissing(f"{self.name}: the answer was cut short") from None
            raise DeviceUnreachable(
                f"{self.name}: {error}; check the robot's address and that the Robotiq "
                "camera's URCap runs"
            ) from None
        if status != _OK:
            raise DeviceError(f"{self.name}: {path} answers HTTP status {status}")
        return answer
