"""Parts of py_trees that no run needs: its demos, and drawing with pydot. They are loaded once somebody uses them.

py_trees imports all of itself, and pydot, in more than a third of the time that its import takes.
"""

from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType

LAZY_MODULES = frozenset({"py_trees.demos", "py_trees.display", "py_trees.programs", "py_trees.tests"})


class LazyModuleFinder:
    """Finds the modules of these ``names`` where Python finds them; they are run when an attribute is first asked for.

    One for ``sys.meta_path``, as importlib's documentation has it under LazyLoader.
    """

    def __init__(self, names: frozenset[str]) -> None:
        self._names = names

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how to load a module, later; None for one that is not to wait."""
        if name not in self._names:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec
