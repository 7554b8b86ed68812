"""HTTP basic login, as an OmniCore asks for it (RFC 7617)."""

from __future__ import annotations

import base64

from sim.peers.abb.digest import PASSWORD, USER


class BasicLogin:
    """Checks Authorization headers against one user."""

    challenge = 'Basic realm="validusers@robapi.abb"'

    def accepts(self, _: str, header: str | None) -> bool:
        """Whether the header has user name and password."""
        wanted = base64.b64encode(f"{USER}:{PASSWORD}".encode()).decode()
        return header == f"Basic {wanted}"
