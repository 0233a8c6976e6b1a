"""ROBOTIS' `zenoh_ros2_sdk` with definitions given here: it would fetch them from git, which is not needed."""

import sys
from types import ModuleType
from typing import Any

git = ModuleType("git")
for name in ("GitCommandError", "InvalidGitRepositoryError", "RemoteProgress", "Repo"):
    setattr(git, name, type(name, (Exception,), {}))
sys.modules.setdefault("git", git)

from rosbags.typesys import Stores, get_typestore  # noqa: E402 - after what stands in for git

JAZZY = get_typestore(Stores.ROS2_JAZZY)
LINE = "=" * 80


def definition(kind: str) -> str:
    """Return the text of a type, with those that it uses."""
    return JAZZY.generate_msgdef(kind, ros_version=2)[0]


def fields(text: str, *used: str) -> str:
    """Return the text of a type of our own, with the whole of those that it uses."""
    parts = [text]
    for kind in used:
        package, _, word = kind.split("/")
        own, *others = definition(kind).split(f"{LINE}\n")
        parts += [f"MSG: {package}/{word}\n{own}", *others]
    unique = dict.fromkeys(part.strip() + "\n" for part in parts)
    return f"{LINE}\n".join(unique)


def made(sdk: Any, kind: str, **values: Any) -> Any:
    """Return a message of a type that the SDK knows."""
    return sdk.session_mgr.store.types[kind](**values)
