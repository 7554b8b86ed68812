"""Whether a GigE Vision camera answers, is free, and how large its packets may be.

Asked over GVCP by address, as the GigE Vision standard has it; no control is taken.
"""

from __future__ import annotations

import socket
import struct

from cell.storage.files.camera_file import GigeCamera
from cell.verbs.doctor.finding import Finding
from cell.verbs.doctor.ports import CHECK_LINE
from drivers.aravis_network import GVCP_PORT, packet_bytes_for

_TIMEOUT_S = 2.0
_JUMBO_BYTES = 8000
_KEY, _ANSWER_WANTED = 0x42, 0x01
_DISCOVERY, _READ_REGISTER = 0x0002, 0x0080
_CONTROL_PRIVILEGE = 0x0A00
_CONTROL_BITS = 0b11  # exclusive access, control access
_ACCESS_DENIED = 0x8006


def gige(camera: GigeCamera) -> list[Finding]:
    """Its name, whether another program holds it, and the packet size."""
    address = camera.address
    try:
        _, record = _ask(address, _DISCOVERY)
    except OSError as silent:
        found = f"does not answer ({silent})"
        return [Finding(f"GigE camera {address}", False, found, CHECK_LINE), _packets(camera)]
    vendor, model = (_text(record[at : at + 32]) for at in (72, 104))
    name = f"{vendor} {model}".strip() or "answers"
    return [Finding(f"GigE camera {address}", True, name), _held(address), _packets(camera)]


def _held(address: str) -> Finding:
    try:
        status, answer = _ask(address, _READ_REGISTER, struct.pack(">I", _CONTROL_PRIVILEGE))
    except OSError as silent:
        return Finding(
            "GigE control", False, f"does not report it ({silent})", CHECK_LINE, needed=False
        )
    held = status == _ACCESS_DENIED or bool(int.from_bytes(answer[:4], "big") & _CONTROL_BITS)
    return Finding(
        "GigE control",
        not held,
        "another program controls the camera" if held else "free",
        "close the vendor's viewer or the other run; a crashed program lets go after about 3 s",
    )


def _packets(camera: GigeCamera) -> Finding:
    try:
        carried = packet_bytes_for(camera.address)
    except OSError as fault:
        return Finding("packet size", False, str(fault), CHECK_LINE)
    asked = camera.packet_bytes
    if asked is not None and asked > carried:
        found = f"packet_bytes is {asked}, the network carries {carried}: no frame would arrive"
        return Finding("packet size", False, found, f"write packet_bytes: {carried}, or none")
    mend = "set the MTU of that network card (and of switches between) to 9000"
    size = asked or carried
    return Finding("packet size", size >= _JUMBO_BYTES, f"{size} bytes", mend, needed=False)


def _ask(address: str, command: int, payload: bytes = b"") -> tuple[int, bytes]:
    """Status and payload of the answer; raises `OSError` where none comes."""
    head = struct.pack(">BBHHH", _KEY, _ANSWER_WANTED, command, len(payload), 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.settimeout(_TIMEOUT_S)
        link.sendto(head + payload, (address, GVCP_PORT))
        reply = link.recv(1024)
    return int.from_bytes(reply[:2], "big"), reply[8:]


def _text(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("latin-1")
