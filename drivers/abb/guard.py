"""Stops the arm over HTTP: as a function, and as a process that does so when the cell dies.

An IRC5 has no watchdog on Robot Web Services: a motion program goes on to its end, whoever sent
it. The process holds a session of its own. Every line on its standard input, and the end of it,
makes it stop RAPID and, should the controller refuse or the line say so, switch the motors off. One
line is no order: it names the session of the cell, whose mastership is given back at the end, as a
cell that died cannot do, and no other run could begin. It is run by path and stands alone.
"""

from __future__ import annotations

import contextlib
import json
import ssl
import sys
from typing import Any

_TRIES = 3
_NO_CONTENT, _REFUSED = 204, 300
STOP, MOTORS_OFF, READY = "stop", "motors off", "ready"
SESSION = "session "
_RELEASE = "rw/mastership/edit/release"
_RAPID_STOP, _MOTORS_OFF = {"stopmode": "stop"}, {"ctrl-state": "motoroff"}
_ORDERS = {
    1: (
        ("rw/rapid/execution?action=stop&json=1", _RAPID_STOP),
        ("rw/panel/ctrlstate?action=setctrlstate&json=1", _MOTORS_OFF),
    ),
    2: (
        ("rw/rapid/execution/stop", _RAPID_STOP),
        ("rw/panel/ctrl-state", _MOTORS_OFF),
    ),
}
_HEADERS = {
    1: {},
    2: {
        "Accept": "application/hal+json;v=2.0",
        "Content-Type": "application/x-www-form-urlencoded;v=2.0",
    },
}


def plain(fingerprint: str) -> str:
    """A fingerprint without colons, in small letters."""
    return fingerprint.replace(":", "").strip().lower()


def bare_tls() -> ssl.SSLContext:
    """TLS that knows no authorities.

    None has signed a controller's certificate, and to load them takes longer than a stop may.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


def session_for(certificate_sha256: str | None) -> Any:
    """Return a `requests.Session` to one controller.

    It takes no proxy and no password from its surroundings, follows nobody elsewhere, and trusts
    the certificate with this fingerprint only.
    """
    import requests

    session = requests.Session()
    session.trust_env = False
    if certificate_sha256 is not None:
        session.verify = False  # the fingerprint is checked in place of a chain of signatures
        session.mount("https://", _pinned(plain(certificate_sha256)))
    return session


def _pinned(fingerprint: str) -> Any:
    from requests.adapters import HTTPAdapter

    class Pinned(HTTPAdapter):
        def init_poolmanager(self, *arguments: Any, **more: Any) -> Any:
            more |= {"assert_fingerprint": fingerprint, "ssl_context": bare_tls()}
            return super().init_poolmanager(*arguments, **more)

    return Pinned()


class StopSession:
    """A session that is logged in, so that a stop is one request.

    Parameters
    ----------
    url, user, password:
        Of Robot Web Services.
    timeout_s:
        Of every request.
    certificate_sha256:
        Fingerprint of the certificate that is trusted; None for HTTP.
    generation:
        1 for Robot Web Services 1.0 (IRC5, digest login), 2 for 2.0 (OmniCore, basic login).
    """

    def __init__(
        self,
        url: str,
        user: str,
        password: str,
        timeout_s: float,
        certificate_sha256: str | None = None,
        generation: int = 1,
    ) -> None:
        from requests.auth import HTTPBasicAuth, HTTPDigestAuth

        self._url = url
        self._generation = generation
        self._timeout_s = timeout_s
        self._session = session_for(certificate_sha256)
        login = HTTPDigestAuth if generation == 1 else HTTPBasicAuth
        self._session.auth = login(user, password)

    def log_in(self) -> None:
        """Make the first request, which costs the challenge; raises `OSError`."""
        for left in reversed(range(_TRIES)):
            try:
                # read, so that the connection stands open for the stop, no handshake in its way
                self._ask("GET", f"{self._url}/rw/rapid/execution?json=1", read=True)
                return
            except OSError:
                if not left:
                    raise

    def stop(self, *, motors_off: bool = False) -> str | None:
        """Stop RAPID, or else the motors; return None, or why neither could be done.

        `motors_off` switches them off even where RAPID's stop was taken.
        """
        why = ""
        for path, payload in _ORDERS[self._generation]:
            refusal = self._post(path, payload)
            if refusal is None and not motors_off:
                return None
            why = refusal or ""
        return why or None

    def give_back(self, cookie: str) -> None:
        """Release, as far as that can be done, what the session with this cookie is master of."""
        with contextlib.suppress(OSError):
            self._session.cookies.clear()
            self._session.cookies.update(
                dict(part.split("=", 1) for part in cookie.split("; ") if "=" in part)
            )
            self._ask("POST", f"{self._url}/{_RELEASE}", {})

    def _post(self, path: str, payload: dict[str, str]) -> str | None:
        why = ""
        for _ in range(_TRIES):
            try:
                status = self._ask("POST", f"{self._url}/{path}", payload)
            except OSError as error:
                why = type(error).__name__
                continue
            return None if status < _REFUSED else f"the controller refuses (HTTP {status})"
        return why

    def _ask(
        self,
        method: str,
        address: str,
        payload: dict[str, str] | None = None,
        *,
        read: bool = False,
    ) -> int:
        """Return the status of an answer.

        Whatever follows it is not waited for, and the connection is given up with it, unless it
        is to be `read`.
        """
        answer = self._session.request(
            method,
            address,
            data=payload,
            headers=_HEADERS[self._generation],
            timeout=self._timeout_s,
            allow_redirects=False,
            stream=True,
        )
        if read or answer.status_code == _NO_CONTENT:
            _ = answer.content
        else:
            answer.close()
        return int(answer.status_code)


def main() -> None:
    """Log in, say so, and stop the arm on every line and at the end."""
    options: dict[str, Any] = json.loads(sys.stdin.readline())
    session = StopSession(**options)
    try:
        session.log_in()
    except OSError as error:
        print(type(error).__name__, flush=True)
        return
    print(READY, flush=True)
    cookie = ""
    for line in sys.stdin:
        if line.startswith(SESSION):
            cookie = line.removeprefix(SESSION).strip()
        else:
            session.stop(motors_off=line.strip() == MOTORS_OFF)
    session.stop()
    if cookie:
        session.give_back(cookie)


if __name__ == "__main__":
    main()
