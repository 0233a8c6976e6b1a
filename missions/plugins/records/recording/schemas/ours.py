"""The messages of our own."""

from collections.abc import Mapping

# The parts that the schemas of messages are made of.

Schema = dict[str, object]
"""A JSON Schema."""


def of(kind: str, about: str = "", **more: object) -> Schema:
    """Return what a value of a kind of JSON is."""
    return ({"description": about} if about else {}) | {"type": kind} | more


def text(about: str = "") -> Schema:
    """Return a text."""
    return of("string", about)


def number(about: str = "") -> Schema:
    """Return a finite number."""
    return of("number", about)


def whole(about: str = "", **bounds: int) -> Schema:
    """Return a whole number."""
    return of("integer", about, **bounds)


def flag(about: str) -> Schema:
    """Return true or false."""
    return of("boolean", about)


def or_null(schema: Schema) -> Schema:
    """Return what may be null, too."""
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    return schema | {"type": [*kinds, "null"]}


def real(about: str) -> Schema:
    """Return a number that need not be finite."""
    pattern = {"pattern": "^(nan|-?inf)$"}
    return {"description": f'{about} Not finite: "nan", "inf" or "-inf".', "type": ["number", "string"], **pattern}


def choice(about: str, *words: str) -> Schema:
    """Return one of some words."""
    return {"description": about, "enum": [*words]}


def listing(about: str, items: Schema, **more: object) -> Schema:
    """Return a list."""
    return of("array", about, items=items, **more)


def named(about: str, each: Schema) -> Schema:
    """Return values under names of their own."""
    return of("object", about, additionalProperties=each)


def opened(about: str, /, **members: Schema) -> Schema:
    """Return an object that may have other members too."""
    return of("object", about, properties=members, required=[*members])


def closed(about: str, /, **members: Schema) -> Schema:
    """Return an object that has no other members."""
    return opened(about, **members) | {"additionalProperties": False}


def numbers(about: str, names: str) -> Schema:
    """Return an object of numbers that have a letter each."""
    return opened(about, **{name: number() for name in names})


TIME = number("Seconds of the run.")
"""When, in every message of ours."""


# The messages that Foxglove knows (docs.foxglove.dev/docs/sdk/schemas), with fields of ours.


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


def _percepts(about: str, /, **members: Schema) -> Schema:
    """Return a list of what perception follows: what all of it has, and ``members``."""
    return listing(about, opened("", **_PERCEPT, **members))


_TICK = whole("The tick in which.")
_MEASURED = {
    "stamp": number("When it was measured, in seconds of the run."),
    "quality": choice("How far it can be trusted.", "good", "stale", "none"),
}
_PERCEPT = {
    "id": whole("Stays while it is followed."),
    "stamp": _MEASURED["stamp"],
    "box": closed(
        "Where in the picture.",
        x=real("Pixels from the left."),
        y=real("Pixels from the top."),
        width=real("Pixels."),
        height=real("Pixels."),
    ),
    "bearing": real("Radians left of the picture's middle."),
    "elevation": real("Radians below it."),
    "yaw": real("Its direction in the odometry frame, filtered: radians to the left."),
    "pitch": real("Radians downwards."),
    "yaw_rate": real("rad/s."),
    "pitch_rate": real("rad/s."),
    "distance": real("Metres."),
}

