"""What of this machine's network a GigE Vision camera depends on: packet size, socket buffer."""

from __future__ import annotations

import socket
from pathlib import Path

GVCP_PORT = 3956
_IP_MTU = 14  # <linux/in.h>; Python's socket module does not name it
_LARGEST_PACKET_BYTES = 8000
_RECEIVE_LIMIT = Path("/proc/sys/net/core/rmem_max")


def packet_bytes_for(address: str) -> int:
    """The largest stream packet that the way to `address` carries whole, 8000 at most.

    A multiple of four, as GigE Vision wants it, counted with IP and UDP headers like an MTU.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect((address, GVCP_PORT))
        mtu_bytes = probe.getsockopt(socket.IPPROTO_IP, _IP_MTU)
    return min(mtu_bytes, _LARGEST_PACKET_BYTES) // 4 * 4


def receive_buffer_limit_bytes() -> int | None:
    """The largest socket buffer an ordinary user gets (net.core.rmem_max); None if unknown."""
    try:
        return int(_RECEIVE_LIMIT.read_text())
    except (OSError, ValueError):
        return None


def receive_buffer_hint(frame_bytes: int) -> str | None:
    """What to do so that a whole frame fits into the socket buffer; None when it does."""
    limit = receive_buffer_limit_bytes()
    if limit is None or limit >= frame_bytes:
        return None
    return (
        f"the socket buffer may hold {limit} bytes and a frame has {frame_bytes}: packets may have "
        f"to be sent again; `sudo sysctl -w net.core.rmem_max={2 * frame_bytes}` avoids that"
    )
