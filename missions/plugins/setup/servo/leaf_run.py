"""Run of a single leaf as a mission, with all safety functions of missions."""

import sys
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TextIO, TypeVar

from behaviours.leaf import Leaf
from behaviours.node import Node
from config.diagnostics import SourceText
from config.robot import RobotConfig
from drivers.api import ignore
from missions.cli.live import RunDisplay
from missions.cli.running import EXIT_CODES, warn_unreachable
from missions.control.control import ControlSocket
from missions.executive.executive import Result
from missions.language.check_context import Lookup
from missions.language.document import check_plan
from missions.language.plan import Plan
from missions.library.target import target_of
from missions.plugins.setup.servo.target import ServoTarget
from missions.request import RunRequest
from missions.runner import Runner
from perception.api import Frame

NO_LOOKUPS: Mapping[str, Lookup] = MappingProxyType({})

L = TypeVar("L", bound=Leaf)


def run_leaf(
    target: ServoTarget,
    config: RobotConfig,
    kind: type[L],
    arguments: Mapping[str, object],
    *,
    things: Mapping[str, Lookup] = NO_LOOKUPS,
) -> tuple[int, L]:
    """Run a single leaf on the arm as a mission, and print its events; return the exit code, and the leaf.

    ``kind`` is the class of the leaf, which must have an argument ``on``. ``arguments`` are its arguments as in a
    mission; ``things`` are functions that find the files that arguments name. At the end the arm comes to rest as its
    file says. Raises InvalidFileError for invalid arguments, before anything is opened.
    """
    arguments = {**arguments, "on": target.arm}
    argument_text = ", ".join(f"{name}: {value}" for name, value in arguments.items())
    source = SourceText(kind.tag, f"mission: {kind.tag}\ntree:\n  {kind.tag}: {{{argument_text}}}\n")
    plan = check_plan(source, {kind.tag: kind}, things, robot=target_of(config))
    ports = {} if target.port is None else {target.arm: target.port}
    request = RunRequest(kind.tag, robot=target.robot, simulate="wire" if target.is_virtual else None, ports=ports)
    result, root = run_plan(plan, request, target.report_if_simulated)
    return EXIT_CODES[result.result], next(node for node in root.iterate() if isinstance(node, kind))


def run_plan(
    plan: Plan,
    request: RunRequest,
    before: Callable[[], None] = ignore,
    out: TextIO | None = None,
    *,
    on_frame: Callable[[Frame, object], None] = ignore,
) -> tuple[Result, Node]:
    """Run a plan, and print its events to ``out`` or stdout; return the result, and the root node of the tree.

    ``before`` is called after all checks, before a device is opened. ``on_frame`` is called on the camera's thread with
    each picture that was searched.
    """
    watcher = RunDisplay(out or sys.stdout)
    runner = Runner(request, listeners=[watcher], plan=plan)
    runner.observe(on_frame=on_frame)
    watcher.show_tree(runner.root)
    before()
    control = ControlSocket(runner)
    with watcher, control:
        warn_unreachable(control)
        return runner.run(), runner.root
