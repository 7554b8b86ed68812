"""A device on loopback that gives every connection the same bytes and then says no more."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import Enum

_WAIT_S = 0.2


class Talk(Enum):
    """When the bytes are sent: at once; after a question; the first line at once, others after."""

    BROADCASTS, ANSWERS, GREETS = range(3)


@contextmanager
def answering(address: tuple[str, int], data: bytes, talk: Talk) -> Iterator[int]:
    """Serve while the context holds; yields the port, a free one where 0 was asked for."""
    with socket.create_server(address) as server:
        thread = threading.Thread(target=_serve, args=(server, data, talk), daemon=True)
        thread.start()
        try:
            yield int(server.getsockname()[1])
        finally:
            with suppress(OSError):
                server.shutdown(socket.SHUT_RDWR)  # wakes the thread that accepts
            thread.join()


def _serve(server: socket.socket, data: bytes, talk: Talk) -> None:
    while True:
        try:
            link, _ = server.accept()
        except OSError:
            return
        with link, suppress(OSError):
            link.settimeout(_WAIT_S)
            greeting = data[: data.find(b"\n") + 1] if talk is Talk.GREETS else b""
            link.sendall(greeting)
            if talk is not Talk.BROADCASTS:
                link.recv(65536)
            link.sendall(data[len(greeting) :])
            link.shutdown(socket.SHUT_WR)
            while link.recv(65536):  # until the other side has gone, so that it is not cut off
                pass
