"""A TCP port with one thread per connection, whose connections can be dropped on command."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable

Serve = Callable[[socket.socket], None]


class Listener:
    """Accepts on one address and hands every connection to `serve` in its own thread.

    Parameters
    ----------
    address:
        Host and port.
    serve:
        Called with the connected socket; when it returns or raises `OSError`, the socket is closed.
    """

    def __init__(self, address: tuple[str, int], serve: Serve) -> None:
        self._serve = serve
        self._connections: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._open = True
        self._server = socket.create_server(address, backlog=8)
        self._thread = threading.Thread(target=self._accept, name=f"peer-{address[1]}", daemon=True)
        self._thread.start()

    def drop(self) -> None:
        """Close every connection; new ones are accepted."""
        with self._lock:
            connections, self._connections = self._connections, set()
        for link in connections:
            shut(link)

    def close(self) -> None:
        """Close the port and every connection."""
        self._open = False
        shut(self._server)
        self._thread.join(timeout=1.0)
        self.drop()

    def _accept(self) -> None:
        while self._open:
            try:
                link, _ = self._server.accept()
            except OSError:
                return
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with self._lock:
                self._connections.add(link)
            threading.Thread(target=self._handle, args=(link,), daemon=True).start()

    def _handle(self, link: socket.socket) -> None:
        with contextlib.suppress(OSError):
            self._serve(link)
        with self._lock:
            self._connections.discard(link)
        shut(link)


def shut(link: socket.socket) -> None:
    """Close a socket and wake whoever is blocked on it."""
    # close() alone leaves a thread that is blocked in recv or accept asleep
    with contextlib.suppress(OSError):
        link.shutdown(socket.SHUT_RDWR)
    link.close()
