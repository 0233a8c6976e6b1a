"""Builders of JSON Schemas, and the schemas of all messages in a record."""

from collections.abc import Mapping

# Schema builders.

Schema = dict[str, object]
"""A JSON Schema as a Python mapping."""


def typed(kind: str, description: str = "", **more: object) -> Schema:
    """Return the JSON Schema of the JSON type ``kind``."""
    return ({"description": description} if description else {}) | {"type": kind} | more


def string(description: str = "") -> Schema:
    """Return the schema of a string."""
    return typed("string", description)


def number(description: str = "") -> Schema:
    """Return the schema of a finite number."""
    return typed("number", description)


def integer(description: str = "", **bounds: int) -> Schema:
    """Return the schema of an integer."""
    return typed("integer", description, **bounds)


def boolean(description: str) -> Schema:
    """Return the schema of a boolean."""
    return typed("boolean", description)


def nullable(schema: Schema) -> Schema:
    """Return ``schema`` extended by null."""
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    return schema | {"type": [*kinds, "null"]}


def any_float(description: str) -> Schema:
    """Return the schema of a number that may be infinite or NaN."""
    pattern = {"pattern": "^(nan|-?inf)$"}
    return {
        "description": f'{description} Not finite: "nan", "inf" or "-inf".',
        "type": ["number", "string"],
        **pattern,
    }


def enumeration(description: str, *words: str) -> Schema:
    """Return the schema of one of several words."""
    return {"description": description, "enum": [*words]}


def array(description: str, items: Schema, **more: object) -> Schema:
    """Return the schema of a list."""
    return typed("array", description, items=items, **more)


def mapping_of(description: str, values: Schema) -> Schema:
    """Return the schema of an object with arbitrary keys."""
    return typed("object", description, additionalProperties=values)


def open_object(about: str, /, **members: Schema) -> Schema:
    """Return the schema of an object that may have further members."""
    return typed("object", about, properties=members, required=[*members])


def closed_object(about: str, /, **members: Schema) -> Schema:
    """Return the schema of an object without further members."""
    return open_object(about, **members) | {"additionalProperties": False}


def number_object(description: str, names: str) -> Schema:
    """Return the schema of an object of numbers, one for each letter of ``names``."""
    return open_object(description, **{name: number() for name in names})


TIME = number("Seconds of the run.")
"""Schema of ``t``, the time of the run in all our messages."""


# Foxglove's messages (docs.foxglove.dev/docs/sdk/schemas) with our extra fields.


def _colour(about: str) -> Schema:
    return number_object(f"{about} 0..1.", "rgba")


_TIMESTAMP: Schema = {
    "description": "Time.",
    "type": "object",
    "title": "time",
    "properties": {"sec": integer(minimum=0), "nsec": integer(minimum=0, maximum=999_999_999)},
    "required": ["sec", "nsec"],
}
_PIXEL_POSITION = number_object("Pixels from the top left corner.", "xy")
_ROTATION = number_object("Rotation as a quaternion.", "xyzw")
_POSE = open_object("Position and rotation.", position=number_object("Metres.", "xyz"), orientation=_ROTATION)


