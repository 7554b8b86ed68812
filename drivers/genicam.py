"""Cameras behind a GenTL producer: CoaXPress grabbers and the like."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.genicam_camera import GenICamCamera, GenICamOptions
from drivers.genicam_gentl import GenTLSession, find_producer


class GenTLCamera(GenICamCamera):
    """A camera opened through a vendor's GenTL producer, armed once and triggered by software.

    Parameters
    ----------
    producer:
        Path of the `.cti` file; None: the only one on GENICAM_GENTL64_PATH.
    select:
        Which device, by `id_`, `vendor`, `model` or `serial_number`; empty when it has just one.
    """

    tried_on = "the GenTL producer of the genicam wheel, which simulates a camera"

    def __init__(
        self,
        producer: str | None = None,
        select: Mapping[str, str] | None = None,
        options: GenICamOptions | None = None,
    ) -> None:
        named = ", ".join((select or {}).values()) or "first device"
        super().__init__(f"GenTL camera {named}", options)
        self._producer, self._select = producer, dict(select or {})

    def _open(self) -> GenTLSession:
        return GenTLSession(self.device, self._producer or find_producer(), self._select)
