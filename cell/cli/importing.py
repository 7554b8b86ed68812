"""`cell import`: images and poses of another tool, or a recording, into a new recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from calib.mount import Mount
from cell.cli.json_flag import JsonFlag
from cell.errors import BadAnswer
from cell.storage.files.results import new_folder
from cell.verbs.importing import RotationName, Take, Unit
from cell.views.terminal.output import say, show


def import_(
    source: Annotated[
        Path, typer.Argument(help="A recording, a folder of pictures, or a ROS bag.")
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder of the new recording.")
    ] = None,
    board: Annotated[
        str | None,
        typer.Option(
            help="ROWSxCOLSxSQUARE_M of a chessboard in inner corners (6x9x0.025), or"
            " charuco:SQUARES_XxSQUARES_YxSQUARE_MxMARKER_M:DICTIONARY, or"
            " aprilgrid:TAGS_XxTAGS_YxTAG_MxGAP_M, or Kalibr's target file (.yaml)."
        ),
    ] = None,
    poses: Annotated[
        Path | None, typer.Option(help="File or folder of the flange's poses.")
    ] = None,
    joints: Annotated[
        Path | None,
        typer.Option(help="File or folder of joint angles; with --robot they make the poses."),
    ] = None,
    corners: Annotated[
        Path | None,
        typer.Option(
            help="Corner list of another finder (corners.vnl of mrcal, OpenCV's image_points, CSV,"
            " JSON); the pictures show its order."
        ),
    ] = None,
    rotation: Annotated[
        RotationName | None, typer.Option(help="How the poses' rotations are written.")
    ] = None,
    unit: Annotated[Unit | None, typer.Option(help="Unit of the poses' positions.")] = None,
    inverted: Annotated[
        bool | None,
        typer.Option(
            "--inverted/--not-inverted",
            help="The poses are flange_from_base; where nothing is given, the pictures decide.",
        ),
    ] = None,
    mount: Annotated[
        Mount | None, typer.Option(help="Where the camera sits; on the flange without.")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="The arm's model, such as ur5e.")] = None,
    time_bound: Annotated[
        float | None,
        typer.Option(help="Seconds that a pose may be away from its picture (0.05 without)."),
    ] = None,
    image_topic: Annotated[
        str | None, typer.Option(help="ROS bag: topic of the pictures; the only one without.")
    ] = None,
    joint_topic: Annotated[
        str | None, typer.Option(help="ROS bag: topic of the joints; /joint_states without.")
    ] = None,
    pose_topic: Annotated[
        str | None,
        typer.Option(
            help="ROS bag: topic of PoseStamped that has the flange's poses; the only one without,"
            " where neither transforms nor joints give them."
        ),
    ] = None,
    base: Annotated[
        str | None,
        typer.Option(help="ROS bag: frame of the robot's base; base, base_link without."),
    ] = None,
    flange: Annotated[
        str | None, typer.Option(help="ROS bag: frame of the flange; tool0, flange without.")
    ] = None,
    take: Annotated[
        Take | None,
        typer.Option(
            help="ROS bag: which pictures; one of each standstill if there are 8 or more."
        ),
    ] = None,
    clock_offset: Annotated[
        float | None,
        typer.Option(help="ROS bag: seconds to add to the pictures' stamps; estimated without."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Turn images and poses of another tool's layout into a recording, corners found."""
    from cell.storage.files.board_option import parse_board
    from cell.verbs.importing.conventions import StatedConvention
    from cell.verbs.importing.described import Described, OfBag
    from cell.verbs.importing.importer import import_source
    from cell.views.terminal.progress import counted_progress

    described = Described(
        board=None if board is None else parse_board(board).model_dump(),
        poses=poses,
        joints=joints,
        corners=corners,
        stated=StatedConvention(rotation, unit, inverted),
        mount=mount,
        robot=robot,
        time_bound_s=time_bound,
        bag=OfBag(image_topic, joint_topic, base, flange, take, clock_offset, pose_topic),
    )
    folder = output or new_folder(f"{source.resolve().name}-imported")
    with counted_progress("finding corners") as progress:
        imported = import_source(source, folder, described, progress)
    for guess in imported.guessed:
        say(f"GUESSED: {guess}")
    for frame, reason in imported.rejected.items():
        say(f"no corners in frame {frame}: {reason}")
    text = (
        f"{folder}: {imported.frames} frames, the board found in {imported.with_corners},"
        f" {imported.with_pose} with a flange pose"
    )
    show(text, vars(imported), as_json=as_json)
    if imported.contradicted:
        raise BadAnswer(
            "\n".join(f"THE PICTURES SPEAK AGAINST IT: {note}" for note in imported.contradicted)
        )
