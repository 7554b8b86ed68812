"""Robot Web Services through abb-robot-client, with what that library leaves out.

It sets no time-out on any request, raises a bare `KeyError` for a wrong password and a bare
`Exception` for most else; here every request is bounded and every error has a name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from drivers.abb.settings import ABBSettings
from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable

BeforeRequest = Callable[[str, str], None]


class Cancelled(Exception):
    """A request was not sent, since a stop came in between."""


def open_rws(url: str, settings: ABBSettings, before_request: BeforeRequest | None = None) -> Any:
    """Return an `abb_robot_client.rws.RWS` whose every request is bounded.

    Parameters
    ----------
    url:
        Such as ``http://192.168.125.1``.
    settings:
        User, password and time-outs.
    before_request:
        Called with method and URL before each request; may raise `Cancelled`.
    """
    try:
        import abb_motion_program_exec  # noqa: F401 - told now rather than at the first move
        from abb_robot_client.rws import RWS
    except ImportError as error:
        raise DeviceRefused(
            f"ABB arm {url}: {error}: pip install 'calibration-cell[abb]'"
        ) from None
    rws = RWS(url, settings.user, settings.password)
    # the library offers no other place for a time-out
    session = rws._session  # noqa: SLF001
    send = session.request
    bounds = (settings.connect_timeout_s, settings.read_timeout_s)

    def request(method: str, address: str, **more: Any) -> Any:
        if before_request is not None:
            before_request(method, address)
        return send(method, address, timeout=bounds, **more)

    session.request = request
    return rws


@contextmanager
def named(url: str) -> Iterator[None]:
    """Turn what the libraries raise into errors of ours.

    Raises
    ------
    DeviceUnreachable
        No connection, or no answer in time.
    DeviceRefused
        Wrong password, or the controller said no.
    DeviceError
        Anything else that the library raises.
    """
    try:
        yield
    except (DeviceError, Cancelled):
        raise
    except OSError as error:  # of which everything that `requests` raises is a kind
        raise DeviceUnreachable(
            f"ABB arm {url}: Robot Web Services do not answer ({type(error).__name__}). Check "
            "power, cable (service or WAN port), address, and option 616-1 PC Interface; an "
            "OmniCore controller (RobotWare 7) speaks RWS 2.0, which this driver does not"
        ) from None
    except KeyError as error:
        raise DeviceRefused(
            f"ABB arm {url}: unexpected answer (no {error}). Most often the user name or the "
            "password is wrong"
        ) from None
    except Exception as error:
        raise _refusal(url, error) from None


def _refusal(url: str, error: Exception) -> DeviceError:
    code = getattr(error, "code", None)
    if code == -1 or "401" in str(error):
        return DeviceRefused(f"ABB arm {url}: user name or password is wrong")
    if code is not None:
        return DeviceRefused(f"ABB arm {url}: the controller refuses: {error} (code {code})")
    return DeviceError(f"ABB arm {url}: {error}")
