"""What can be set about an ABB arm."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from drivers.abb.login import Login

IRB140_LIMITS_RAD = tuple(
    (math.radians(low), math.radians(high))
    for low, high in ((-180, 180), (-90, 110), (-230, 50), (-200, 200), (-115, 115), (-400, 400))
)
"""ABB, "Product specification IRB 140", working range."""


@dataclass(frozen=True)
class ABBSettings:
    """Settings of one arm; the defaults fit an IRB 140 on an IRC5.

    Attributes
    ----------
    login:
        User name and password of Robot Web Services; nothing is sent without. ABB's own are
        `drivers.abb.login.FACTORY_LOGIN`.
    certificate_sha256:
        Fingerprint of the controller's certificate, where it speaks HTTPS.
    poll_s:
        Between two questions to an arm on its way; see `drivers.abb.pace`. The controller bears
        fewer than twenty requests a second.
    silence_s:
        Without a fresh reading for so long, the link counts as lost and the arm is ordered to stop.
    link_watch_s:
        The controller stops a motion when it hears nothing from here for so long; None where
        `rapid/cell_watch.mod` is not loaded there, and then a cut cable stops nothing.
    connect_timeout_s, read_timeout_s:
        Of every request.
    egm_port:
        UDP port where the controller's EGM feedback is to arrive; None for no EGM.
    joint_limits_rad:
        Lowest and highest angle of each joint.
    max_joint_speed_rad_s, max_tcp_speed_m_s:
        A target that asks for more is refused.
    """

    login: Login | None = None
    certificate_sha256: str | None = None
    poll_s: float = 0.2
    silence_s: float = 1.0
    link_watch_s: float | None = 0.6
    connect_timeout_s: float = 0.5
    read_timeout_s: float = 0.8
    egm_port: int | None = None
    joint_limits_rad: tuple[tuple[float, float], ...] = IRB140_LIMITS_RAD
    max_joint_speed_rad_s: float = 3.14
    max_tcp_speed_m_s: float = 1.0

    def without_link_watch(self) -> ABBSettings:
        """Return the same for a controller that does not watch the link."""
        return replace(self, link_watch_s=None)
