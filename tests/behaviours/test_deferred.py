"""A mission runs without the demos of py_trees and without pydot; who asks for them has them."""

import subprocess
import sys


def told(program: str) -> str:
    """What a Python of its own says."""
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.strip()


def test_a_leaf_loads_neither_demos_nor_pydot() -> None:
    program = "import behaviours.leaf, sys; print('pydot' in sys.modules, 'py_trees.demos.action' in sys.modules)"
    assert told(program) == "False False"


def test_trees_are_drawn_as_before() -> None:
    program = """if True:
        import behaviours.leaf, py_trees
        from py_trees import display
        root = py_trees.composites.Sequence("root", memory=True, children=[py_trees.behaviours.Success("done")])
        print(py_trees.display.ascii_tree(root).split()[1:], display.dot_tree(root).to_string().startswith("digraph"))
        print(py_trees.demos.action.__name__)
    """
    assert told(program).splitlines() == ["['root', '-->', 'done'] True", "py_trees.demos.action"]


def test_missing_py_trees_module_raises_module_not_found_error() -> None:
    program = """if True:
        import behaviours.leaf
        try:
            import py_trees.no_such_part
        except ModuleNotFoundError as error:
            print(error.name)
    """
    assert told(program) == "py_trees.no_such_part"
