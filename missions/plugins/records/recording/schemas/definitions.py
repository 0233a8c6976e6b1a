"""Schema definitions of the messages."""

from collections.abc import Mapping

# The parts that the schemas of messages are made of.

Schema = dict[str, object]
"""A JSON Schema."""


def typed(kind: str, description: str = "", **more: object) -> Schema:
    """Return the schema of a JSON type."""
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
"""Schema of ``t`` in all our messages."""


# The messages that Foxglove knows (docs.foxglove.dev/docs/sdk/schemas), with fields of ours.


def _colour(about: str) -> Schema:
    return number_object(f"{about} 0..1.", "rgba")


_TIMESTAMP: Schema = {
    "description": "When.",
    "type": "object",
    "title": "time",
    "properties": {"sec": integer(minimum=0), "nsec": integer(minimum=0, maximum=999_999_999)},
    "required": ["sec", "nsec"],
}
_PIXEL_POSITION = number_object("Pixels from the top left corner.", "xy")
_ROTATION = number_object("A turn, as a quaternion.", "xyzw")
_POSE = open_object("Place and turn.", position=number_object("Metres.", "xyz"), orientation=_ROTATION)


FOXGLOVE_SCHEMAS: Mapping[str, Schema] = {
    "foxglove.Log": open_object(
        "A line of the log.",
        timestamp=_TIMESTAMP,
        level=integer("0 unknown, 1 debug, 2 info, 3 warning, 4 error, 5 fatal.", minimum=0, maximum=5),
        message=string("The line."),
        name=string("Who speaks: mission, voice or person."),
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
                "Where the camera looked, in the odometry frame; null where that was not known.",
                yaw=any_float("Radians to the left."),
                pitch=any_float("Radians downwards."),
            )
        ),
    ),
    "foxglove.ImageAnnotations": open_object(
        "What was found in a picture.",
        circles=typed("array", "None.", maxItems=0),
        points=array(
            "Boxes.",
            open_object(
                "",
                timestamp=_TIMESTAMP,
                type=integer("2: a closed line.", minimum=0, maximum=4),
                points=array("", _PIXEL_POSITION),
                outline_color=_colour("Of the line."),
                outline_colors=array("", _colour("Of a stretch.")),
                fill_color=_colour("Inside."),
                thickness=number("Pixels."),
            ),
        ),
        texts=array(
            "Words.",
            open_object(
                "",
                timestamp=_TIMESTAMP,
                position=_PIXEL_POSITION,
                text=string("The words."),
                font_size=number("Pixels."),
                text_color=_colour("Of the letters."),
                background_color=_colour("Behind them."),
            ),
        ),
    ),
    "foxglove.FrameTransform": open_object(
        "Where one frame is in another.",
        timestamp=_TIMESTAMP,
        parent_frame_id=string("The other."),
        child_frame_id=string("The one."),
        translation=number_object("Metres.", "xyz"),
        rotation=_ROTATION,
    ),
    "foxglove.PoseInFrame": open_object(
        "Where the base is.", timestamp=_TIMESTAMP, frame_id=string("odom."), pose=_POSE
    ),
    "foxglove.LaserScan": open_object(
        "A turn of the range finder.",
        timestamp=_TIMESTAMP,
        frame_id=string("base."),
        pose=_POSE,
        start_angle=number("Of the first beam: radians, anticlockwise."),
        end_angle=number("Of the last."),
        ranges=array("Metres, 0 where nothing came back.", number()),
        intensities=array("None.", number()),
    ),
}
"""Foxglove's message schemas by name, with our extra fields."""


def _percepts(about: str, /, **members: Schema) -> Schema:
    """Return the schema of a list of tracked percepts, with the common fields and ``members``."""
    return array(about, open_object("", **_PERCEPT, **members))


_TICK = integer("The tick in which.")
_MEASURED = {
    "stamp": number("When it was measured, in seconds of the run."),
    "quality": enumeration("How far it can be trusted.", "good", "stale", "none"),
}
_PERCEPT = {
    "id": integer("Stays while it is followed."),
    "stamp": _MEASURED["stamp"],
    "box": closed_object(
        "Where in the picture.",
        x=any_float("Pixels from the left."),
        y=any_float("Pixels from the top."),
        width=any_float("Pixels."),
        height=any_float("Pixels."),
    ),
    "bearing": any_float("Radians left of the picture's middle."),
    "elevation": any_float("Radians below it."),
    "yaw": any_float("Its direction in the odometry frame, filtered: radians to the left."),
    "pitch": any_float("Radians downwards."),
    "yaw_rate": any_float("rad/s."),
    "pitch_rate": any_float("rad/s."),
    "distance": any_float("Metres."),
}

