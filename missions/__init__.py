"""Missions, their language, and the executive that runs them.

From Python you can load a mission and tick it yourself, or run it from beginning to end::

    import missions

    mission = missions.load("hello.yaml", params={"text": "Good morning"})  # all errors in one InvalidFileError
    mission.events.listeners.append(print)
    while mission.tick() is Status.RUNNING:  # one tick
        ...
    mission.halt()

    with missions.load("greet", robot="turtlebot2_arm", simulate=True) as mission:  # opens and closes the robot
        mission.tick()

    result = missions.run("greet", listeners=[print])  # as `mission run greet`
    print(result.result, result.reason)

A complete example without a robot:

>>> import pathlib, tempfile, missions
>>> file = pathlib.Path(tempfile.mkdtemp(), "count.yaml")
>>> _ = file.write_text("{mission: count, params: {to: 2}, tree: {succeed: , repeat: '${to}'}}")
>>> mission = missions.load(file, params={"to": 3})
>>> [mission.tick().name for _ in range(3)]
['RUNNING', 'RUNNING', 'SUCCESS']

The names ``load``, ``wrap``, ``run``, ``Mission``, ``Result``, ``InvalidFileError`` and ``UnknownNameError`` are
stable. All other names may change between versions.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from config.diagnostics import InvalidFileError
    from config.library import UnknownNameError
    from missions.api import Mission, load, run, wrap
    from missions.executive.executive import Result

__project__ = "missiontree"

__all__ = ["InvalidFileError", "Mission", "Result", "UnknownNameError", "load", "run", "wrap"]

_HOME = {"InvalidFileError": "config.diagnostics", "UnknownNameError": "config.library"}


def __getattr__(name: str) -> object:
    """Import public names on first access, so that `mission --help` starts fast."""
    if name not in __all__:
        raise AttributeError(f"module 'missions' has no attribute '{name}'")
    return getattr(import_module(_HOME.get(name, "missions.api")), name)
