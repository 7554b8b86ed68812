"""What the device's features do: triggers, exposure, focus, and how an acquisition is set up."""

from __future__ import annotations

import ipaddress

from drivers.camera import Camera
from sim.peers.gige import features as ft
from sim.peers.gige.control import Host
from sim.peers.gige.gvsp import BITS
from sim.peers.gige.lens import Lens
from sim.peers.gige.registers import STREAM_ADDRESS, STREAM_PORT, RegisterMap
from sim.peers.gige.streamer import Acquisition, Streamer

_TICK_S = 1e-9
_ONCE = 1


class Behaviour:
    """Ties registers to the engine that exposes and streams, and to the lens."""

    def __init__(
        self, registers: RegisterMap, streamer: Streamer, lens: Lens, source: Camera
    ) -> None:
        self._registers, self._streamer = registers, streamer
        self._lens, self._source = lens, source

    def refresh(self, name: str | None) -> None:
        """Bring a feature's register up to date before it is read."""
        if name in ("OpticControllerStatus", "FocusStatus"):
            self._registers.set(name, self._lens.status)
        elif name == "FocusStepper":
            self._registers.set(name, self._lens.step)

    def react(self, name: str, value: ft.Value) -> None:
        """Do what the write of a feature asks for."""
        match name:
            case "AcquisitionStart":
                self._streamer.start(self._acquisition())
            case "AcquisitionStop":
                self._streamer.halt()
            case "TriggerSoftware":
                self._trigger()
            case "ExposureTime" | "Gain":
                self._configure_source()
            case "Width" | "Height" | "PixelFormat":
                self._update_payload_size()
            case "FocusStepper":
                self._lens.move_to(int(value))
            case "FocusAuto" if value == _ONCE:
                self._lens.focus_once()
                self._registers.set("FocusAuto", 0)
            case "OpticControllerInitialize" | "FocusInitialize":
                self._lens.initialize()

    def _trigger(self) -> None:
        by_software = not self._registers.get("TriggerSource")
        if self._registers.get("TriggerMode") and by_software:
            self._streamer.trigger()

    def _configure_source(self) -> None:
        exposure_s = self._registers.number("ExposureTime") * 1e-6
        gain_db = self._registers.number("Gain")
        self._streamer.set_exposure(exposure_s)

        def configure() -> None:
            self._source.configure(exposure_s=exposure_s, gain_db=gain_db)

        self._streamer.order(configure)

    def _update_payload_size(self) -> None:
        reg = self._registers
        bits = BITS[int(reg.number("PixelFormat"))]
        reg.set("PayloadSize", int(reg.number("Width") * reg.number("Height")) * bits // 8)

    def stream_host(self) -> Host:
        """Where the controller wants the stream."""
        ip = ipaddress.IPv4Address(self._registers.word(STREAM_ADDRESS))
        return str(ip), self._registers.word(STREAM_PORT) & 0xFFFF

    def _acquisition(self) -> Acquisition:
        reg = self._registers
        triggered = bool(reg.get("TriggerMode"))
        return Acquisition(
            host=self.stream_host(),
            packet_bytes=reg.word(ft.STREAM_PACKET_SIZE) & 0xFFFF,
            packet_delay_s=reg.word(ft.STREAM_PACKET_DELAY) * _TICK_S,
            pixel_format=int(reg.number("PixelFormat")),
            width=int(reg.number("Width")),
            height=int(reg.number("Height")),
            exposure_s=reg.number("ExposureTime") * 1e-6,
            period_s=None if triggered else 1 / reg.number("AcquisitionFrameRate"),
            single_frame=bool(reg.get("AcquisitionMode")),
        )
