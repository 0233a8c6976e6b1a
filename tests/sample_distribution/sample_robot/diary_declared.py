"""The plug-in `diary`: declared here, and imported where it is used."""

from missions.plugin import BACK, CommandEntry, FileKind, Plugin

DIARY = Plugin(
    "diary",
    commands={"diary": CommandEntry(BACK, "sample_robot.diary:command", "Print the diary of a run.")},
    run_options="sample_robot.diary_options:DiaryOptions",
    run_context="sample_robot.diary:keep_diary",
    file_kinds={".diary": FileKind(check="sample_robot.diary:check_diary")},
)
