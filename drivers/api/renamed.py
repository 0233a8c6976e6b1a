"""Names of before: a public name that has changed goes on for one release, and says what it is called now."""

from collections.abc import Callable, Mapping
from importlib import import_module
from warnings import warn


def renamed(module: str, names: Mapping[str, str]) -> Callable[[str], object]:
    """Return a ``__getattr__`` for ``module``. ``names`` are its former names with those that took their place.

    A name with dots is that of another module's.
    Whoever asks for a former name gets what has the new one, and a DeprecationWarning that points at the caller.
    Assign it where a type checker does not look, which would take every name of the module for known.
    """

    def find(name: str) -> object:
        if name not in names:
            raise AttributeError(f"module '{module}' has no attribute '{name}'")
        told_renamed(f"{module}.{name}", names[name], stacklevel=3)
        home, _, found = names[name].rpartition(".")
        return getattr(import_module(home or module), found)

    return find


def told_renamed(former: str, name: str, *, stacklevel: int = 2) -> None:
    """Warn that ``former`` is called ``name`` now. ``stacklevel`` is that of ``warnings.warn``, 2 for the caller."""
    message = f"{former} is called {name} now; the former name goes with the next release"
    warn(message, DeprecationWarning, stacklevel)
