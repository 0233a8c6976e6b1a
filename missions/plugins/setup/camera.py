"""``mission robot camera``: list cameras, and calibrate their lenses."""

import re
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import click

from config.diagnostics import InvalidFileError, SourceText
from config.robot import RobotConfig
from config.units import quantity_text, si_value
from config.yaml_edit import NotEditableError, require_own, rewrite, with_value
from config.yaml_nodes import read_source
from drivers.api.sensor_sections import CameraKeys, DistortionKeys
from drivers.camera.picture_files import iter_pictures
from drivers.camera.source import SourceKind, source_kind
from drivers.errors import BadRequest
from drivers.finding.video import CSI_HINT, list_devices
from drivers.transport.programs import explain_denied
from missions.cli.numbers import QuantityInUnit
from missions.cli.root import FAILURE, SUCCESS
from missions.library.drivers import parse_robot
from missions.plugins.setup.camera_frames import camera_frames
from perception.calibration import BoardViews, Chessboard, LensCalibration, calibrate

# Lens parameters in the camera section of a robot file.

COEFFICIENTS = tuple(field.name for field in fields(DistortionKeys))
"""Names of the lens distortion coefficients, in OpenCV's order."""

RETRY_COMMAND = "mission robot camera calibrate SOURCE --board 9x6 --square '25 mm' --keep FILE"


def lens_entries(field_of_view: float, centre: tuple[float, float], distortion: Sequence[float]) -> dict[str, str]:
    """Return the lens keys of a robot file's camera section, and their values as text."""
    bent = ", ".join(f"{name}: {value:.5f}" for name, value in zip(COEFFICIENTS, distortion, strict=True))
    return {
        "field_of_view": quantity_text(field_of_view, "angle"),
        "centre_x": quantity_text(centre[0], "share"),
        "centre_y": quantity_text(centre[1], "share"),
        "distortion": f"{{{bent}}}",
    }


def picture_size(path: Path) -> tuple[int, int]:
    """Return the width and height of a robot's camera pictures, from a robot file whose lens keys are to be written.

    Call it before the calibration, so that an unusable file is found before the user does the work. Raises
    NotEditableError for a file that cannot be written, InvalidFileError for an invalid robot file.
    """
    require_own(path, RETRY_COMMAND)
    camera = _camera(parse_robot(read_source(path)))
    return camera.width, camera.height


def write_lens(path: Path, entries: dict[str, str]) -> None:
    """Write the lens keys ``entries``, made by the function ``lens_entries``, into a robot file; change nothing else.

    Raises NotEditableError if that is not possible, InvalidFileError for an invalid robot file, OSError.
    """
    picture_size(path)
    source = read_source(path)
    old = parse_robot(source)
    text = source.text
    for key, value in entries.items():
        if key == "distortion" and _camera(old).distortion is not None:
            for pair in value.strip("{}").split(", "):
                name, number = pair.split(": ")
                text = with_value(SourceText(source.name, text), ("camera", key, name), number)
        else:
            text = with_value(SourceText(source.name, text), ("camera", key), value)
    if not _changes_only_lens(old, SourceText(source.name, text), entries):
        what = "; ".join(f"{key}: {value}" for key, value in entries.items())
        raise NotEditableError(f"{path}: cannot be edited automatically; write {what}")
    rewrite(path, text)


def _camera(robot: RobotConfig) -> CameraKeys:
    if robot.camera is None:
        raise NotEditableError(f"{robot.name} has no camera: add a section 'camera' to its file first")
    return robot.camera


def _changes_only_lens(old: RobotConfig, source: SourceText, entries: dict[str, str]) -> bool:
    """Return whether the edited text of a robot file changes only the lens keys ``entries`` of the ``old`` robot.

    The edit changes more, for example, if the file uses a YAML anchor of the lens elsewhere too.
    """
    try:
        new = parse_robot(source)
    except InvalidFileError:  # the edit removed an anchor
        return False
    was, is_now = _camera(old), _camera(new)
    new_entries = lens_entries(
        is_now.field_of_view, is_now.centre, is_now.distortion_coefficients or (0.0,) * len(COEFFICIENTS)
    )
    rest = replace(
        is_now,
        field_of_view=was.field_of_view,
        centre_x=was.centre_x,
        centre_y=was.centre_y,
        distortion=was.distortion,
    )
    return new_entries == entries and new.with_keys("camera", rest) == old


MAX_VIEWS = 20
"""Number of different views of the chessboard after which a live calibration ends."""

MAX_PIXEL_ERROR = 1.0
"""Maximum reprojection error of a good lens calibration, in pixels."""


@click.group(epilog="Example: mission robot camera list")
def camera() -> None:
    """List cameras, and calibrate their lenses."""


