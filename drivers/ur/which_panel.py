"""Distinguishes PolyScope 3 and 5 from PolyScope X by what answers."""

from __future__ import annotations

import contextlib
import socket

from drivers.errors import DeviceUnreachable
from drivers.ur.dashboard import DASHBOARD_PORT
from drivers.ur.dashboard_panel import DashboardPanel
from drivers.ur.panel import Panel
from drivers.ur.robot_api import RobotApi

_CONNECT_S = 1.0


def panel_of(host: str, robot_api_port: int) -> Panel:
    """Return the panel of the controller at `host`.

    PolyScope X closes the dashboard's port and serves the robot API.

    Raises
    ------
    DeviceUnreachable
        Neither answers.
    """
    try:
        with socket.create_connection((host, DASHBOARD_PORT), _CONNECT_S):
            return DashboardPanel(host)
    except OSError as error:
        api = RobotApi(host, robot_api_port)
        with contextlib.suppress(DeviceUnreachable):
            api.version()
            return api
        api.close()
        raise DeviceUnreachable(
            f"UR controller {host}: neither the dashboard server (port {DASHBOARD_PORT}: {error}) "
            f"nor PolyScope X's robot API (port {robot_api_port}) answers. Check power, cable "
            "and address, and that the service is enabled (Settings, Security, Services)"
        ) from None
