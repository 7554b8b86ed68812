"""GigE Vision and USB3 Vision cameras through Aravis."""

from __future__ import annotations

from drivers.aravis_session import AravisSession
from drivers.genicam_camera import GenICamCamera, GenICamOptions


class AravisCamera(GenICamCamera):
    """A camera opened by its address, armed once and triggered by software.

    Parameters
    ----------
    address:
        IP address; discovery broadcasts into every network and is not used.
    packet_bytes:
        Stream packet size with IP and UDP headers; None: what the network to it carries.
    control_wait_s:
        How long `connect` waits for a camera that another program still holds.
    """

    tried_on = "a simulated GigE Vision device on loopback"

    def __init__(
        self,
        address: str,
        options: GenICamOptions | None = None,
        *,
        packet_bytes: int | None = None,
        control_wait_s: float = 4.0,
    ) -> None:
        super().__init__(f"camera {address}", options)
        self._address, self._packet_bytes = address, packet_bytes
        self._control_wait_s = control_wait_s

    def _open(self) -> AravisSession:
        return AravisSession(self._address, self._packet_bytes, self._control_wait_s)
