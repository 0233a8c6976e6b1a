"""Why a notice was not taken, and what a channel reads of secrets."""

from collections.abc import Mapping


class NotTaken(RuntimeError):
    """A channel did not take a notice; the message says which, and why."""


def secret(name: str, environment: Mapping[str, str]) -> str:
    """Return what the environment variable ``name`` holds. Raises NotTaken where it is not set."""
    if name not in environment:
        raise NotTaken(f"the environment variable {name}, which the robot file names, is not set for `mission serve`")
    return environment[name]
