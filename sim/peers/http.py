"""An HTTP server with one thread per connection, whose connections can be dropped on command."""

from __future__ import annotations

import http.server
import ssl
import sys
from pathlib import Path
from typing import Any

from sim.peers.listener import shut


class DroppableServer(http.server.ThreadingHTTPServer):
    """`drop` closes every connection and goes on accepting; `end` closes the port, too.

    Parameters
    ----------
    arguments:
        As of `http.server.HTTPServer`.
    certificate:
        File with a private key and its certificate, for HTTPS; None for HTTP.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, *arguments: Any, certificate: Path | None = None) -> None:
        self._connections: set[Any] = set()
        super().__init__(*arguments)
        if certificate is not None:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(certificate)
            # a client that shakes no hands must not keep others from being accepted
            self.socket = context.wrap_socket(
                self.socket, server_side=True, do_handshake_on_connect=False
            )

    def drop(self) -> None:
        """Close every connection."""
        for link in list(self._connections):
            shut(link)

    def end(self) -> None:
        """Close the port and every connection."""
        self.shutdown()
        self.server_close()
        self.drop()

    def process_request(self, request: Any, client_address: Any) -> None:
        """Remember the connection."""
        self._connections.add(request)
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Forget it."""
        self._connections.discard(request)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that goes away in the middle, or is cut off, is no error of the server's."""
        if not isinstance(sys.exception(), OSError | ValueError):
            super().handle_error(request, client_address)
