"""What is asked and ordered of a controller beside its motion, whichever PolyScope it runs.

PolyScope 3 and 5 have the dashboard server for it, PolyScope X the robot API. Which it is shows
by what answers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class StopOrder:
    """A stop as bytes on a connection that is kept open, so that it need not wait for an answer.

    Attributes
    ----------
    name:
        Of the way, for messages.
    port:
        TCP port of the controller.
    message, power_off:
        What is sent to end the program, and to let the brakes fall in.
    """

    name: str
    port: int
    message: bytes
    power_off: bytes


class Panel(Protocol):
    """One controller's panel. All calls are bounded and raise `DeviceError`."""

    @property
    def stop_order(self) -> StopOrder:
        """What ends the program that runs."""

    def identity(self) -> dict[str, str]:
        """Version, model and serial number, as far as the controller reports them."""

    def in_local_mode(self) -> bool:
        """Whether programs from outside are ignored; False where the controller cannot say."""

    def safety(self) -> str:
        """The safety mode in the controller's words; holds NORMAL or REDUCED where all is well."""

    def robot_mode(self) -> str:
        """The arm's mode in the controller's words; holds RUNNING where it is powered."""

    def stop_program(self) -> None:
        """End the program that runs."""

    def unlock_protective_stop(self) -> str | None:
        """Release a protective stop; return None, or why the controller does not."""

    def close(self) -> None:
        """Let go of the controller. Idempotent."""
