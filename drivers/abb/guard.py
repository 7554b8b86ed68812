"""Stops the arm over HTTP: as a function, and as a process that does so when the cell dies.

An IRC5 has no watchdog on Robot Web Services: a motion program goes on to its end, whoever sent
it. The process holds a session of its own. Every line on its standard input, and the end of it,
makes it stop RAPID and, should the controller refuse, switch the motors off. It is run by path and
stands alone.
"""

from __future__ import annotations

import json
import sys
from typing import Any

_TRIES = 3
_ORDERS = (
    ("rw/rapid/execution?action=stop", {"stopmode": "stop"}),
    ("rw/panel/ctrlstate?action=setctrlstate", {"ctrl-state": "motoroff"}),
)


class StopSession:
    """A session that is logged in, so that a stop is one request.

    Parameters
    ----------
    url, user, password:
        Of Robot Web Services.
    timeout_s:
        Of every request.
    """

    def __init__(self, url: str, user: str, password: str, timeout_s: float) -> None:
        import requests
        from requests.auth import HTTPDigestAuth

        self._url = url
        self._timeout_s = timeout_s
        self._session = requests.Session()
        self._session.auth = HTTPDigestAuth(user, password)

    def log_in(self) -> None:
        """Make the first request, which costs the challenge; raises `OSError`."""
        self._session.get(f"{self._url}/rw/rapid/execution?json=1", timeout=self._timeout_s)

    def stop(self) -> str | None:
        """Stop RAPID, or else the motors; return None, or why neither could be done."""
        why = ""
        for path, payload in _ORDERS:
            refusal = self._post(path, payload)
            if refusal is None:
                return None
            why = refusal
        return why

    def _post(self, path: str, payload: dict[str, str]) -> str | None:
        why = ""
        for _ in range(_TRIES):
            try:
                address = f"{self._url}/{path}&json=1"
                answer = self._session.post(address, data=payload, timeout=self._timeout_s)
            except OSError as error:
                why = type(error).__name__
                continue
            return None if answer.ok else f"the controller refuses (HTTP {answer.status_code})"
        return why


def main() -> None:
    """Log in, say so, and stop the arm on every line and at the end."""
    options: dict[str, Any] = json.loads(sys.stdin.readline())
    session = StopSession(**options)
    session.log_in()
    print("ready", flush=True)
    for _ in sys.stdin:
        session.stop()
    session.stop()


if __name__ == "__main__":
    main()