MISSIONTREE_SCHEMAS: Mapping[str, Schema] = {
    "missiontree.Mission": closed_object(
        "What was run, and how: the first message of a record.",
        mission=string("The mission's name."),
        file=string("The attachment that is the mission."),
        robot=string("The robot's name."),
        world=string("What a simulated robot stands in; empty for a real one."),
        params=mapping_of("The params that the caller gave.", string()),
        seed=integer("For whatever is drawn by chance."),
        simulate=enumeration("How the robot is simulated; empty for a real one.", "", "wire", "fast"),
        eyes=enumeration("How it sees; empty without a camera.", "", "pixels", "truth"),
        rate=number("Ticks a second."),
        started=string("The time of day at which the run's clock showed 0: ISO 8601, UTC."),
        versions=mapping_of("What it was run with.", string()),
        command=array("What was typed.", string()),
        parts=array("The parts of the robot that the mission has to do with.", string()),
        values=mapping_of("All params, as they turned out.", string()),
        behaviours=array("The attachments with leaves of the user's own.", string()),
        paths=mapping_of("Where each attached file was found.", string()),
        models=mapping_of("The SHA-256 of files too large to attach.", string()),
        mocks=array("The leaves that a test had replaced.", string()),
        eye=array("Where the camera sits on the base: x forward, y left, z up (m).", number(), minItems=3, maxItems=3),
        lag=nullable(
            number(
                "How long (s) the base takes to begin what it is told, as earlier runs had learnt it; "
                "null where none had."
            )
        ),
        format=integer("How the record is laid out."),
    ),
    "missiontree.Moment": closed_object(
        "A moment of the executive, in which time stood still, and all that it was told from outside.",
        t=TIME,
        kind=enumeration(
            "A tick of the tree, a look at the robot while paused, or a step of halting the tree.",
            *("tick", "look", "halt"),
        ),
        tick=integer("How many ticks had been made, this one with them."),
        late=any_float("Seconds after it was due."),
        spent=any_float("Seconds of real time that it took."),
        overheld=nullable(
            typed(
                "array",
                "Which leaf held a tick for too long, and since when; null where none did.",
                prefixItems=[string(), number()],
                minItems=2,
                maxItems=2,
            )
        ),
        answers=array(
            "Every answer, in order: part, question, arguments, and the answer. "
            "It is left out where it is as in the message before that has it.",
            typed(
                "array",
                prefixItems=[
                    string("The part of the robot."),
                    string("What was asked, or commanded."),
                    typed("array", "With which arguments."),
                    {
                        "description": "What came of it. Values that are more than plain JSON "
                        'carry their kind under "$".'
                    },
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
        node=string("The node's key: its place in the tree."),
        name=string("Its name."),
        kind=string("The word in the mission."),
        line=integer("Its line in the file."),
        status=enumeration("Its status now.", "idle", "running", "success", "failure", "suspended", "skipped"),
        reason=string("Why, in words."),
    ),
    "missiontree.Feedback": closed_object(
        "A node that goes on running has a new message.",
        t=TIME,
        tick=_TICK,
        node=string("The key of the node: its place in the tree."),
        reason=string("What it waits for, or how far it is."),
    ),
    "missiontree.VariableSet": closed_object(
        "A variable of a mission has a new value.",
        t=TIME,
        tick=_TICK,
        scope=string("The key of the sub-mission whose variable it is; empty for the mission itself."),
        name=string("The variable."),
        value={"description": 'Its value. What is more than plain JSON carries its kind under "$".'},
        dimension=nullable(string("The dimension of a quantity, whose value is in SI units.")),
    ),
    "missiontree.View": open_object(
        "All that one frame showed.",
        t=TIME,
        looked=nullable(number("The stamp of the frame.")),
        faces=_percepts("Faces, largest first.", name=string("Whose it is, where that is known.")),
        things=_percepts(
            "Coloured shapes.",
            name=string("As it was asked for."),
            colour=string("Its colour."),
            shape=string("Its shape."),
            size=nullable(any_float("Its width (m).")),
        ),
        markers=_percepts(
            "Markers of other robots.",
            number=integer("The marker's."),
            name=string("The robot's."),
            heading=any_float("Which way it is turned: radians."),
        ),
        scene=nullable(
            open_object(
                "",
                stamp=_MEASURED["stamp"],
                brightness=any_float("Mean grey level."),
                contrast=any_float("In grey levels."),
                motion=nullable(any_float("Share of it that has changed.")),
            )
        )
        | {"description": "The picture as a whole."},
        spent=number("Seconds that searching the frame took; 0 in simulated time."),
    ),
    "missiontree.CommandSent": closed_object(
        "Somebody has commanded a part of the robot.",
        t=TIME,
        tick=_TICK,
        to=string("The part."),
        source=string("A behaviour, safety or teleop."),
        values=typed("object", "What was commanded."),
    ),
    "missiontree.FaultRaised": closed_object(
        "A part of the robot tells of itself.",
        t=TIME,
        part=string("The part."),
        what=string("offline, online or fault."),
        detail=string("In words."),
        hint=string("What to type next."),
    ),
    "missiontree.ReflexFired": closed_object(
        "The base feels something, or is stopped or weak; or not any more.",
        t=TIME,
        tick=_TICK,
        what=string("What it feels."),
        where=string("More of it: sides, a button, why it is stopped."),
        on=boolean("Whether it begins or ends."),
    ),
    "missiontree.Notified": closed_object(
        "The mission has something to tell somebody who is not there.", t=TIME, tick=_TICK, text=string("What.")
    ),
    "missiontree.Ended": closed_object(
        "The mission is over and the robot at rest.",
        t=TIME,
        mission=string("The mission's name."),
        result=enumeration("How it ended.", "success", "failure", "interrupted", "error"),
        reason=string("Why."),
        seconds=number("How long it ran."),
        ticks=integer("How many ticks it had."),
    ),
    "missiontree.Lost": closed_object(
        "Messages that did not come into the record before here.",
        t=TIME,
        counts=mapping_of("How many, by topic.", integer()),
        why=string("Why."),
    ),
    "missiontree.BaseState": closed_object(
        "The base: where it is, how it moves, what it is told and feels.",
        t=TIME,
        **_MEASURED,
        x=any_float("Metres forward from where it began."),
        y=any_float("Metres left of that."),
        heading=any_float("Radians, anticlockwise, continuous."),
        speed=any_float("m/s."),
        turn=any_float("rad/s."),
        wanted_speed=any_float("What the mission asks for: m/s."),
        wanted_turn=any_float("rad/s."),
        given_speed=any_float("What of it is in force: m/s."),
        given_turn=any_float("rad/s."),
        battery_voltage=any_float("V."),
        battery_percent=any_float("0..100."),
        bumper=string("The sides that touch."),
        cliff=string("The sides that see a cliff."),
        wheel_drop=string("The wheels that hang."),
        charging=boolean("Whether it is being charged."),
        docked=boolean("Whether it stands on its dock."),
        reckoned=boolean("Whether place and speed are dead reckoning: nothing measures them."),
    ),
    "missiontree.HeadState": closed_object(
        "Where the head looks, and where it is to look: radians, left and down positive.",
        t=TIME,
        **_MEASURED,
        pan=any_float("To the left."),
        tilt=any_float("Downwards."),
        wanted_pan=nullable(any_float("As accepted; null before the first command.")),
        wanted_tilt=nullable(any_float("The same.")),
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
                moving=boolean("Whether it moves."),
                torque=boolean("Whether it is stiff."),
                blocked=string("Reason for which its driver has given up its goal; empty while it follows."),
            ),
        ),
    ),
    "missiontree.DeviceStates": closed_object(
        "Whether the devices are there, and the figures of their wires.",
        t=TIME,
        devices=mapping_of(
            "Each part.",
            closed_object(
                "",
                online=boolean("Whether it is there."),
                detail=string("What is the matter."),
                hint=string("What to type next."),
                counters=mapping_of("Totals since it was opened.", integer()),
                reconnected_at=nullable(
                    number("Seconds of the run at which it was last back from a long absence; null without one.")
                ),
            ),
        ),
    ),
}
"""Our message schemas by name."""
