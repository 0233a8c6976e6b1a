"""Lazy import of the parts of py_trees that no run needs: its demos, and drawing with pydot.

py_trees imports all its modules, and pydot, which takes more than a third of its import time.
"""

from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType

LAZY_MODULES = frozenset({"py_trees.demos", "py_trees.display", "py_trees.programs", "py_trees.tests"})


class LazyModuleFinder:
    """Import hook for ``sys.meta_path`` that delays the execution of modules until their first attribute access.

    ``names`` are the full names of the modules. It follows the LazyLoader recipe in importlib's documentation.
    """

    def __init__(self, names: frozenset[str]) -> None:
        self._names = names

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a lazy spec for a module in ``names``, else None."""
        if name not in self._names:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec
