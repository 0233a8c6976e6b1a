"""The messages that Foxglove knows (docs.foxglove.dev/docs/sdk/schemas), with fields of ours."""

from collections.abc import Mapping

from missions.plugins.records.recording.schemas.shapes import (
    TIME,
    Schema,
    listing,
    number,
    numbers,
    of,
    opened,
    or_null,
    real,
    text,
    whole,
)


def _colour(about: str) -> Schema:
    return numbers(f"{about} 0..1.", "rgba")


_TIME: Schema = {
    "description": "When.",
    "type": "object",
    "title": "time",
    "properties": {"sec": whole(minimum=0), "nsec": whole(minimum=0, maximum=999_999_999)},
    "required": ["sec", "nsec"],
}
_PIXELS = numbers("Pixels from the top left corner.", "xy")
_TURN = numbers("A turn, as a quaternion.", "xyzw")
_POSE = opened("Place and turn.", position=numbers("Metres.", "xyz"), orientation=_TURN)


FOXGLOVE: Mapping[str, Schema] = {
    "foxglove.Log": opened(
        "A line of the log.",
        timestamp=_TIME,
        level=whole("0 unknown, 1 debug, 2 info, 3 warning, 4 error, 5 fatal.", minimum=0, maximum=5),
        message=text("The line."),
        name=text("Who speaks: mission, voice or person."),
        file=text("The mission."),
        line=whole("Always 0."),
        t=TIME,
        kind=text("The level in words, or voice or person."),
    ),
    "foxglove.CompressedImage": opened(
        "A picture.",
        timestamp=_TIME,
        frame_id=text("camera."),
        data=of("string", "The file.", contentEncoding="base64"),
        format=text("jpeg."),
        t=TIME,
        gaze=or_null(
            opened(
                "Where the camera looked, in the odometry frame; null where that was not known.",
                yaw=real("Radians to the left."),
                pitch=real("Radians downwards."),
            )
        ),
    ),
    "foxglove.ImageAnnotations": opened(
        "What was found in a picture.",
        circles=of("array", "None.", maxItems=0),
        points=listing(
            "Boxes.",
            opened(
                "",
                timestamp=_TIME,
                type=whole("2: a closed line.", minimum=0, maximum=4),
                points=listing("", _PIXELS),
                outline_color=_colour("Of the line."),
                outline_colors=listing("", _colour("Of a stretch.")),
                fill_color=_colour("Inside."),
                thickness=number("Pixels."),
            ),
        ),
        texts=listing(
            "Words.",
            opened(
                "",
                timestamp=_TIME,
                position=_PIXELS,
                text=text("The words."),
                font_size=number("Pixels."),
                text_color=_colour("Of the letters."),
                background_color=_colour("Behind them."),
            ),
        ),
    ),
    "foxglove.FrameTransform": opened(
        "Where one frame is in another.",
        timestamp=_TIME,
        parent_frame_id=text("The other."),
        child_frame_id=text("The one."),
        translation=numbers("Metres.", "xyz"),
        rotation=_TURN,
    ),
    "foxglove.PoseInFrame": opened("Where the base is.", timestamp=_TIME, frame_id=text("odom."), pose=_POSE),
    "foxglove.LaserScan": opened(
        "A turn of the range finder.",
        timestamp=_TIME,
        frame_id=text("base."),
        pose=_POSE,
        start_angle=number("Of the first beam: radians, anticlockwise."),
        end_angle=number("Of the last."),
        ranges=listing("Metres, 0 where nothing came back.", number()),
        intensities=listing("None.", number()),
    ),
}
"""What a message of each schema holds, by its name."""
