"""Robot Web Services 1.0 through abb-robot-client, with what that library leaves out; or 2.0.

It sets no time-out on any request, raises a bare `KeyError` for a wrong password and a bare
`Exception` for most else; here every request is bounded and every error has a name.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from drivers.abb.guard import session_for
from drivers.abb.login import Login
from drivers.abb.rws2 import Rws2
from drivers.abb.settings import ABBSettings
from drivers.abb.transport import OMNICORE, read_whole, silent
from drivers.errors import DeviceError, DeviceRefused
from drivers.outside import printable

_LONGEST_S = 5.0  # of one answer, however slowly it comes
_REMEDIES = {
    -1073445857: ". End the other program (RobotStudio, another run); from one whose link was lost"
    " an operator takes mastership away by turning to manual mode and back to automatic"
}
BeforeRequest = Callable[[str, str], None]


class Cancelled(Exception):
    """A request was not sent, since a stop came in between."""


def open_rws(
    url: str,
    settings: ABBSettings,
    generation: int,
    before_request: BeforeRequest | None = None,
) -> Any:
    """Return an `abb_robot_client.rws.RWS`, or an `Rws2`, whose every request is bounded.

    Parameters
    ----------
    url:
        Such as ``http://192.168.125.1``.
    settings:
        Login, certificate and time-outs.
    generation:
        See `drivers.abb.transport.generation_of`.
    before_request:
        Called with method and URL before each request; may raise `Cancelled`.
    """
    try:
        import abb_motion_program_exec  # noqa: F401 - missing is better known now than at the first move
        from abb_robot_client.rws import RWS
    except ImportError as error:
        raise DeviceRefused(
            f"ABB arm {url}: {error}: pip install 'calibration-cell[abb]'"
        ) from None
    login = login_in(url, settings)
    session = session_for(settings.certificate_sha256)
    send = session.request
    bounds = (settings.connect_timeout_s, settings.read_timeout_s)

    def request(method: str, address: str, **more: Any) -> Any:
        if before_request is not None:
            before_request(method, address)
        more |= {"timeout": bounds, "stream": True, "allow_redirects": False}
        deadline_s = time.monotonic() + _LONGEST_S
        return read_whole(send(method, address, **more), deadline_s)

    session.request = request
    if generation == OMNICORE:
        return Rws2(url, session, login)
    rws = RWS(url, login.user, login.password)
    # the library offers no other place for a time-out
    rws._session = session  # noqa: SLF001
    return rws


def login_in(url: str, settings: ABBSettings) -> Login:
    """Return the login of the settings; raises `DeviceRefused` where there is none."""
    if settings.login is None:
        raise DeviceRefused(f"ABB arm {url}: no user name and password were given")
    return settings.login


@contextmanager
def named(url: str) -> Iterator[None]:
    """Turn what the libraries raise into errors of ours.

    Raises
    ------
    DeviceUnreachable
        No connection, or no answer in time.
    DeviceRefused
        Wrong password, or the controller refused.
    DeviceError
        Anything else that the library raises.
    """
    try:
        yield
    except (DeviceError, Cancelled):
        raise
    except OSError as error:  # of which everything that `requests` raises is a kind
        raise silent(url, error) from None
    except KeyError as error:
        raise DeviceRefused(
            f"ABB arm {url}: unexpected answer (no {printable(str(error))}). "
            "Most often the user name or the password is wrong"
        ) from None
    except Exception as error:
        raise _refusal(url, error) from None


def _refusal(url: str, error: Exception) -> DeviceError:
    code = getattr(error, "code", None)
    if code == -1 or "401" in str(error):
        return DeviceRefused(f"ABB arm {url}: user name or password is wrong")
    if code is not None:
        text = f"{printable(str(error))} (code {code}){_REMEDIES.get(code, '')}"
        return DeviceRefused(f"ABB arm {url}: the controller refuses: {text}")
    return DeviceError(f"ABB arm {url}: {printable(str(error)) or type(error).__name__}")
