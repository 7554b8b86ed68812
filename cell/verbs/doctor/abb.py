"""Whether an ABB arm would let itself be driven; only questions are asked."""

from __future__ import annotations

from cell.storage.files.cell_file import AbbRobot
from cell.verbs.doctor.finding import Finding
from cell.verbs.doctor.ports import host_port, port
from drivers.abb.link_watch import LinkWatch
from drivers.errors import DeviceError


def abb(robot: AbbRobot) -> list[Finding]:
    """The port of Robot Web Services, login, mode, motors, programs, the watch over the link."""
    answers = port("ABB Robot Web Services", *host_port(robot.address, 80))
    return [answers, *_state(robot)] if answers.ready else [answers]


def _state(robot: AbbRobot) -> list[Finding]:
    from drivers.abb.rws import named, open_rws
    from drivers.abb.settings import ABBSettings
    from drivers.abb.status import fault_in

    url = f"http://{robot.address}"
    try:
        rws = open_rws(url, ABBSettings(robot.user, robot.password))
        with named(url):
            fault = fault_in(rws)
            execution = str(rws.get_execution_state().ctrlexecstate)
    except DeviceError as refusal:
        mend = "correct what it says; robot.user and robot.password stand in the cell file"
        return [Finding("ABB login", False, str(refusal), mend)]
    settings = ABBSettings()
    watch = LinkWatch(url, rws, settings.link_watch_s if robot.link_watch else None)
    return [
        _link_watch(watch, robot.link_watch),
        Finding("ABB mode and motors", fault is None, fault or "automatic, motors on", "see there"),
        Finding(
            "ABB program",
            execution != "running",
            execution,
            "stop the RAPID program that runs",
        ),
    ]


def _link_watch(watch: LinkWatch, wanted: bool) -> Finding:
    name = "ABB link watch"
    if not wanted:
        mend = "load cell_watch.mod there and write `link_watch: true`"
        return Finding(name, False, "none: a cut cable stops nothing", mend, needed=False)
    try:
        watch.check()
    except DeviceError as missing:
        return Finding(name, False, str(missing), "see there")
    return Finding(name, True, "the controller stops a motion when this computer is silent")
