"""Who logs in to a controller."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Login:
    """User name and password of Robot Web Services; the password shows in no message."""

    user: str
    password: str = field(repr=False)


FACTORY_LOGIN = Login("Default User", "robotics")
"""ABB's own, the same on every controller whose owner has not changed it: anybody knows it."""
