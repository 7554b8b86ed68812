"""Robot Web Services over HTTP: 1.0 with digest login (IRC5), 2.0 with basic login (OmniCore)."""

from __future__ import annotations

import itertools
import json
import threading
import time
from abc import ABC, abstractmethod
from http.cookies import SimpleCookie
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from sim.peers.abb import resources2
from sim.peers.abb.answers import Answer, error
from sim.peers.abb.arm_resources import Controller
from sim.peers.abb.basic import BasicLogin
from sim.peers.abb.digest import DigestLogin
from sim.peers.abb.resources import Resources
from sim.peers.abb.resources2 import Resources2
from sim.peers.http import DroppableServer

CERTIFICATE = Path(__file__).with_name("certificate.pem")
_POLL_S = 0.02


class RwsServer:
    """Serves RWS clients of one controller."""

    def __init__(
        self,
        address: tuple[str, int],
        controller: Controller,
        *,
        https: bool = False,
        omnicore: bool = False,
    ) -> None:
        kind, speaks = (_Handler2, Resources2) if omnicore else (_Handler1, Resources)
        handler = type("Handler", (kind,), {"resources": speaks(controller)})
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


class _Handler(BaseHTTPRequestHandler, ABC):
    protocol_version = "HTTP/1.1"
    # a header and a body in two packets would wait for the client's delayed acknowledgement
    wbufsize = -1
    disable_nagle_algorithm = True
    resources: Any
    _login: Any
    _session = "-http-session-"

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
            self._answer(self._unauthorized())
            return
        url = urlsplit(self.path)
        query = {key: values[0] for key, values in parse_qs(url.query).items()}
        self._answer(self._resource(method, unquote(url.path).strip("/"), query, body))

    @abstractmethod
    def _unauthorized(self) -> Answer: ...

    @abstractmethod
    def _resource(self, method: str, path: str, query: dict[str, str], body: bytes) -> Answer: ...

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
        for name, value in self._cookies():
            self.send_header(name, value)
        if answer.status != 204:
            self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if answer.status != 204:
            self.wfile.write(content)
        self.wfile.flush()

    def _cookies(self) -> list[tuple[str, str]]:
        return [("Set-Cookie", f"{self._session}=1::http.session::1; path=/")]


class _Handler1(_Handler):
    _login = DigestLogin()

    def _unauthorized(self) -> Answer:
        return error(401, -1, "Unauthorized")

    def _resource(self, method: str, path: str, query: dict[str, str], body: bytes) -> Answer:
        answer: Answer = self.resources.answer(method, path, query, body)
        return answer


class _Handler2(_Handler):
    _login = BasicLogin()
    _numbers = itertools.count(1)
    _begun: str | None = None

    def _unauthorized(self) -> Answer:
        return resources2.error(401, -1, "Unauthorized")

    def _resource(self, method: str, path: str, query: dict[str, str], body: bytes) -> Answer:
        if method != "PUT" and "hal+json;v=2.0" not in self.headers.get("Accept", ""):
            return resources2.error(406, -1, "Not acceptable")
        kind = self.headers.get("Content-Type", "")
        answer: Answer = self.resources.answer(method, path, query, body, self._client(), kind)
        return answer

    def _client(self) -> str:
        """The session that a request belongs to, by its cookie; a new one begins without."""
        cookie = SimpleCookie(self.headers.get("Cookie", ""))
        if self._session in cookie:
            self._begun = None
            return cookie[self._session].value
        self._begun = f"{next(self._numbers)}::http.session"
        return self._begun

    def _cookies(self) -> list[tuple[str, str]]:
        begun, self._begun = self._begun, None
        return [("Set-Cookie", f"{self._session}={begun}; path=/")] if begun else []
