"""The device's features, once: their GenICam XML and their registers both come from here.

Names follow the EMVA Standard Features Naming Convention (SFNC) 2.7.1; `OpticControl` is its
chapter 23. The XML follows the GenApi 2.1.1 schema, RegisterDescription 1.1.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

from sim.peers.gige.gvsp import MONO8, MONO16

STREAM_PACKET_SIZE = 0x0D04
STREAM_PACKET_DELAY = 0x0D08
TICK_FREQUENCY = 0x093C
HEARTBEAT_TIMEOUT = 0x0938

Value = int | float


@dataclass(frozen=True)
class Feature:
    """One feature of the device.

    Attributes
    ----------
    kind:
        `integer`, `float`, `enumeration`, `command` or `string`.
    access:
        RO, RW or WO.
    default, low, high, unit:
        Start value and range, in the feature's own unit.
    entries:
        Values of an enumeration by name.
    address, width:
        A fixed (bootstrap) register and, of a string, its bytes; None: the device lays it out.
    locked_while_streaming:
        The device refuses to write it during an acquisition.
    """

    name: str
    category: str
    kind: str
    default: Value = 0
    low: float | None = None
    high: float | None = None
    unit: str = ""
    access: str = "RW"
    entries: dict[str, int] = field(default_factory=dict)
    address: int | None = None
    width: int = 0
    locked_while_streaming: bool = False

    @property
    def length(self) -> int:
        """Bytes of its register."""
        if self.kind == "string":
            return self.width
        return 8 if self.kind == "float" else 4

    def pack(self, value: Value) -> bytes:
        """A value as the register holds it."""
        if self.kind == "float":
            return struct.pack(">d", value)
        return struct.pack(">I", value)

    def unpack(self, data: bytes) -> Value:
        """The value that register bytes stand for."""
        if self.kind == "float":
            return float(struct.unpack(">d", data)[0])
        return int.from_bytes(data, "big")

    def allows(self, value: Value) -> bool:
        """Whether the device takes that value."""
        if self.kind == "enumeration":
            return value in self.entries.values()
        if self.low is None or self.high is None:
            return True
        return self.low <= value <= self.high


_OFF_ONCE_CONTINUOUS = {"Off": 0, "Once": 1, "Continuous": 2}
OPTIC_STATUS = {"NotInitialized": 1, "Busy": 3, "Ready": 4, "Error": 5}


def _enumeration(name: str, category: str, entries: dict[str, int], **kw: object) -> Feature:
    options = {"default": next(iter(entries.values())), **kw}
    return Feature(name, category, "enumeration", entries=entries, **options)  # type: ignore[arg-type]


def device_features(width: int, height: int) -> tuple[Feature, ...]:
    """The features of a camera of that size, pixels."""
    image, acquisition = "ImageFormatControl", "AcquisitionControl"
    transport, info = "TransportLayerControl", "DeviceControl"
    return (
        _text("DeviceVendorName", 0x0048, 32),
        _text("DeviceModelName", 0x0068, 32),
        _text("DeviceVersion", 0x0088, 32),
        _text("DeviceManufacturerInfo", 0x00A8, 48),
        _text("DeviceSerialNumber", 0x00D8, 16),
        _text("DeviceUserID", 0x00E8, 16),
        Feature("DeviceTemperature", info, "float", 35.0, unit="C", access="RO"),
        Feature("Width", image, "integer", width, 16, width, locked_while_streaming=True),
        Feature("Height", image, "integer", height, 16, height, locked_while_streaming=True),
        Feature("SensorWidth", image, "integer", width, access="RO"),
        Feature("SensorHeight", image, "integer", height, access="RO"),
        _enumeration(
            "PixelFormat", image, {"Mono8": MONO8, "Mono16": MONO16}, locked_while_streaming=True
        ),
        _enumeration("AcquisitionMode", acquisition, {"Continuous": 0, "SingleFrame": 1}),
        Feature("AcquisitionStart", acquisition, "command", access="WO"),
        Feature("AcquisitionStop", acquisition, "command", access="WO"),
        Feature("AcquisitionFrameRate", acquisition, "float", 20.0, 0.1, 200.0, "Hz"),
        _enumeration("TriggerSelector", acquisition, {"FrameStart": 0}),
        _enumeration("TriggerMode", acquisition, {"Off": 0, "On": 1}),
        _enumeration("TriggerSource", acquisition, {"Software": 0, "Line0": 1}, default=1),
        Feature("TriggerSoftware", acquisition, "command", access="WO"),
        Feature("ExposureTime", acquisition, "float", 10000.0, 10.0, 1e6, "us"),
        _enumeration("ExposureAuto", acquisition, _OFF_ONCE_CONTINUOUS, default=2),
        Feature("Gain", "AnalogControl", "float", 0.0, 0.0, 24.0, "dB"),
        _enumeration("GainAuto", "AnalogControl", _OFF_ONCE_CONTINUOUS, default=2),
        Feature("PayloadSize", transport, "integer", width * height, access="RO"),
        _fixed("GevSCPSPacketSize", STREAM_PACKET_SIZE, 0xFFFF),
        _fixed("GevSCPD", STREAM_PACKET_DELAY, 0x7FFFFFFF),
        _fixed("GevHeartbeatTimeout", HEARTBEAT_TIMEOUT, 0xFFFF),
    )


def optic_features(steps: int) -> tuple[Feature, ...]:
    """The features of a motorised lens with so many focus steps."""
    optic = "OpticControl"
    return (
        _enumeration("OpticControllerSelector", optic, {"OpticController0": 0}),
        _enumeration("OpticControllerStatus", optic, OPTIC_STATUS, access="RO"),
        Feature("OpticControllerInitialize", optic, "command", access="WO"),
        _enumeration("FocusStatus", optic, OPTIC_STATUS, access="RO"),
        Feature("FocusInitialize", optic, "command", access="WO"),
        Feature("FocusStepper", optic, "integer", 0, 0, steps),
        _enumeration("FocusAuto", optic, _OFF_ONCE_CONTINUOUS, default=2),
    )


def _fixed(name: str, address: int, high: int) -> Feature:
    return Feature(name, "TransportLayerControl", "integer", low=0, high=high, address=address)


def _text(name: str, address: int, width: int) -> Feature:
    """A name of the device; hosts read it, in the discovery answer too."""
    return Feature(name, "DeviceControl", "string", access="RO", address=address, width=width)


def xml_of(layout: dict[int, Feature], model: str) -> bytes:
    """The GenICam description of features laid out at those addresses."""
    categories: dict[str, list[str]] = {}
    for feature in layout.values():
        categories.setdefault(feature.category, []).append(feature.name)
    nodes = [_category("Root", categories)]
    nodes += [_category(name, members) for name, members in categories.items()]
    nodes += [_feature_node(f) + _register_node(f, at) for at, f in layout.items()]
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n'
        f'<RegisterDescription ModelName="{escape(model)}" VendorName="CalibrationCell" '
        'ToolTip="Simulated camera" StandardNameSpace="GEV" SchemaMajorVersion="1" '
        'SchemaMinorVersion="1" SchemaSubMinorVersion="0" MajorVersion="1" MinorVersion="0" '
        'SubMinorVersion="0" ProductGuid="7a3f1c52-5d0e-4f0a-9f6d-0b6f3a1c9e10" '
        'VersionGuid="7a3f1c52-5d0e-4f0a-9f6d-0b6f3a1c9e11" '
        'xmlns="http://www.genicam.org/GenApi/Version_1_1" '
        'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        'xsi:schemaLocation="http://www.genicam.org/GenApi/Version_1_1 GenApiSchema.xsd">\n'
        + "\n".join(nodes)
        + '\n<Port Name="Device"/>\n</RegisterDescription>\n'
    ).encode()


def _category(name: str, members: dict[str, list[str]] | list[str]) -> str:
    inside = "".join(f"<pFeature>{member}</pFeature>" for member in members)
    return f'<Category Name="{name}">{inside}</Category>'


def _feature_node(feature: Feature) -> str:
    value = f"<pValue>{feature.name}Register</pValue>"
    if feature.kind == "string":
        return ""  # its register is its node
    if feature.kind == "command":
        return f'<Command Name="{feature.name}">{value}<CommandValue>1</CommandValue></Command>'
    if feature.kind == "enumeration":
        entries = "".join(
            f'<EnumEntry Name="{name}"><Value>{number}</Value></EnumEntry>'
            for name, number in feature.entries.items()
        )
        return f'<Enumeration Name="{feature.name}">{entries}{value}</Enumeration>'
    tag = feature.kind.capitalize()
    unit = f"<Unit>{feature.unit}</Unit>" if feature.unit else ""
    return f'<{tag} Name="{feature.name}">{value}{_range(feature)}{unit}</{tag}>'


def _range(feature: Feature) -> str:
    if feature.low is None or feature.high is None:
        return ""
    kind = int if feature.kind == "integer" else float
    return f"<Min>{kind(feature.low)}</Min><Max>{kind(feature.high)}</Max>"


def _register_node(feature: Feature, address: int) -> str:
    if feature.kind == "string":
        return (
            f'<StringReg Name="{feature.name}"><Address>0x{address:X}</Address>'
            f"<Length>{feature.length}</Length><AccessMode>{feature.access}</AccessMode>"
            "<pPort>Device</pPort></StringReg>"
        )
    tag = "FloatReg" if feature.kind == "float" else "IntReg"
    sign = "" if tag == "FloatReg" else "<Sign>Unsigned</Sign>"
    return (
        f'<{tag} Name="{feature.name}Register"><Address>0x{address:X}</Address>'
        f"<Length>{feature.length}</Length><AccessMode>{feature.access}</AccessMode>"
        f"<pPort>Device</pPort><Cachable>NoCache</Cachable>{sign}"
        f"<Endianess>BigEndian</Endianess></{tag}>"
    )
