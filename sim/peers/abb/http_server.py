"""Robot Web Services 1.0: the resources that clients of an IRC5 use to move it.

Source: ABB, "Robot Web Services 1.0" (developercenter.robotstudio.com).
"""

from __future__ import annotations

import json
import threading
import time
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from sim.peers.abb.answers import Answer, error
from sim.peers.abb.digest import DigestLogin
from sim.peers.abb.resources import Controller, Resources
from sim.peers.http import DroppableServer

CERTIFICATE = Path(__file__).with_name("certificate.pem")
_POLL_S = 0.02


class RwsServer:
    """Serves RWS clients of one controller."""

    def __init__(
        self, address: tuple[str, int], controller: Controller, *, https: bool = False
    ) -> None:
        handler = type("Handler", (_Handler,), {"resources": Resources(controller)})
        self._server = DroppableServer(address, handler, certificate=CERTIFICATE if https else None)
        self._thread = threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True
        )
        self._thread.start()

    def drop(self) -> None:
        """Close every connection."""
        self._server.drop()

    def close(self) -> None:
        """Close the port and every connection."""
        self._server.end()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    # a header and a body in two packets would wait for the client's delayed acknowledgement
    wbufsize = -1
    disable_nagle_algorithm = True
    resources: Resources
    _login = DigestLogin()

    def do_GET(self) -> None:
        self._serve("GET")

    def do_POST(self) -> None:
        self._serve("POST")

    def do_PUT(self) -> None:
        self._serve("PUT")

    def do_DELETE(self) -> None:
        self._serve("DELETE")

    def log_message(self, *_: Any) -> None:
        """Keep quiet."""

    def _serve(self, method: str) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        faults = self.resources.faults
        while faults().deaf:
            time.sleep(_POLL_S)
        if not self._login.accepts(method, self.headers.get("Authorization")):
            self._answer(error(401, -1, "Unauthorized"))
            return
        url = urlsplit(self.path)
        query = {key: values[0] for key, values in parse_qs(url.query).items()}
        self._answer(self.resources.answer(method, unquote(url.path).strip("/"), query, body))

    def _answer(self, answer: Answer) -> None:
        while self.resources.faults().mute:
            time.sleep(_POLL_S)
        content = answer.body
        if not isinstance(content, bytes):
            content = json.dumps(content).encode()
        self.send_response(answer.status)
        if answer.status == 401:
            self.send_header("WWW-Authenticate", self._login.challenge)
        binary = isinstance(answer.body, bytes)
        kind = answer.kind or ("application/octet-stream" if binary else "application/json")
        self.send_header("Content-Type", kind)
        for name, value in answer.headers:
            self.send_header(name, value)
        self.send_header("Set-Cookie", "-http-session-=1::http.session::1; path=/")
        if answer.status != 204:
            self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if answer.status != 204:
            self.wfile.write(content)
        self.wfile.flush()