OURS: Mapping[str, Schema] = {
    "missiontree.Mission": closed(
        "What was run, and how: the first message of a record.",
        mission=text("The mission's name."),
        file=text("The attachment that is the mission."),
        robot=text("The robot's name."),
        world=text("What a simulated robot stands in; empty for a real one."),
        params=named("The params that the caller gave.", text()),
        seed=whole("For whatever is drawn by chance."),
        simulate=choice("How the robot is simulated; empty for a real one.", "", "wire", "fast"),
        eyes=choice("How it sees; empty without a camera.", "", "pixels", "truth"),
        rate=number("Ticks a second."),
        started=text("The time of day at which the run's clock showed 0: ISO 8601, UTC."),
        versions=named("What it was run with.", text()),
        command=listing("What was typed.", text()),
        parts=listing("The parts of the robot that the mission has to do with.", text()),
        values=named("All params, as they turned out.", text()),
        behaviours=listing("The attachments with leaves of the user's own.", text()),
        paths=named("Where each attached file was found.", text()),
        models=named("The SHA-256 of files too large to attach.", text()),
        mocks=listing("The leaves that a test had replaced.", text()),
        eye=listing(
            "Where the camera sits on the base: x forward, y left, z up (m).", number(), minItems=3, maxItems=3
        ),
        lag=or_null(
            number(
                "How long (s) the base takes to begin what it is told, as earlier runs had learnt it; "
                "null where none had."
            )
        ),
        format=whole("How the record is laid out."),
    ),
    "missiontree.Moment": closed(
        "A moment of the executive, in which time stood still, and all that it was told from outside.",
        t=TIME,
        kind=choice(
            "A tick of the tree, a look at the robot while paused, or a step of halting the tree.",
            *("tick", "look", "halt"),
        ),
        tick=whole("How many ticks had been made, this one with them."),
        late=real("Seconds after it was due."),
        spent=real("Seconds of real time that it took."),
        overheld=or_null(
            of(
                "array",
                "Which leaf held a tick for too long, and since when; null where none did.",
                prefixItems=[text(), number()],
                minItems=2,
                maxItems=2,
            )
        ),
        answers=listing(
            "Every answer, in order: part, question, arguments, and the answer. "
            "It is left out where it is as in the message before that has it.",
            of(
                "array",
                prefixItems=[
                    text("The part of the robot."),
                    text("What was asked, or commanded."),
                    of("array", "With which arguments."),
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
    "missiontree.NodeChanged": closed(
        "A node of the tree has a new status.",
        t=TIME,
        tick=_TICK,
        node=text("The node's key: its place in the tree."),
        name=text("Its name."),
        kind=text("The word in the mission."),
        line=whole("Its line in the file."),
        status=choice("Its status now.", "idle", "running", "success", "failure", "suspended", "skipped"),
        reason=text("Why, in words."),
    ),
    "missiontree.Feedback": closed(
        "A node that goes on running has a new message.",
        t=TIME,
        tick=_TICK,
        node=text("The key of the node: its place in the tree."),
        reason=text("What it waits for, or how far it is."),
    ),
    "missiontree.VariableSet": closed(
        "A variable of a mission has a new value.",
        t=TIME,
        tick=_TICK,
        scope=text("The key of the sub-mission whose variable it is; empty for the mission itself."),
        name=text("The variable."),
        value={"description": 'Its value. What is more than plain JSON carries its kind under "$".'},
        dimension=or_null(text("The dimension of a quantity, whose value is in SI units.")),
    ),
    "missiontree.View": opened(
        "All that one frame showed.",
        t=TIME,
        looked=or_null(number("The stamp of the frame.")),
        faces=_percepts("Faces, largest first.", name=text("Whose it is, where that is known.")),
        things=_percepts(
            "Coloured shapes.",
            name=text("As it was asked for."),
            colour=text("Its colour."),
            shape=text("Its shape."),
            size=or_null(real("Its width (m).")),
        ),
        markers=_percepts(
            "Markers of other robots.",
            number=whole("The marker's."),
            name=text("The robot's."),
            heading=real("Which way it is turned: radians."),
        ),
        scene=or_null(
            opened(
                "",
                stamp=_MEASURED["stamp"],
                brightness=real("Mean grey level."),
                contrast=real("In grey levels."),
                motion=or_null(real("Share of it that has changed.")),
            )
        )
        | {"description": "The picture as a whole."},
        spent=number("Seconds that searching the frame took; 0 in simulated time."),
    ),
    "missiontree.CommandSent": closed(
        "Somebody has commanded a part of the robot.",
        t=TIME,
        tick=_TICK,
        to=text("The part."),
        source=text("A behaviour, safety or teleop."),
        values=of("object", "What was commanded."),
    ),
    "missiontree.FaultRaised": closed(
        "A part of the robot tells of itself.",
        t=TIME,
        part=text("The part."),
        what=text("offline, online or fault."),
        detail=text("In words."),
        hint=text("What to type next."),
    ),
    "missiontree.ReflexFired": closed(
        "The base feels something, or is stopped or weak; or not any more.",
        t=TIME,
        tick=_TICK,
        what=text("What it feels."),
        where=text("More of it: sides, a button, why it is stopped."),
        on=flag("Whether it begins or ends."),
    ),
    "missiontree.Notified": closed(
        "The mission has something to tell somebody who is not there.", t=TIME, tick=_TICK, text=text("What.")
    ),
    "missiontree.Ended": closed(
        "The mission is over and the robot at rest.",
        t=TIME,
        mission=text("The mission's name."),
        result=choice("How it ended.", "success", "failure", "interrupted", "error"),
        reason=text("Why."),
        seconds=number("How long it ran."),
        ticks=whole("How many ticks it had."),
    ),
    "missiontree.Lost": closed(
        "Messages that did not come into the record before here.",
        t=TIME,
        counts=named("How many, by topic.", whole()),
        why=text("Why."),
    ),
    "missiontree.BaseState": closed(
        "The base: where it is, how it moves, what it is told and feels.",
        t=TIME,
        **_MEASURED,
        x=real("Metres forward from where it began."),
        y=real("Metres left of that."),
        heading=real("Radians, anticlockwise, continuous."),
        speed=real("m/s."),
        turn=real("rad/s."),
        wanted_speed=real("What the mission asks for: m/s."),
        wanted_turn=real("rad/s."),
        given_speed=real("What of it is in force: m/s."),
        given_turn=real("rad/s."),
        battery_voltage=real("V."),
        battery_percent=real("0..100."),
        bumper=text("The sides that touch."),
        cliff=text("The sides that see a cliff."),
        wheel_drop=text("The wheels that hang."),
        charging=flag("Whether it is being charged."),
        docked=flag("Whether it stands on its dock."),
        reckoned=flag("Whether place and speed are dead reckoning: nothing measures them."),
    ),
    "missiontree.HeadState": closed(
        "Where the head looks, and where it is to look: radians, left and down positive.",
        t=TIME,
        **_MEASURED,
        pan=real("To the left."),
        tilt=real("Downwards."),
        wanted_pan=or_null(real("As accepted; null before the first command.")),
        wanted_tilt=or_null(real("The same.")),
    ),
    "missiontree.ArmState": closed(
        "The joints, by name.",
        t=TIME,
        joints=named(
            "Each joint.",
            closed(
                "",
                **_MEASURED,
                position=real("Radians."),
                velocity=real("rad/s."),
                goal=or_null(real("Radians.")),
                load=real("-1..1 of the stall torque."),
                voltage=real("V."),
                temperature=real("degC."),
                moving=flag("Whether it moves."),
                torque=flag("Whether it is stiff."),
                blocked=text("Reason for which its driver has given up its goal; empty while it follows."),
            ),
        ),
    ),
    "missiontree.DeviceStates": closed(
        "Whether the devices are there, and the figures of their wires.",
        t=TIME,
        devices=named(
            "Each part.",
            closed(
                "",
                online=flag("Whether it is there."),
                detail=text("What is the matter."),
                hint=text("What to type next."),
                counters=named("Totals since it was opened.", whole()),
                returned=or_null(
                    number("Seconds of the run at which it was last back from a long absence; null without one.")
                ),
            ),
        ),
    ),
}
"""What a message of each schema holds, by its name."""
