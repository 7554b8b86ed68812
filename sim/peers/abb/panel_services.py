"""What clients ask an IRC5 besides motion: speed ratio, signals, RAPID data, mastership, files.

Source: ABB, "Robot Web Services 1.0": panel, iosystem, rapid (symbol), mastership, users (rmmp) and
file services.
"""

from __future__ import annotations

from typing import Protocol
from urllib.parse import parse_qs

from sim.peers.abb.answers import DONE, NOT_ALLOWED, Answer, error, missing, state
from sim.peers.abb.cell_watch import CellWatch
from sim.peers.abb.panel import PanelState

RAMDISK = "RAMDISK"
_FILES, _SIGNALS, _SYMBOL = "fileservice/", "rw/iosystem/signals/", "rw/rapid/symbol/data/RAPID/"
_WATCH = "T_CELL_WATCH/cell_watch/cell_watch_"
_DOMAINS = ("cfg", "motion", "rapid")
_TAKEN = -1073445857


class Controller(Protocol):
    """What these services show and change."""

    panel: PanelState
    files: dict[str, bytes]
    signals: dict[str, float]
    rapid_data: dict[str, str]
    watch: CellWatch


class PanelServices:
    """Answers requests below their paths; None for a path that is none of theirs."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._masters: set[str] = set()

    def answer(self, method: str, path: str, query: dict[str, str], body: bytes) -> Answer | None:
        """Return what a request gets."""
        values = {key: given[0] for key, given in parse_qs(body.decode(errors="replace")).items()}
        action = query.get("action", "")
        if path.startswith(_FILES):
            return self._file(method, path.removeprefix(_FILES), body)
        if path.startswith(_SYMBOL):
            return self._data(method, path.removeprefix(_SYMBOL), values)
        if path.startswith(_SIGNALS):
            return self._signal(method, path.removeprefix(_SIGNALS), values)
        if path.startswith("rw/mastership"):
            return self._mastership(path.removeprefix("rw/mastership").strip("/"), action)
        return self._small(method, path, values)

    def _small(self, method: str, path: str, values: dict[str, str]) -> Answer | None:
        panel = self._controller.panel
        if path == "rw/panel/speedratio":
            if method == "GET":
                ratio = f"{panel.speed_ratio:g}"
                return state({"_type": "pnl-speedratio", "speedratio": ratio})
            return self._set_speed(values)
        if path == "rw/rapid/symbols":
            return self._symbols(values.get("blockurl", "RAPID"))
        if path == "users/rmmp/poll":
            return state({"_type": "user-rmmp-poll", "status": "GRANTED"})
        return DONE if path in ("logout", "users/rmmp") else None

    def _set_speed(self, values: dict[str, str]) -> Answer:
        try:
            ratio = float(values["speed-ratio"])
        except (KeyError, ValueError):
            return error(400, -1073445862, "no speed ratio")
        if not 0 <= ratio <= 100 or self._controller.panel.mode != "AUTO":
            return NOT_ALLOWED
        self._controller.panel.speed_ratio = ratio
        return DONE

    def _signal(self, method: str, name: str, values: dict[str, str]) -> Answer:
        signals = self._controller.signals
        if name not in signals:
            return missing(name)
        if method == "POST":
            signals[name] = float(values["lvalue"])
            return DONE
        reported = {
            "name": name.rpartition("/")[2],
            "lvalue": f"{signals[name]:g}",
            "lstate": "normal",
        }
        return state({"_type": "ios-signal", "_title": name, **reported})

    def _data(self, method: str, name: str, values: dict[str, str]) -> Answer:
        watch = self._controller.watch
        if name.startswith(_WATCH) and watch.loaded:
            return self._watched(method, name.removeprefix(_WATCH), values)
        data = self._controller.rapid_data
        if name not in data:
            return missing(name)
        if method == "GET":
            return state({"_type": "rap-data", "value": data[name]})
        data[name] = values["value"]
        return DONE

    def _watched(self, method: str, name: str, values: dict[str, str]) -> Answer:
        watched = self._controller.watch.values
        if name not in watched:
            return missing(name)
        if method == "GET":
            return state({"_type": "rap-data", "value": f"{watched[name]:g}"})
        watched[name] = float(values["value"])
        return DONE

    def _symbols(self, block: str) -> Answer:
        watch = self._controller.watch
        names = [f"RAPID/{name}" for name in self._controller.rapid_data]
        names += [f"RAPID/{_WATCH}{name}" for name in watch.values if watch.loaded]
        found = [name for name in names if name.startswith(block)]
        return state(
            *(
                {
                    "_type": "rap-symproppers-li",
                    "symburl": name,
                    "name": name.rpartition("/")[2],
                    "symtyp": "per",
                }
                for name in found
            )
        )

    def _mastership(self, domain: str, action: str) -> Answer:
        domains = {domain} if domain else set(_DOMAINS)
        if not domains <= set(_DOMAINS):
            return missing(domain)
        if not action:
            held = {True: "remote", False: "nomaster"}
            return state(
                *(
                    {"_type": "msh-resource-li", "_title": one, "mastership": held[one in taken]}
                    for taken in (self._masters,)
                    for one in sorted(domains)
                )
            )
        if action == "request":
            if domains & self._masters:
                return error(403, _TAKEN, "mastership is held already")
            self._masters |= domains
        else:
            self._masters -= domains
        return DONE

    def _file(self, method: str, name: str, body: bytes) -> Answer:
        files = self._controller.files
        name = name.replace(f"${RAMDISK}", RAMDISK).rstrip("/")
        if method == "PUT":
            files[name] = body
            return Answer(201)
        if name in files:
            if method == "DELETE":
                del files[name]
                return DONE
            return Answer(200, files[name])
        inside = [file.removeprefix(f"{name}/") for file in files if file.startswith(f"{name}/")]
        if method == "GET" and (inside or name == RAMDISK):
            return state(*({"_type": "fs-file", "_title": file} for file in inside))
        return error(404, -1073414146, f"no such file: {name}")
