"""The device's memory: bootstrap registers, feature registers, and the XML behind them.

Source: AIA GigE Vision Specification 2.0, chapter 28 (bootstrap registers).
"""

from __future__ import annotations

import ipaddress
import struct

from sim.peers.gige import features as ft
from sim.peers.gige.gvcp import Refused, Status

CONTROL_PRIVILEGE = 0x0A00
STREAM_PORT, STREAM_ADDRESS = 0x0D00, 0x0D18
TIMESTAMP_CONTROL, TIMESTAMP_LATCHED = 0x0944, 0x0948
DISCOVERY_BYTES = 0xF8

_FEATURES_AT, _XML_AT = 0xA000, 0x10000
_CAN_WRITE_MEMORY_AND_RESEND = 0b110
_NAMES_READABLE = 0xC0000000
TICKS_PER_S = 1_000_000_000
_HOST_WRITABLE = {STREAM_PORT, STREAM_ADDRESS, ft.STREAM_PACKET_SIZE, ft.STREAM_PACKET_DELAY}
_HOST_WRITABLE |= {ft.HEARTBEAT_TIMEOUT, TIMESTAMP_CONTROL, CONTROL_PRIVILEGE}


class RegisterMap:
    """Memory of one device, as it is after power-on."""

    def __init__(
        self, features: tuple[ft.Feature, ...], address: str, model: str, serial: str
    ) -> None:
        self._features = {f.name: f for f in features}
        self._layout = _lay_out(features)
        self._address_of = {f.name: at for at, f in self._layout.items()}
        xml = ft.xml_of(self._layout, model)
        self._memory = bytearray(_XML_AT) + xml + bytes(-len(xml) % 4)
        self._fill_bootstrap(address, model, serial, len(xml))
        for feature in features:
            if feature.address is None:
                self.set(feature.name, feature.default)

    def read(self, address: int, length: int) -> bytes:
        """Bytes of the memory; refuses what lies outside it."""
        if address + length > len(self._memory):
            raise Refused(Status.INVALID_ADDRESS)
        return bytes(self._memory[address : address + length])

    def feature_at(self, address: int, data: bytes) -> tuple[ft.Feature | None, ft.Value]:
        """The feature a host's write of `data` means (None: a bootstrap register) and its value."""
        feature = self._layout.get(address)
        if feature is None or address in _HOST_WRITABLE:
            if address not in _HOST_WRITABLE:
                raise Refused(Status.WRITE_PROTECT)
            return None, int.from_bytes(data, "big")
        if len(data) != feature.length:
            raise Refused(Status.BAD_ALIGNMENT)
        value = feature.unpack(data)
        if feature.access == "RO":
            raise Refused(Status.WRITE_PROTECT)
        if not feature.allows(value):
            raise Refused(Status.INVALID_PARAMETER)
        return feature, value

    def name_at(self, address: int) -> str | None:
        """The feature whose register lies there, if any."""
        feature = self._layout.get(address)
        return feature.name if feature else None

    def address_of(self, name: str) -> int:
        """Where a feature's register lies."""
        return self._address_of[name]

    def get(self, name: str) -> ft.Value:
        """A feature's value."""
        at, feature = self._address_of[name], self._features[name]
        return feature.unpack(self.read(at, feature.length))

    def number(self, name: str) -> float:
        """A numeric feature's value."""
        return float(self.get(name))

    def set(self, name: str, value: ft.Value) -> None:
        """Set a feature from the device's own side."""
        at, feature = self._address_of[name], self._features[name]
        self._memory[at : at + feature.length] = feature.pack(value)

    def word(self, address: int) -> int:
        """A 32-bit bootstrap register."""
        return int.from_bytes(self._memory[address : address + 4], "big")

    def set_word(self, address: int, value: int) -> None:
        """Set a 32-bit bootstrap register."""
        self._memory[address : address + 4] = struct.pack(">I", value & 0xFFFFFFFF)

    def latch_time(self, now_ns: int) -> None:
        """Put the device's clock into the latched timestamp registers."""
        self._memory[TIMESTAMP_LATCHED : TIMESTAMP_LATCHED + 8] = struct.pack(">Q", now_ns)

    def _fill_bootstrap(self, address: str, model: str, serial: str, xml_bytes: int) -> None:
        ip = int(ipaddress.IPv4Address(address))
        registers = {
            0x0000: 0x00020000,
            0x0004: 0x80000001,
            0x0008: 0x0200,
            0x000C: ip,
            0x0010: 0x80000007,
            0x0014: 0x00000005,
            0x0024: ip,
            0x0034: 0xFF000000,
            0x0600: 1,
            0x0904: 1,
            0x0934: _NAMES_READABLE | _CAN_WRITE_MEMORY_AND_RESEND,
            ft.HEARTBEAT_TIMEOUT: 3000,
            ft.TICK_FREQUENCY + 4: TICKS_PER_S,
            ft.STREAM_PACKET_SIZE: 1400,
        }
        for at, value in registers.items():
            self.set_word(at, value)
        url = f"Local:camera.xml;{_XML_AT:X};{xml_bytes:X}"
        texts = {0x0048: "CalibrationCell", 0x0068: model, 0x0088: "1", 0x00D8: serial, 0x0200: url}
        for at, text in texts.items():
            self._memory[at : at + len(text)] = text.encode()


def _lay_out(features: tuple[ft.Feature, ...]) -> dict[int, ft.Feature]:
    free = (at for at in range(_FEATURES_AT, _XML_AT, 8))
    return {(next(free) if f.address is None else f.address): f for f in features}
