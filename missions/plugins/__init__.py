"""Declarations of our own plug-ins; the code of a plug-in is imported when a command needs it.

The order of PLUGINS is the order in which a run applies them: first each plug-in's options change the run request, then
each plug-in's context is entered.
"""

from missions.plugin import BACK, BY_HAND, LOOK, RUN, SET_UP, TRY, CommandEntry, FileKind, Plugin

PLUGINS = (
    Plugin(
        "records",
        extra="records",
        needs=("pictures", "view"),
        commands={
            "record": CommandEntry(
                BACK,
                "missions.plugins.records.commands.record:command",
                "Replay, compare, report and cut records of runs.",
            ),
            "record replay": CommandEntry(
                BACK, "missions.plugins.records.commands.replay:replay", "Play a record in the terminal, or film it."
            ),
            "record rerun": CommandEntry(
                BACK,
                "missions.plugins.records.commands.replay:rerun",
                "Repeat the decisions of a record with today's files.",
            ),
            "record report": CommandEntry(
                BACK, "missions.plugins.records.commands.report:report", "Write a report of a record as one HTML page."
            ),
            "record stats": CommandEntry(
                BACK, "missions.plugins.records.commands.stats:stats", "Show statistics of one or more records."
            ),
        },
        run_options="missions.plugins.records.options:RecordOptions",
        run_context="missions.plugins.records.run_recording:record_run",
        file_kinds={".mcap": FileKind(drawing="missions.plugins.records.recording.info:drawing_of_record")},
    ),
    Plugin(
        "pictures",
        extra="plots",
        services={
            "picture_forms": "missions.plugins.pictures.forms:PICTURE_FORMS",
            "dump_pair": "missions.plugins.pictures.forms:dump_pair",
            "show_world": "missions.plugins.pictures.commands.world:show_world",
        },
        run_options="missions.plugins.pictures.options:FilmOptions",
        run_context="missions.plugins.pictures.run_film:film_run",
    ),
    Plugin(
        "view",
        extra="view",
        run_options="missions.plugins.view.options:ViewOptions",
        run_context="missions.plugins.view.live_view:view_run",
    ),
    Plugin(
        "teleop",
        needs=("setup",),
        commands={
            "teleop": CommandEntry(
                BY_HAND, "missions.plugins.teleop.command:command", "Drive a robot with keys or a game pad."
            ),
        },
        run_options="missions.plugins.teleop.options:PadOptions",
        run_context="missions.plugins.teleop.run_pad:drive_with_pad",
    ),
    Plugin(
        "studio",
        extra="studio",
        needs=("records", "pictures", "testing", "tasks", "fleet"),
        commands={
            "studio": CommandEntry(
                RUN, "missions.plugins.studio.command:command", "See, start, drive and stop robots in the browser."
            ),
        },
        run_options="missions.plugins.studio.options:StudioOptions",
        run_context="missions.plugins.studio.side_process:studio_beside",
        services={
            "studio_options": "missions.plugins.studio.options:StudioOptions",
            "serving_studio": "missions.plugins.studio.side_process:serving_studio",
        },
    ),
    Plugin(
        "ros2",
        extra="ros2",
        commands={
            "ros2": CommandEntry(
                SET_UP, "missions.plugins.ros2.command:command", "Look at the nodes and topics of ROS 2, without ROS."
            ),
            "ros2 place": CommandEntry(
                SET_UP, "missions.plugins.ros2.place:place", "Name places on a robot's map, for `navigate`."
            ),
        },
        run_options="missions.plugins.ros2.options:Ros2Options",
        run_context="missions.plugins.ros2.run_publisher:publish_run",
    ),
    Plugin(
        "testing",
        needs=("pictures",),
        commands={
            "test": CommandEntry(TRY, "missions.plugins.testing.commands.test:command", "Run the tests of missions."),
            "sweep": CommandEntry(
                TRY,
                "missions.plugins.testing.commands.sweep:command",
                "Run a mission many times: how often does it succeed?",
            ),
            "controller": CommandEntry(
                TRY, "missions.plugins.testing.commands.controller:command", "Show, compare and tune controllers."
            ),
            "controller tune": CommandEntry(
                TRY, "missions.plugins.testing.commands.tune:tune", "Find better numbers for a controller."
            ),
            "simulate": CommandEntry(
                TRY,
                "missions.plugins.testing.commands.simulate:command",
                "Run a robot's virtual devices for other programs.",
            ),
            "simulate fault": CommandEntry(
                TRY, "missions.plugins.testing.commands.fault:fault", "Inject a fault into a run in simulated time."
            ),
        },
        file_kinds={".test.yaml": FileKind(check="missions.plugins.testing.suite:check_tests")},
        services={"faults": "missions.plugins.testing.live_faults:LiveFaults"},
    ),
    Plugin(
        "verify",
        commands={
            "verify": CommandEntry(
                TRY, "missions.plugins.verify.command:command", "Prove that missions end and keep their properties."
            ),
        },
    ),
    Plugin(
        "schema",
        commands={
            "schema": CommandEntry(
                LOOK, "missions.plugins.schema.command:command", "Write the JSON Schema of missions, for editors."
            ),
        },
    ),
    Plugin(
        "interchange",
        commands={
            "import": CommandEntry(
                SET_UP,
                "missions.plugins.interchange.command:command",
                "Make missions of trees of BehaviorTree.CPP, Nav2 and py_trees.",
            ),
        },
        services={"export_mission": "missions.plugins.interchange.exporter:export_mission"},
    ),
    Plugin(
        "tasks",
        commands={
            "task": CommandEntry(
                RUN,
                "missions.plugins.tasks.commands.task:command",
                "Queue missions to run in turn, at a time, or repeatedly.",
            ),
            "task serve": CommandEntry(
                RUN, "missions.plugins.tasks.commands.serve:serve_tasks", "Run the tasks of the queue as they are due."
            ),
        },
    ),
    Plugin(
        "fleet",
        extra="fleet",
        needs=("tasks",),
        services={
            "fleet_options": "missions.plugins.fleet.options:FleetOptions",
            "fleet_membership": "missions.plugins.fleet.membership:membership",
        },
        commands={
            "fleet": CommandEntry(
                RUN,
                "missions.plugins.fleet.commands.fleet:command",
                "See the robots of a fleet, give them tasks, stop them.",
            ),
        },
    ),
    Plugin(
        "setup",
        needs=("records", "pictures", "schema"),
        commands={
            "robot": CommandEntry(
                SET_UP, "missions.plugins.setup.robot:command", "Make, show, check and use a robot file."
            ),
            "robot camera": CommandEntry(
                SET_UP, "missions.plugins.setup.camera:camera", "List cameras, and calibrate them."
            ),
            "robot models": CommandEntry(
                SET_UP, "missions.plugins.setup.models:models", "List and fetch trained models."
            ),
            "robot udev": CommandEntry(
                SET_UP, "missions.plugins.setup.udev:udev", "Print udev rules for a TurtleBot's serial ports."
            ),
            "doctor": CommandEntry(
                SET_UP, "missions.plugins.setup.doctor:command", "Check computer, ports, servos and camera."
            ),
            "ports": CommandEntry(
                SET_UP, "missions.plugins.setup.ports:command", "List what is plugged in, and what answers there."
            ),
            "person": CommandEntry(
                SET_UP, "missions.plugins.setup.person:command", "Teach the robot people's faces, or forget them."
            ),
            "servo": CommandEntry(
                SET_UP, "missions.plugins.setup.servo:command", "Find, set up, move and record servos."
            ),
            "head": CommandEntry(BY_HAND, "missions.plugins.setup.head:command", "Move the head, and trim it."),
            "see": CommandEntry(
                BY_HAND, "missions.plugins.setup.see:command", "Find faces, things and markers in pictures."
            ),
            "hear": CommandEntry(
                BY_HAND, "missions.plugins.setup.hear:command", "Recognise phrases from the microphone or a file."
            ),
        },
    ),
    Plugin(
        "legs",
        services={"show_gait": "missions.plugins.legs.command:show_gait"},
        needs=("pictures",),
        commands={
            "gait": CommandEntry(
                BY_HAND, "missions.plugins.legs.command:command", "Check gaits of robots with legs, and make new ones."
            ),
        },
    ),
)
