"""What an ABB arm is driven with: its cell file, and a login that stands outside of it."""

from __future__ import annotations

import os
from pathlib import Path

from cell.errors import InputError
from cell.storage.files.cell_file import AbbRobot
from drivers.abb.login import FACTORY_LOGIN, Login
from drivers.abb.settings import ABBSettings

USER_VARIABLE, PASSWORD_VARIABLE = "CELL_ROBOT_USER", "CELL_ROBOT_PASSWORD"
_LARGEST_FILE_BYTES = 4096


def abb_settings(robot: AbbRobot) -> ABBSettings:
    """Settings of a cell's ABB arm; raises `InputError` where no login is to be had."""
    settings = ABBSettings(
        login=_login(robot), certificate_sha256=robot.certificate_sha256, egm_port=robot.egm_port
    )
    return settings if robot.link_watch else settings.without_link_watch()


def _login(robot: AbbRobot) -> Login:
    if robot.factory_password:
        return FACTORY_LOGIN
    if robot.credentials_file is not None:
        return _in_file(robot.credentials_file)
    user, password = os.environ.get(USER_VARIABLE), os.environ.get(PASSWORD_VARIABLE)
    if user and password:
        return Login(user, password)
    raise InputError(
        f"ABB arm {robot.address}: no login. Set {USER_VARIABLE} and {PASSWORD_VARIABLE} in the"
        " environment; or name a file of two lines, user and password, as"
        " `robot.credentials_file`; or write `robot.factory_password: true` where the controller"
        " still has the password that every one of them is delivered with"
    )


def _in_file(path: Path) -> Login:
    """The login in a file; what the file says shows in no message."""
    try:
        with path.open("rb") as file:
            lines = file.read(_LARGEST_FILE_BYTES).decode().splitlines()
    except (OSError, UnicodeDecodeError) as fault:
        why = getattr(fault, "strerror", None) or "is no text in UTF-8"
        raise InputError(f"{path}: the login cannot be read: {why}") from None
    if len(lines) != 2 or not all(lines):
        raise InputError(f"{path}: must have two lines, the user name and the password")
    return Login(*lines)
