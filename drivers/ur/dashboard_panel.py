"""`drivers.ur.panel.Panel` of PolyScope 3 and 5: the dashboard server."""

from __future__ import annotations

from drivers.ur.dashboard import DASHBOARD_PORT, Dashboard
from drivers.ur.panel import StopOrder


class DashboardPanel:
    """The panel behind one dashboard server.

    Parameters
    ----------
    host:
        The controller's address.
    timeout_s:
        Of every question.
    """

    def __init__(self, host: str, timeout_s: float = 2.0) -> None:
        self._dashboard, self._timeout_s = Dashboard(host), timeout_s

    @property
    def stop_order(self) -> StopOrder:
        """What ends the program that runs."""
        return StopOrder("dashboard", DASHBOARD_PORT, b"stop\n", b"power off\n")

    def identity(self) -> dict[str, str]:
        """Version, model and serial number."""
        questions = {
            "polyscope": "PolyscopeVersion",
            "model": "get robot model",
            "serial": "get serial number",
        }
        return {key: self._ask(line) for key, line in questions.items()}

    def in_local_mode(self) -> bool:
        """Whether programs from outside are ignored; CB3 does not know the question."""
        return self._ask("is in remote control") == "false"

    def safety(self) -> str:
        """The safety status."""
        return self._ask("safetystatus")

    def robot_mode(self) -> str:
        """The arm's mode."""
        return self._ask("robotmode")

    def stop_program(self) -> None:
        """End the program that runs."""
        self._ask("stop")

    def unlock_protective_stop(self) -> str | None:
        """Release a protective stop; return None, or the controller's refusal."""
        self._ask("close safety popup")
        answer = self._ask("unlock protective stop")
        return None if answer.startswith("Protective stop releasing") else answer

    def close(self) -> None:
        """Let go of the server."""
        self._dashboard.close()

    def _ask(self, line: str) -> str:
        return self._dashboard.ask(line, self._timeout_s)