FOXGLOVE_SCHEMAS: Mapping[str, Schema] = {
    "foxglove.Log": open_object(
        "A line of the log.",
        timestamp=_TIMESTAMP,
        level=integer("0 unknown, 1 debug, 2 info, 3 warning, 4 error, 5 fatal.", minimum=0, maximum=5),
        message=string("The line."),
        name=string("Speaker: mission, voice or person."),
        file=string("The mission."),
        line=integer("Always 0."),
        t=TIME,
        kind=string("The level in words, or voice or person."),
    ),
    "foxglove.CompressedImage": open_object(
        "A picture.",
        timestamp=_TIMESTAMP,
        frame_id=string("camera."),
        data=typed("string", "The file.", contentEncoding="base64"),
        format=string("jpeg."),
        t=TIME,
        gaze=nullable(
            open_object(
                "Direction of the camera in the odometry frame; null if unknown.",
                yaw=any_float("Radians to the left."),
                pitch=any_float("Radians downwards."),
            )
        ),
    ),
    "foxglove.ImageAnnotations": open_object(
        "Percepts in a picture.",
        circles=typed("array", "None.", maxItems=0),
        points=array(
            "Boxes.",
            open_object(
                "",
                timestamp=_TIMESTAMP,
                type=integer("2: a closed line.", minimum=0, maximum=4),
                points=array("", _PIXEL_POSITION),
                outline_color=_colour("Colour of the line."),
                outline_colors=array("", _colour("Colour of a segment.")),
                fill_color=_colour("Fill colour."),
                thickness=number("Pixels."),
            ),
        ),
        texts=array(
            "Labels.",
            open_object(
                "",
                timestamp=_TIMESTAMP,
                position=_PIXEL_POSITION,
                text=string("The label."),
                font_size=number("Pixels."),
                text_color=_colour("Text colour."),
                background_color=_colour("Background colour."),
            ),
        ),
    ),
    "foxglove.FrameTransform": open_object(
        "Transform between two frames.",
        timestamp=_TIMESTAMP,
        parent_frame_id=string("The parent frame."),
        child_frame_id=string("The child frame."),
        translation=number_object("Metres.", "xyz"),
        rotation=_ROTATION,
    ),
    "foxglove.PoseInFrame": open_object(
        "Pose of the base.", timestamp=_TIMESTAMP, frame_id=string("odom."), pose=_POSE
    ),
    "foxglove.LaserScan": open_object(
        "A scan of the range finder.",
        timestamp=_TIMESTAMP,
        frame_id=string("base."),
        pose=_POSE,
        start_angle=number("Angle of the first beam: radians, anticlockwise."),
        end_angle=number("Angle of the last beam."),
        ranges=array("Metres, 0 without an echo.", number()),
        intensities=array("None.", number()),
    ),
}
"""Foxglove's message schemas by name, with our extra fields."""


def _percepts(about: str, /, **members: Schema) -> Schema:
    """Return the schema of a list of tracked percepts: the fields that all percepts have, and those in ``members``."""
    return array(about, open_object("", **_PERCEPT, **members))


_TICK = integer("Tick number.")
_MEASURED = {
    "stamp": number("Time of the measurement, in seconds of the run."),
    "quality": enumeration("Quality of the measurement.", "good", "stale", "none"),
}
_PERCEPT = {
    "id": integer("Constant while it is tracked."),
    "stamp": _MEASURED["stamp"],
    "box": closed_object(
        "Bounding box in the picture.",
        x=any_float("Pixels from the left."),
        y=any_float("Pixels from the top."),
        width=any_float("Pixels."),
        height=any_float("Pixels."),
    ),
    "bearing": any_float("Radians left of the centre of the picture."),
    "elevation": any_float("Radians below the centre."),
    "yaw": any_float("Filtered direction in the odometry frame: radians to the left."),
    "pitch": any_float("Radians downwards."),
    "yaw_rate": any_float("rad/s."),
    "pitch_rate": any_float("rad/s."),
    "distance": any_float("Metres."),
}

