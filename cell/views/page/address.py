"""Where the page is served, and whether that can be reached from elsewhere."""

from __future__ import annotations

import ipaddress
import re
import secrets
import socket
from dataclasses import dataclass

from cell.errors import InputError

DEFAULT = "127.0.0.1:8470"
_SHAPE = re.compile(r"^(?:\[(?P<six>[0-9a-fA-F:.]+)\]|(?P<host>[A-Za-z0-9.-]+)):(?P<port>\d{1,5})$")
_TOKEN_BYTES = 18
_LOOPBACK_NAMES = {"localhost", "127.0.0.1", "[::1]"}


def is_address(word: str) -> bool:
    """Whether a word reads as HOST:PORT."""
    return _SHAPE.match(word) is not None


@dataclass(frozen=True)
class Address:
    """HOST:PORT, and the token without which nobody but this computer gets in.

    Attributes
    ----------
    host, port:
        Where to listen; port 0 takes any free one.
    token:
        Empty on the loopback address.
    """

    host: str
    port: int
    token: str

    @classmethod
    def parse(cls, text: str) -> Address:
        """Read HOST:PORT; a fresh token for one that others can reach. Raises `InputError`."""
        match = _SHAPE.match(text)
        if match is None or int(match["port"]) > 65535:
            raise InputError(f"--page {text}: is no HOST:PORT; for example --page {DEFAULT}")
        host = match["six"] or match["host"]
        return cls(
            host, int(match["port"]), "" if _is_loopback(host) else secrets.token_urlsafe(18)
        )

    def listen(self) -> socket.socket:
        """A listening socket; raises `InputError` where the address cannot be had."""
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        server = socket.socket(family, socket.SOCK_STREAM)
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            server.bind((self.host, self.port))
            server.listen(512)
        except OSError as fault:
            server.close()
            raise InputError(
                f"--page {self.host}:{self.port}: cannot listen there: {fault.strerror or fault}."
                " Another run may have it; give another port."
            ) from None
        return server

    def url(self, port: int) -> str:
        """What to type into a browser, the token included."""
        anywhere = self.host in ("0.0.0.0", "::")
        host = socket.gethostname() if anywhere else self.host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{port}/" + (f"?token={self.token}" if self.token else "")

    def admits(self, token: str, host_header: str) -> bool:
        """Whether a request may have an answer.

        With a token: whoever knows it. On the loopback address: whoever calls it by a name of this
        computer, so that a web page of elsewhere cannot lead a browser here by a name of its own.
        """
        if self.token:
            return secrets.compare_digest(token.encode(), self.token.encode())
        name = host_header.rpartition(":")[0] if _SHAPE.match(host_header) else host_header
        own = f"[{self.host}]" if ":" in self.host else self.host
        return name.lower() in _LOOPBACK_NAMES | {own}


def _is_loopback(host: str) -> bool:
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
