"""The way to a controller's web server: HTTPS where it has it, of a certificate that is known.

A controller's certificate is signed by itself, so that nobody vouches for it: what is trusted is
its fingerprint, which the operator compares once and writes into the cell file.
"""

from __future__ import annotations

import hashlib
import socket
import time
from typing import Any
from urllib.parse import urlsplit

from drivers.abb.guard import bare_tls, plain, session_for
from drivers.errors import DeviceRefused, DeviceUnreachable
from drivers.outside import check_depth

_HANDSHAKE_S = 1.0
_HTTPS_PORT, _HTTP_PORT = 443, 80
LARGEST_ANSWER_BYTES = 1 << 24
_CHUNK_BYTES = 1 << 16
IRC5, OMNICORE = 1, 2
_GENERATIONS = {"digest": IRC5, "basic": OMNICORE}


def certificate_of(host: str, port: int) -> str | None:
    """Return the SHA-256 fingerprint of the certificate shown there; None where no TLS is spoken.

    Nothing is sent but the handshake.
    """
    try:
        with (
            socket.create_connection((host, port), _HANDSHAKE_S) as link,
            bare_tls().wrap_socket(link, server_hostname=host) as secured,
        ):
            shown = secured.getpeercert(binary_form=True)
    except (OSError, ValueError):
        return None
    return hashlib.sha256(shown).hexdigest() if shown else None


def resolved(address: str, certificate_sha256: str | None) -> str:
    """Return the URL of a controller's web server, checked to be the one that is trusted.

    Parameters
    ----------
    address:
        ``host`` or ``host:port``, then HTTPS where that port (443 where none is given) speaks
        it; or a URL, whose scheme is kept to.
    certificate_sha256:
        Fingerprint of the certificate that is trusted, hexadecimal, with or without colons.

    Raises
    ------
    DeviceRefused
        It speaks HTTPS with a certificate that nobody trusted yet, or with another one; or it
        speaks no HTTPS, although a certificate was given.
    """
    url = urlsplit(address if "//" in address else f"//{address}")
    if url.username is not None or not url.hostname:
        raise DeviceRefused(
            f"ABB arm {url.hostname or address}: the address must be a name or an IP address, "
            "with a port or without, and no user name or password in it"
        )
    secure_port = url.port or _HTTPS_PORT
    shown = certificate_of(url.hostname, secure_port) if url.scheme != "http" else None
    if shown is None and url.scheme != "https" and certificate_sha256 is None:
        return f"http://{url.hostname}:{url.port or _HTTP_PORT}"
    _check(f"ABB arm {url.hostname}", shown, certificate_sha256)
    return f"https://{url.hostname}:{secure_port}"


def generation_of(url: str, certificate_sha256: str | None) -> int:
    """Return which Robot Web Services answer: `IRC5` (RobotWare 6) or `OMNICORE` (RobotWare 7).

    They are distinguished by the login that they ask for, before any is sent.

    Raises
    ------
    DeviceUnreachable
        No answer.
    DeviceRefused
        Neither of them answers, or the password would go over the wire in the open.
    """
    session = session_for(certificate_sha256)
    try:
        with session.get(
            f"{url}/rw/system", timeout=_HANDSHAKE_S, allow_redirects=False, stream=True
        ) as answer:
            asked = str(answer.headers.get("WWW-Authenticate", "")).split(" ")[0].lower()
    except OSError as error:
        raise silent(url, error) from None
    finally:
        session.close()
    if asked == "basic" and not url.startswith("https"):
        raise DeviceRefused(
            f"ABB arm {url}: asks for a password in the open, which a controller does not; see what"
            " answers there"
        )
    if asked not in _GENERATIONS:
        raise DeviceRefused(f"ABB arm {url}: what answers are not Robot Web Services")
    return _GENERATIONS[asked]


def silent(url: str, error: Exception) -> DeviceUnreachable:
    """The error for a controller whose web server does not answer."""
    return DeviceUnreachable(
        f"ABB arm {url}: Robot Web Services do not answer ({type(error).__name__}). Check power, "
        "cable (service or WAN port), address, and option 616-1 PC Interface (IRC5) or the "
        "network that Connected Services lets through (OmniCore)"
    )


def _check(arm: str, shown: str | None, trusted: str | None) -> None:
    if shown is None:
        raise DeviceRefused(
            f"{arm}: speaks no HTTPS. Check address, port and cable; or leave `https://` and the "
            "certificate's fingerprint away for a controller that has HTTP only"
        )
    if trusted is None:
        raise DeviceRefused(
            f"{arm}: speaks HTTPS with a certificate that nobody has trusted yet. Its SHA-256 "
            f"fingerprint is {shown}: compare it with the one that the controller shows (or see "
            "that no other machine can have answered), then write it into the cell file as "
            f"`certificate_sha256: {shown}`"
        )
    if plain(trusted) != shown:
        raise DeviceRefused(
            f"{arm}: its certificate has the fingerprint {shown}, another one than the cell file "
            "trusts. Either the controller was set up anew, or something else answers in its place"
        )


def read_whole(response: Any, deadline_s: float) -> Any:
    """Read a streamed answer's body into it, and no more than a controller has reason to send.

    Raises
    ------
    OSError
        It is too large, or did not end before the deadline on the monotonic clock, or is JSON
        nested too deep.
    """
    body = bytearray()
    for chunk in response.iter_content(_CHUNK_BYTES):
        body += chunk
        if len(body) > LARGEST_ANSWER_BYTES or time.monotonic() > deadline_s:
            response.close()
            raise OSError("an answer without an end")
    whole = bytes(body)
    if whole.lstrip().startswith((b"[", b"{")):
        try:
            check_depth(whole)
        except ValueError as error:
            raise OSError(f"an answer {error}") from None
    # the place where `requests` keeps a body that was read
    response._content = whole  # noqa: SLF001
    return response
