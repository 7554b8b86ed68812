"""An arm's kinematics, limits and masses out of a URDF.

Only what lies between the two links named counts. Readers differ on joints with a `mimic`, on
limits in forward kinematics and on missing ones; here a `mimic` or a sliding joint in the chain is
refused, limits never change a pose, and a turning joint must have them. In descriptions of
Universal Robots' arms `base_link` is turned by 180 degrees against `base`, the frame that the
controller counts in, and `tool0` is the controller's flange, `ee_link` is not.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain.kinematics.arm import ArmKinematics
from calib.chain.kinematics.chain_from_axes import Axis, chain_from_axes
from calib.chain.kinematics.dh import link_transforms
from calib.chain.kinematics.gravity import LinkMasses
from calib.chain.kinematics.inverse_general import GeneralInverse
from calib.views import FloatArray

JOINTS = 6
_TURNING, _FIXED = ("revolute", "continuous"), "fixed"
_FULL_TURN_RAD, _USUAL_SPEED_RAD_S = 2 * np.pi, 1.0
_LARGEST, _MOST_RAD, _FASTEST_RAD_S, _HEAVIEST_KG = 1e3, 1e2, 1e2, 1e5
"""No metre, radian, joint limit, joint speed or mass of an arm is larger: a slip, or worse."""


class UnusableUrdf(ValueError):
    """The description is no description of a six-joint arm between the two links named."""


def arm_from_urdf(text: str, base: str, flange: str, name: str) -> ArmKinematics:
    """Read an arm.

    Parameters
    ----------
    text:
        The URDF (XML; a xacro must be expanded first).
    base, flange:
        Names of the links whose frames count as base and flange.
    name:
        What the arm shall be called.

    Raises
    ------
    UnusableUrdf
        With what is wrong and where.
    """
    root = _root(text)
    start, path = _path(root, base, flange)
    turning = [joint for joint in path if joint.get("type") in _TURNING]
    if len(turning) != JOINTS:
        raise UnusableUrdf(
            f"has {len(turning)} turning joints between {base} and {flange}; arms of six are known"
        )
    poses = _poses(start, path)
    axes = [
        _axis(joint, pose)
        for joint, pose in zip(path, poses, strict=True)
        if joint.get("type") in _TURNING
    ]
    rows, ends = chain_from_axes(axes, poses[-1])
    limits = np.array([_limits(joint) for joint in turning])
    return ArmKinematics(
        name=name,
        dh=rows,
        ends=ends,
        limits_rad=limits,
        max_speed_rad_s=np.array([_speed(joint) for joint in turning]),
        reach_m=float(np.hypot(rows[1:, 1], rows[1:, 2]).sum()),
        masses=_masses(_inertials(root, path, poses), rows, ends),
        inverse_branches=GeneralInverse(rows, ends),
    )


def joint_names(text: str, base: str, flange: str) -> tuple[str, ...]:
    """Names of the turning joints from base to flange; raises `UnusableUrdf`."""
    path = _path(_root(text), base, flange)[1]
    return tuple(joint.get("name", "") for joint in path if joint.get("type") in _TURNING)


def _root(text: str) -> ElementTree.Element:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise UnusableUrdf("declares a document type; a URDF has none")
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as fault:
        raise UnusableUrdf(f"is no XML: {fault}") from None


def _path(
    root: ElementTree.Element, base: str, flange: str
) -> tuple[FloatArray, list[ElementTree.Element]]:
    """The joints to the flange in their order, and base_from_link of where they begin.

    The base may stand beside the chain on fixed joints, as `base` does beside `base_link` in
    descriptions of Universal Robots' arms.
    """
    links = {link.get("name") for link in root.findall("link")}
    for wanted in (base, flange):
        if wanted not in links:
            known = ", ".join(sorted(filter(None, links)))
            raise UnusableUrdf(f"has no link {wanted}; it has {known}")
    to = {_link(joint, "child"): joint for joint in root.findall("joint") if joint.get("type")}
    up = _upwards(to, flange)
    above = [_link(joint, "parent") for joint in up]
    fixed: list[ElementTree.Element] = []
    at = base
    while at != flange and at not in above:
        joint = to.get(at)
        if joint is None or joint.get("type") != _FIXED:
            raise UnusableUrdf(f"has no chain of joints from {base} to {flange}")
        fixed.append(joint)
        at = _link(joint, "parent")
    path = up[: above.index(at) + 1] if at in above else []
    for joint in path:
        _check(joint)
    base_from_start = np.eye(4)
    for joint in fixed:
        base_from_start = base_from_start @ np.linalg.inv(_origin(joint))
    return base_from_start, path[::-1]


def _upwards(to: dict[str, ElementTree.Element], link: str) -> list[ElementTree.Element]:
    """The joints from a link up to the root."""
    up: list[ElementTree.Element] = []
    while link in to and len(up) <= len(to):
        up.append(to[link])
        link = _link(to[link], "parent")
    return up


def _check(joint: ElementTree.Element) -> None:
    name, kind = joint.get("name"), joint.get("type")
    if kind not in (*_TURNING, _FIXED):
        raise UnusableUrdf(f"joint {name} is {kind}: only turning and fixed joints are known")
    if joint.find("mimic") is not None:
        raise UnusableUrdf(f"joint {name} mimics another one: such a chain is not known")


def _link(joint: ElementTree.Element, role: str) -> str:
    element = joint.find(role)
    return "" if element is None else element.get("link", "")


def _poses(pose: FloatArray, path: list[ElementTree.Element]) -> list[FloatArray]:
    """base_from_child of every joint at zero joint angles; `pose` is where the path begins."""
    poses = []
    for joint in path:
        pose = pose @ _origin(joint)
        poses.append(pose)
    return poses


def _origin(element: ElementTree.Element) -> FloatArray:
    origin = element.find("origin")
    pose = np.eye(4)
    if origin is not None:
        pose[:3, 3] = _numbers(origin, "xyz")
        pose[:3, :3] = Rotation.from_euler("xyz", _numbers(origin, "rpy")).as_matrix()
    return pose


def _numbers(element: ElementTree.Element, key: str, default: str = "0 0 0") -> FloatArray:
    text = element.get(key, default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (3,) or not (np.abs(values) <= _LARGEST).all():
        raise UnusableUrdf(
            f'{element.tag} {key}="{text[:80]}" is not three numbers within {_LARGEST:g}'
        )
    return values


def _number(element: ElementTree.Element | None, key: str) -> float:
    """A number that may be missing; not a number where it is, or is none."""
    try:
        return float((None if element is None else element.get(key)) or "nan")
    except ValueError:
        return np.nan


def _axis(joint: ElementTree.Element, base_from_child: FloatArray) -> Axis:
    element = joint.find("axis")
    along = np.array([1.0, 0.0, 0.0]) if element is None else _numbers(element, "xyz", "1 0 0")
    length = float(np.linalg.norm(along))
    if length == 0.0:
        raise UnusableUrdf(f"joint {joint.get('name')}: its axis has no direction")
    return Axis(base_from_child[:3, 3], base_from_child[:3, :3] @ along / length)


def _limits(joint: ElementTree.Element) -> tuple[float, float]:
    limit = joint.find("limit")
    if joint.get("type") == "continuous":
        return -_FULL_TURN_RAD, _FULL_TURN_RAD
    low, high = _number(limit, "lower"), _number(limit, "upper")
    if not -_MOST_RAD <= low < high <= _MOST_RAD:
        raise UnusableUrdf(
            f"joint {joint.get('name')}: needs limits, lower below upper, within {_MOST_RAD:g} rad"
        )
    return low, high


def _speed(joint: ElementTree.Element) -> float:
    speed = _number(joint.find("limit"), "velocity")
    return speed if 0 < speed <= _FASTEST_RAD_S else _USUAL_SPEED_RAD_S


def _masses(
    inertials: Iterator[tuple[int, float, FloatArray]], rows: FloatArray, ends: FloatArray
) -> LinkMasses:
    """Of the links, those fixed to one another together; in the frames of the rows."""
    arm_frames = _frames(rows, ends)
    mass, moment = np.zeros(JOINTS), np.zeros((JOINTS, 3))
    for at, kg, com_m in inertials:
        if at > 0:
            mass[at - 1] += kg
            moment[at - 1] += kg * com_m
    middle = moment / np.where(mass > 0, mass, 1.0)[:, None]
    com = [np.linalg.solve(arm_frames[j + 1], [*middle[j], 1.0])[:3] for j in range(JOINTS)]
    return LinkMasses(mass, np.array(com), published=bool((mass > 0).any()))


def _frames(rows: FloatArray, ends: FloatArray) -> list[FloatArray]:
    frames = [ends[0]]
    for link in link_transforms(np.zeros(len(rows)), rows):
        frames.append(frames[-1] @ link)
    frames[-1] = frames[-1] @ ends[1]
    return frames


def _inertials(
    root: ElementTree.Element, path: list[ElementTree.Element], poses: list[FloatArray]
) -> Iterator[tuple[int, float, FloatArray]]:
    """Number of the link, kilograms and centre of mass in the base, at zero joint angles."""
    at, links = 0, {link.get("name"): link for link in root.findall("link")}
    for joint, pose in zip(path, poses, strict=True):
        at += joint.get("type") in _TURNING
        name = _link(joint, "child")
        link = links.get(name)
        if link is None:
            raise UnusableUrdf(f"joint {joint.get('name')} ends at a link {name} that is not there")
        inertial = link.find("inertial")
        weight = None if inertial is None else inertial.find("mass")
        if inertial is not None and weight is not None:
            mass_kg = _number(weight, "value")
            if not 0.0 <= mass_kg <= _HEAVIEST_KG:
                raise UnusableUrdf(f"link {name}: its mass is no number of kilograms")
            yield at, mass_kg, (pose @ _origin(inertial))[:3, 3]
