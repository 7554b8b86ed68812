"""HTTP digest login with MD5, as an IRC5 asks for it (RFC 2617)."""

from __future__ import annotations

import hashlib
import re
import secrets

REALM = "validusers@robapi.abb"
USER, PASSWORD = "Default User", "robotics"
_FIELD = re.compile(r'(\w+)=(?:"([^"]*)"|([^\s,]+))')


class DigestLogin:
    """Checks Authorization headers against one user and one nonce."""

    def __init__(self) -> None:
        self._nonce = secrets.token_hex(16)

    @property
    def challenge(self) -> str:
        """The WWW-Authenticate header."""
        return f'Digest realm="{REALM}", domain="/", qop="auth", nonce="{self._nonce}"'

    def accepts(self, method: str, header: str | None) -> bool:
        """Whether the header proves that the client knows the password."""
        if header is None:
            return False
        fields = {name: quoted or bare for name, quoted, bare in _FIELD.findall(header)}
        if fields.get("username") != USER or fields.get("nonce") != self._nonce:
            return False
        secret = _md5(f"{USER}:{REALM}:{PASSWORD}")
        request = _md5(f"{method}:{fields.get('uri', '')}")
        middle = ":".join(fields.get(name, "") for name in ("nonce", "nc", "cnonce", "qop"))
        return fields.get("response") == _md5(f"{secret}:{middle}:{request}")


def _md5(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()