@camera.command(name="list", epilog="Example: mission robot camera list")
def list_command() -> int:
    """List the connected cameras with their picture sizes."""
    devices = list_devices()
    for device in devices:
        sizes = " ".join(f"{width}x{height}" for width, height in device.sizes) or device.trouble or "sizes unknown"
        click.echo(f"{device.path}  {device.name}  {sizes}")
    denied = [device.path for device in devices if "permission" in device.trouble]
    if denied:
        click.echo(f"  try: {explain_denied(denied[0])[1]}", err=True)
    elif readable := [device for device in devices if not device.csi]:
        number = readable[0].path.name.removeprefix("video")
        click.echo(f"\nTo use {readable[0].path}: mission run greet --camera {number}")
    elif devices:
        click.echo(f"  try: {CSI_HINT}", err=True)
    else:
        click.echo("no camera found", err=True)
        click.echo("  try: lsusb  (is it listed?), or a video instead: mission see FILE", err=True)
    return SUCCESS if devices else FAILURE


def _parse_board(ctx: click.Context, option: click.Parameter, value: str) -> tuple[int, int]:
    found = re.fullmatch(r"([0-9]{1,5})\s*x\s*([0-9]{1,5})", value.strip())
    if found is None:
        raise click.BadParameter(f"'{value}' is not ACROSSxDOWN inner corners, such as 9x6", ctx=ctx, param=option)
    return int(found[1]), int(found[2])


def _parse_length(ctx: click.Context, option: click.Parameter, value: str) -> float:
    try:
        return si_value(value, "length")
    except ValueError as error:
        raise click.BadParameter(f"{error}", ctx=ctx, param=option) from error


@camera.command(name="calibrate", epilog="Example: mission robot camera calibrate 0 --board 9x6 --square '25 mm'")
@click.argument("source", metavar="SOURCE")
@click.option(
    "--board",
    required=True,
    metavar="9x6",
    callback=_parse_board,
    help="Inner corners of the board, where squares meet.",
)
@click.option("--square", required=True, metavar='"25 mm"', callback=_parse_length, help="Side length of a square.")
@click.option("--keep", type=click.Path(path_type=Path, dir_okay=False, exists=True), metavar="FILE", help="Robot file "
              "to which the calibration is written.")  # fmt: skip
@click.option(
    "--seconds",
    type=QuantityInUnit("s", 0.1),
    default=120.0,
    show_default=True,
    help="Maximum time for a live camera.",
)
def calibrate_command(source: str, board: tuple[int, int], square: float, keep: Path | None, seconds: float) -> int:
    """Measure the field of view, centre and distortion of a lens.

    SOURCE is a camera's number or device, a video, or a folder of pictures. Hold a printed chessboard before the
    camera: near and far, in all corners, and tilted to every side.
    """
    try:
        size = None if keep is None else picture_size(keep)
        views = BoardViews(Chessboard(*board, square))
        _collect_views(views, source, seconds, size)
    except (BadRequest, NotEditableError) as error:
        hint = error.hint if isinstance(error, BadRequest) else ""
        raise click.UsageError(f"{error}" + (f"\n  try: {hint}" if hint else "")) from error
    except ValueError as error:
        raise click.UsageError(f"{error}") from error
    try:
        calibration = calibrate(views)
    except ValueError as error:
        click.echo(f"{error}", err=True)
        click.echo(
            "  try: tilt the board to every side and fill all corners of the picture; is --board right?", err=True
        )
        return FAILURE
    return _report_calibration(calibration, views, keep)


def _collect_views(views: BoardViews, source: str, seconds: float, size: tuple[int, int] | None) -> None:
    """Add the pictures of a source to ``views``, and print the number of pictures that could be used.

    It ends after ``seconds``, at the end of a video, or once there are ``MAX_VIEWS``. ``size`` is the picture size
    requested from a camera.
    """
    live = source_kind(source) in {SourceKind.DEVICE, SourceKind.URL}
    seen = (
        (image for _, image in camera_frames(source, seconds, size))
        if live
        else (each[2] for each in iter_pictures([source]))
    )
    for image in seen:
        if views.add(image):
            click.echo(f"view {len(views.corners)}" + (f" of {MAX_VIEWS}" if live else ""), err=True)
        if len(views.corners) >= MAX_VIEWS:
            return


def _report_calibration(calibration: LensCalibration, views: BoardViews, keep: Path | None) -> int:
    """Print the lens keys as in a robot file, write them to the file ``keep`` if given, and return the exit code."""
    width, height = views.size
    click.echo(
        f"# {calibration.views} views of {width}x{height} pixels, "
        f"{calibration.nearest:.2f} to {calibration.farthest:.2f} m away; "
        f"reprojection error {calibration.error:.2f} px"
    )
    entries = lens_entries(calibration.field_of_view, calibration.centre, calibration.distortion)
    click.echo("camera:")
    for key, value in entries.items():
        click.echo(f"  {key}: {value}")
    if calibration.error > MAX_PIXEL_ERROR:
        click.echo(
            f"{calibration.error:.1f} px is too large an error\n  try: a flat board, held still, in good light",
            err=True,
        )
        return FAILURE
    if keep is None:
        click.echo("\nTo write it to your robot file: --keep FILE", err=True)
        return SUCCESS
    try:
        write_lens(keep, entries)
    except NotEditableError as error:
        raise click.UsageError(f"{error}") from error
    click.echo(f"written to {keep}", err=True)
    return SUCCESS