MISSIONTREE_SCHEMAS: Mapping[str, Schema] = {
    "missiontree.Mission": closed_object(
        "Settings of the run: the first message of a record.",
        mission=string("The mission's name."),
        file=string("The attachment that is the mission."),
        robot=string("The robot's name."),
        world=string("World of a simulated robot; empty for a real one."),
        params=mapping_of("Params of the caller.", string()),
        seed=integer("Random seed."),
        simulate=enumeration("Kind of simulation; empty for a real robot.", "", "wire", "fast"),
        eyes=enumeration("Perception; empty without a camera.", "", "pixels", "truth"),
        rate=number("Ticks per second."),
        started=string("Time of day at time 0 of the run's clock: ISO 8601, UTC."),
        versions=mapping_of("Versions of software.", string()),
        command=array("Command line.", string()),
        parts=array("Parts of the robot that the mission uses.", string()),
        values=mapping_of("All params as evaluated.", string()),
        behaviours=array("Attachments with user leaves.", string()),
        paths=mapping_of("Original path of each attached file.", string()),
        models=mapping_of("SHA-256 of files too large to attach.", string()),
        mocks=array("Leaves that a test replaced.", string()),
        eye=array("Position of the camera on the base: x forward, y left, z up (m).", number(), minItems=3, maxItems=3),
        lag=nullable(number("Delay (s) of the base after a command, learnt in earlier runs; null if unknown.")),
        format=integer("Version of the record format."),
    ),
    "missiontree.Moment": closed_object(
        "A tick of the executive, with all replies of the robot's parts.",
        t=TIME,
        kind=enumeration(
            "A tick of the tree, a look at the robot while paused, or a step of halting the tree.",
            *("tick", "look", "halt"),
        ),
        tick=integer("Number of ticks so far, including this one."),
        late=any_float("Delay in seconds."),
        spent=any_float("Duration in seconds of real time."),
        overheld=nullable(
            typed(
                "array",
                "Leaf that overran the tick limit, and the time; null without one.",
                prefixItems=[string(), number()],
                minItems=2,
                maxItems=2,
            )
        ),
        answers=array(
            "Replies in order: part, query, arguments, and the reply. "
            "A reply that equals the last one to the same query is left out.",
            typed(
                "array",
                prefixItems=[
                    string("The part of the robot."),
                    string("The query or command."),
                    typed("array", "The arguments."),
                    {"description": 'The reply. Values that plain JSON cannot represent have their type under "$".'},
                ],
                minItems=3,
                maxItems=4,
            ),
        ),
    ),
    "missiontree.NodeChanged": closed_object(
        "A node of the tree has a new status.",
        t=TIME,
        tick=_TICK,
        node=string("Key of the node: its place in the tree."),
        name=string("Its name."),
        kind=string("Tag in the mission."),
        line=integer("Its line in the file."),
        status=enumeration("Its status now.", "idle", "running", "success", "failure", "suspended", "skipped"),
        reason=string("The reason."),
    ),
    "missiontree.Feedback": closed_object(
        "A node that goes on running has a new message.",
        t=TIME,
        tick=_TICK,
        node=string("The key of the node: its place in the tree."),
        reason=string("Progress or waiting reason."),
    ),
    "missiontree.VariableSet": closed_object(
        "A variable of a mission has a new value.",
        t=TIME,
        tick=_TICK,
        scope=string("The key of the sub-mission whose variable it is; empty for the mission itself."),
        name=string("The variable."),
        value={"description": 'Its value. Values that plain JSON cannot represent have their type under "$".'},
        dimension=nullable(string("The dimension of a quantity, whose value is in SI units.")),
    ),
    "missiontree.View": open_object(
        "Percepts of one frame.",
        t=TIME,
        looked=nullable(number("The stamp of the frame.")),
        faces=_percepts("Faces, largest first.", name=string("Name of the person, if known.")),
        things=_percepts(
            "Coloured shapes.",
            name=string("Name in the mission."),
            colour=string("Its colour."),
            shape=string("Its shape."),
            size=nullable(any_float("Its width (m).")),
        ),
        markers=_percepts(
            "Markers of other robots.",
            number=integer("Number of the marker."),
            name=string("Name of the robot."),
            heading=any_float("Its heading: radians."),
        ),
        scene=nullable(
            open_object(
                "",
                stamp=_MEASURED["stamp"],
                brightness=any_float("Mean grey level."),
                contrast=any_float("Standard deviation of grey levels."),
                motion=nullable(any_float("Share of changed pixels.")),
            )
        )
        | {"description": "The picture as a whole."},
        spent=number("Seconds of the search; 0 in simulated time."),
    ),
    "missiontree.CommandSent": closed_object(
        "A command to a part of the robot.",
        t=TIME,
        tick=_TICK,
        to=string("The part."),
        source=string("A behaviour, safety or teleop."),
        values=typed("object", "Values of the command."),
    ),
    "missiontree.FaultRaised": closed_object(
        "A part of the robot disconnects, reconnects or reports a fault.",
        t=TIME,
        part=string("The part."),
        status=string("offline, online or fault."),
        detail=string("Details."),
        hint=string("Next command to type."),
    ),
    "missiontree.ReflexFired": closed_object(
        "A reflex of the base begins or ends.",
        t=TIME,
        tick=_TICK,
        condition=string("The reflex."),
        where=string("Details: sides, a button, the reason of a stop."),
        on=boolean("True when it begins."),
    ),
    "missiontree.Notified": closed_object("A notification of the mission.", t=TIME, tick=_TICK, text=string("What.")),
    "missiontree.Ended": closed_object(
        "End of the mission, with the robot at rest.",
        t=TIME,
        mission=string("The mission's name."),
        result=enumeration("Result.", "success", "failure", "interrupted", "error"),
        reason=string("Why."),
        seconds=number("Duration in seconds."),
        ticks=integer("Number of ticks."),
    ),
    "missiontree.Lost": closed_object(
        "Messages lost before this one.",
        t=TIME,
        counts=mapping_of("Number by topic.", integer()),
        why=string("Why."),
    ),
    "missiontree.BaseState": closed_object(
        "State of the base: pose, velocity, setpoint, sensors.",
        t=TIME,
        **_MEASURED,
        x=any_float("Metres forward from the start."),
        y=any_float("Metres left of the start."),
        heading=any_float("Radians, anticlockwise, continuous."),
        speed=any_float("m/s."),
        turn=any_float("rad/s."),
        requested_speed=any_float("Requested speed: m/s."),
        requested_turn=any_float("rad/s."),
        given_speed=any_float("Speed after limits and reflexes: m/s."),
        given_turn=any_float("rad/s."),
        battery_voltage=any_float("V."),
        battery_percent=any_float("0..100."),
        bumper=string("Pressed bumper sides."),
        cliff=string("Sides with a cliff."),
        wheel_drop=string("Dropped wheels."),
        charging=boolean("True while charging."),
        docked=boolean("True on its dock."),
        reckoned=boolean("True if pose and speed are dead reckoning."),
    ),
    "missiontree.HeadState": closed_object(
        "Pose and goal of the head: radians, left and down positive.",
        t=TIME,
        **_MEASURED,
        pan=any_float("To the left."),
        tilt=any_float("Downwards."),
        requested_pan=nullable(any_float("Accepted goal; null before the first command.")),
        requested_tilt=nullable(any_float("Accepted goal; null before the first command.")),
    ),
    "missiontree.ArmState": closed_object(
        "The joints, by name.",
        t=TIME,
        joints=mapping_of(
            "Each joint.",
            closed_object(
                "",
                **_MEASURED,
                position=any_float("Radians."),
                velocity=any_float("rad/s."),
                goal=nullable(any_float("Radians.")),
                load=any_float("-1..1 of the stall torque."),
                voltage=any_float("V."),
                temperature=any_float("degC."),
                moving=boolean("True while it moves."),
                torque=boolean("True if torque is on."),
                blocked=string("Reason why its driver abandoned the goal; empty while it follows."),
            ),
        ),
    ),
    "missiontree.DeviceStates": closed_object(
        "Connection and counters of the devices.",
        t=TIME,
        devices=mapping_of(
            "Each part.",
            closed_object(
                "",
                online=boolean("True if connected."),
                detail=string("Problem."),
                hint=string("Next command to type."),
                counters=mapping_of("Totals since the device was opened.", integer()),
                reconnected_at=nullable(
                    number("Time (s of the run) of the last reconnect after a long disconnect; null without one.")
                ),
            ),
        ),
    ),
}
"""JSON Schemas of MissionTree's own messages, by name."""
