"""The golden records: ten missions as a former version has run them, small, and decided again by every version since.

    python -m tests.missions.records.golden --because "leaves say why in other words"

records anew those that today's tree decides otherwise, tells what has changed, and writes it down with the reason in
``golden_records/meant.md``. A difference that nobody has written down so fails a test.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from config.file_io import collect_read_files
from config.library import find_file
from drivers.clock import time_of_day
from missions.library.drivers import load_robot
from missions.plugins.records.recording.record_contents import contents_of
from missions.plugins.records.recording.recorder import Recorder
from missions.plugins.records.recording.run_record import InvalidRecordError, RunRecord, open_record
from missions.plugins.records.replay.rerun import rerun
from missions.plugins.records.replay.rerun_files import RerunFiles
from missions.plugins.records.replay.result_text import rerun_lines
from missions.request import RunRequest
from missions.runner import Runner

FOLDER = Path(__file__).with_name("golden_records")
MEANT = FOLDER / "meant.md"

BARE, ARM, HUMANOID = "turtlebot2", "turtlebot2_arm", "humanoid"

MISSIONS: dict[str, RunRequest] = {
    order.mission.replace("/", "-"): replace(order, simulate="fast", eyes="truth", seed=7)
    for order in (
        RunRequest("greet", robot=ARM, world="living_room"),
        RunRequest("find_person", robot=ARM, world="living_room"),
        RunRequest("look_around", robot=ARM, world="living_room"),
        RunRequest("dock", robot=BARE, world="living_room"),
        RunRequest("wander", robot=BARE, world="living_room", params={"duration": "2 s"}),
        RunRequest("motions/square", robot=BARE, world="empty", params={"side": "20 cm"}),
        RunRequest("motions/back_and_forth", robot=BARE, world="empty"),
        RunRequest("wave", robot=HUMANOID, world="empty"),
        RunRequest("arm_sweep", robot=ARM, world="empty", params={"time": "3 s"}),
        RunRequest("walk_square", robot=HUMANOID, world="empty", params={"side": "10 cm", "speed": "0.3 m/s"}),
    )
}
"""What is recorded, by the names of the files."""


def keep(name: str, path: Path) -> None:
    """Record one of them at ``path``, without pictures and without anything of this machine."""
    order = MISSIONS[name]
    recorder = Recorder(path, lossless=True, frame_rate=0.0)
    with collect_read_files() as files:
        runner = Runner(order, listeners=[recorder])
        runner.observe(recorder.on_tick)
    recorder.watch_tree(runner.root)
    contents = contents_of(order, runner.plan, runner.config, files, started=time_of_day())
    head = replace(contents.header, paths={}, versions={"missiontree": version("missiontree")})
    recorder.open(replace(contents, header=head), runner.clock)
    try:
        runner.run()
    finally:
        recorder.close()


def decided_again(path: Path) -> Sequence[str]:
    """Return what today's version does otherwise than on a record, in words; nothing where all is the same."""
    record: RunRecord = open_record(path)
    with TemporaryDirectory() as folder:
        sources = RerunFiles(record.header, record.files, Path(folder))
        sources.unpack()
        robot = load_robot(find_file("robots", record.header.robot))
        plan = sources.plan(robot, MISSIONS[path.stem].mission)
        found = rerun(record, plan, robot, seed=record.header.seed, lag=record.header.lag)
        whole = () if record.is_complete else ("it is not whole",)
        return [
            *whole,
            *(rerun_lines(found, sources) if not found.is_identical or found.first_reworded or not found.nodes else ()),
        ]


def main() -> None:
    """Renew what is decided otherwise, and tell."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--because", required=True, help="why they are decided otherwise, for golden_records/meant.md")
    because = options.parse_args().because
    FOLDER.mkdir(exist_ok=True)
    for name in MISSIONS:
        path = FOLDER / f"{name}.mcap"
        try:
            other = decided_again(path) if path.exists() else ["new"]
        except InvalidRecordError as error:  # of another format
            other = [str(error).partition("\n")[0].removeprefix(f"{path}: ")]
        if not other:
            continue
        path.unlink(missing_ok=True)
        keep(name, path)
        told = "\n".join(f"    {line}" for line in other)
        with MEANT.open("a", encoding="utf-8") as file:
            file.write(f"\n- {time_of_day():%Y-%m-%d}, {name}: {because}\n\n{told}\n")
        click.echo(f"{name}: recorded anew, {path.stat().st_size} bytes\n{told}")


if __name__ == "__main__":
    main()
