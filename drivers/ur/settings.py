"""What can be set about a Universal Robots arm."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.ur.robot_api import ROBOT_API_PORT


@dataclass(frozen=True)
class URSettings:
    """Settings of one arm; the defaults fit an e-Series on a quiet network.

    Attributes
    ----------
    rate_hz:
        RTDE packets a second.
    silence_s:
        Without a fresh packet for so long, the link counts as lost and the arm is ordered to stop.
    watchdog_hz:
        The controller stops the program when our process gives no sign at this rate.
    heartbeat_s:
        The process that moves the arm stops it when the cell is silent for so long.
    upper_registers:
        Use the registers 24 to 47, where a fieldbus or another client holds the lower ones.
    joint_acceleration_rad_s2, tcp_acceleration_m_s2:
        Of ``moveJ`` and ``moveL``.
    stop_deceleration_rad_s2:
        Of a stop through the script port.
    max_joint_speed_rad_s, max_tcp_speed_m_s:
        A target that asks for more is refused.
    start_timeout_s:
        For the control script to start.
    robot_api_port:
        Where PolyScope X serves its robot API.
    """

    rate_hz: float = 125.0
    silence_s: float = 0.25
    watchdog_hz: float = 4.0
    heartbeat_s: float = 2.0
    upper_registers: bool = False
    joint_acceleration_rad_s2: float = 1.4
    tcp_acceleration_m_s2: float = 1.2
    stop_deceleration_rad_s2: float = 5.0
    max_joint_speed_rad_s: float = 3.14
    max_tcp_speed_m_s: float = 1.0
    start_timeout_s: float = 10.0
    robot_api_port: int = ROBOT_API_PORT
