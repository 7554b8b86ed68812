"""Whether an ABB arm would let itself be driven; only questions are asked."""

from __future__ import annotations

from cell.devices.abb_settings import abb_settings
from cell.errors import InputError
from cell.storage.files.cell_file import AbbRobot
from cell.verbs.doctor.finding import Finding
from cell.verbs.doctor.ports import host_port, port
from drivers.abb.link_watch import LinkWatch
from drivers.errors import DeviceError

_PORTS = (443, 80)


def abb(robot: AbbRobot) -> list[Finding]:
    """The port of Robot Web Services, login, mode, motors, programs, the watch over the link."""
    host, number = host_port(robot.address, 0)
    for standard in (number,) if number else _PORTS:
        answers = port("ABB Robot Web Services", host, standard)
        if answers.ready:
            return [answers, *_state(robot)]
    return [answers]


def _state(robot: AbbRobot) -> list[Finding]:
    from drivers.abb.rws import named, open_rws
    from drivers.abb.status import fault_in
    from drivers.abb.transport import OMNICORE, generation_of, resolved

    try:
        settings = abb_settings(robot)
        url = resolved(robot.address, robot.certificate_sha256)
        generation = generation_of(url, robot.certificate_sha256)
        rws = open_rws(url, settings, generation)
        with named(url):
            fault = fault_in(rws)
            execution = str(rws.get_execution_state().ctrlexecstate)
    except (DeviceError, InputError) as refusal:
        return [Finding("ABB login", False, str(refusal), "correct what it says")]
    watch = LinkWatch(url, rws, settings.link_watch_s)
    kind = "OmniCore (RobotWare 7, RWS 2.0)" if generation == OMNICORE else "IRC5 (RobotWare 6)"
    return [
        Finding("ABB controller", True, kind),
        _secured(url),
        _link_watch(watch, robot.link_watch),
        Finding("ABB mode and motors", fault is None, fault or "automatic, motors on", "see there"),
        Finding(
            "ABB program",
            execution != "running",
            execution,
            "stop the RAPID program that runs",
        ),
    ]


def _secured(url: str) -> Finding:
    found = "yes, of a certificate that the cell file trusts"
    if not url.startswith("https"):
        found = "no, HTTP: whoever is on this network can read along and order"
    mend = "keep the robot on a network of its own; switch HTTPS on where the controller has it"
    return Finding("ABB HTTPS", url.startswith("https"), found, mend, needed=False)


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
