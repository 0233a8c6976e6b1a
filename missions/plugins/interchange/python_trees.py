"""Import of trees of py_trees from Python: calls a function that builds a tree, and converts the tree to XML elements.

The elements have the names of BehaviorTree.CPP. The user names the module and the function, so they are imported and
called; the tree is never ticked.
"""

import importlib
import importlib.util
import inspect
import operator
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from py_trees import behaviours, common, composites, decorators, timers
from py_trees.behaviour import Behaviour

from config.diagnostics import SourceText
from config.units import with_article
from missions.plugins.interchange.node_kinds import MARK
from missions.plugins.interchange.report import DIFFERS, LOST, ImportReport
from missions.plugins.interchange.xml_reader import MAX_DEPTH, MAX_ELEMENTS, Element, clean_text, walk_elements

TARGET = re.compile(r"(?P<module>[\w.]+|.+\.py):(?P<function>[A-Za-z_]\w*)")
"""Pattern of the name of a function that returns a tree: ``package.module:function`` or ``file.py:function``."""

COMPARISONS: Mapping[Any, str] = {
    operator.eq: "==",
    operator.ne: "!=",
    operator.lt: "<",
    operator.le: "<=",
    operator.gt: ">",
    operator.ge: ">=",
}


class PythonTreeError(ValueError):
    """Raised for a module that cannot be imported, and for a function that fails or returns no tree."""


def load_tree(target: str) -> Behaviour:
    """Import the module in ``target``, such as ``robot.trees:patrol``; call its function and return the tree.

    Raises PythonTreeError.
    """
    found = TARGET.fullmatch(target)
    if found is None:
        raise PythonTreeError("write MODULE:FUNCTION")
    try:
        tree = getattr(_module(found["module"]), found["function"])()
    except (Exception, SystemExit) as error:
        raise PythonTreeError(f"{type(error).__name__}: {error}") from error
    tree = getattr(tree, "root", tree)
    if not isinstance(tree, Behaviour):
        kind = with_article(type(tree).__name__)
        raise PythonTreeError(f"'{found['function']}' returned {kind}, not a node of py_trees")
    return tree


def _module(name: str) -> Any:
    if not name.endswith(".py"):
        if "" not in sys.path:
            sys.path.insert(0, "")
        return importlib.import_module(name)
    path = Path(name)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise FileNotFoundError(f"{name} does not exist")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def tree_element(tree: Behaviour, target: str, report: ImportReport) -> Element:
    """Return a tree of py_trees as the root element of an XML file; differences are added to ``report``.

    Remarks give the number of a node in the place of a line: nodes count from 1, in their order in the tree.
    """
    reader = _TreeReader(target, report)
    body = reader.element(tree, 1)
    for each in walk_elements(body):
        each.attributes = {key: clean_text(str(value)) for key, value in each.attributes.items()}
    name = target.rpartition(":")[2]
    element = Element("BehaviorTree", {"ID": name}, reader.source, 1, children=[body])
    return Element("root", {"BTCPP_format": "4", "main_tree_to_execute": name}, reader.source, 1, children=[element])


class _TreeReader:
    """Converts the nodes of one tree to XML elements; ``line`` of an element is the number of its node, from 1."""

    def __init__(self, target: str, report: ImportReport) -> None:
        self.source = SourceText(target, "")
        self.report = report
        self._count = 0

    def element(self, node: Behaviour, depth: int) -> Element:
        self._count += 1
        if depth > MAX_DEPTH or self._count > MAX_ELEMENTS:
            raise PythonTreeError(f"a tree deeper than {MAX_DEPTH} levels, or of more than {MAX_ELEMENTS:,} nodes")
        kind = next((each for each in type(node).__mro__ if each in _READERS), None)
        name = {} if node.name in ("", type(node).__name__) else {"name": node.name}
        found = Element(type(node).__name__, dict(name), self.source, self._count)
        if kind is not None:
            _READERS[kind](self, found, node)
            if type(node) is not kind:
                self.note(DIFFERS, found, f"a {type(node).__name__}, whose own code is not carried over")
        else:
            found.attributes |= _ports(node)
        found.children += [self.element(child, depth + 1) for child in node.children]
        return found

    def note(self, kind: str, element: Element, text: str) -> None:
        name = element.attributes.get("name", "")
        self.report.add(kind, element, text, f"{element.tag} '{name}'" if name else element.tag)

    def child_element(self, parent: Element, tag: str, **attributes: str) -> Element:
        """Return a new element below ``parent``, for a node that needs two elements."""
        found = Element(tag, dict(attributes), self.source, parent.line)
        parent.children.append(found)
        return found


def _ports(node: Behaviour) -> dict[str, str]:
    """Return the ports of a node of an unknown class.

    These are the parameters of its constructor that the node stores in attributes of the same names.
    """
    names = [name for name in inspect.signature(type(node).__init__).parameters if name not in ("self", "name")]
    values = {name: vars(node).get(name) for name in names}
    return {
        name: str(value).lower() if isinstance(value, bool) else str(value)
        for name, value in values.items()
        if isinstance(value, str | int | float)
    }


NodeReader = Callable[[_TreeReader, Element, Any], None]
"""Function that converts a node of py_trees, except its children.

Its arguments are the reader of the tree, the element to fill with tag and ports, and the node.
"""


# Composites.


def _composite(tag: str) -> NodeReader:
    def read(reader: _TreeReader, element: Element, node: Any) -> None:
        del reader
        element.tag = tag if node.memory else f"Reactive{tag}"

    return read


def _parallel(reader: _TreeReader, element: Element, node: Any) -> None:
    element.tag = "Parallel"
    policy = node.policy
    if isinstance(policy, common.ParallelPolicy.SuccessOnOne):
        element.attributes["success_count"] = "1"
    elif isinstance(policy, common.ParallelPolicy.SuccessOnSelected):
        names = ", ".join(f"'{child.name}'" for child in policy.children)
        reader.note(LOST, element, f"only {names} must succeed there; all must succeed here")
    elif not getattr(policy, "synchronise", True):
        reader.note(DIFFERS, element, "children that have succeeded are not ticked again here")


# Decorators.


def _renamed(tag: str, port: str = "", attribute: str = "", factor: float = 1) -> NodeReader:
    """Return a reader of nodes that have an equal node ``tag`` in BehaviorTree.CPP.

    A number in the node's ``attribute`` becomes the port ``port``; ``factor`` converts it to the unit of the port.
    """

    def read(reader: _TreeReader, element: Element, node: Any) -> None:
        del reader
        element.tag = tag
        if port:
            element.attributes[port] = f"{getattr(node, attribute) * factor:.12g}"

    return read


def _one_shot(reader: _TreeReader, element: Element, node: Any) -> None:
    element.tag, element.attributes["then_skip"] = "RunOnce", "false"
    if node.policy is common.OneShotPolicy.ON_SUCCESSFUL_COMPLETION:
        reader.note(DIFFERS, element, "a failure counts as an end, too")


def _condition(reader: _TreeReader, element: Element, node: Any) -> None:
    element.tag = "FailureIsRunning"
    if node.succeed_status is not common.Status.SUCCESS:
        element.tag = "PassThrough"
        reader.note(LOST, element, f"it waits for the status {node.succeed_status.name}")


def _eternal_guard(reader: _TreeReader, element: Element, node: Any) -> None:
    """Convert an EternalGuard: a ReactiveSequence of a Condition node, which stands for its function, and the child."""
    element.tag = "ReactiveSequence"
    condition = getattr(node.condition, "func", node.condition)
    name = getattr(condition, "__name__", "condition")
    reader.child_element(element, "Condition", ID=name if name.isidentifier() else "guard")


def _status_to_blackboard(reader: _TreeReader, element: Element, node: Any) -> None:
    reader.note(LOST, element, f"the status is not stored in '{node.variable_name}'")
    element.tag = "PassThrough"


def _for_each(reader: _TreeReader, element: Element, node: Any) -> None:
    del reader
    element.attributes |= {"vector_in": f"{{{_entry(node.source_key)}}}", "out": f"{{{_entry(node.target_key)}}}"}


# Leaves.


def _running(reader: _TreeReader, element: Element, node: Any) -> None:
    del node
    _wait_until(reader, element, "false")


def _wait_until(reader: _TreeReader, element: Element, code: str) -> None:
    element.tag = "RetryUntilSuccessful"
    element.attributes |= {"num_attempts": "-1", MARK: "wait_until"}
    reader.child_element(element, "ScriptCondition", code=code)


def _set_variable(reader: _TreeReader, element: Element, node: Any) -> None:
    known, value = _constant(node.variable_value_generator)
    if node.key_attributes or not known or not isinstance(value, bool | int | float | str):
        _leave(reader, element, f"the value of '{node.variable_name}'")
        return
    if not node.overwrite:
        reader.note(DIFFERS, element, f"it replaces a value of '{node.variable_name}'")
    text = str(value).lower() if isinstance(value, bool) else str(value)
    element.tag = "SetBlackboard"
    element.attributes |= {"value": text, "output_key": _entry(node.variable_name)}


def _unset_variable(reader: _TreeReader, element: Element, node: Any) -> None:
    del reader
    element.tag, element.attributes["key"] = "UnsetBlackboard", _entry(node.key)


def _check_value(reader: _TreeReader, element: Element, node: Any) -> None:
    code = _comparison(node.check)
    if not code:
        _leave(reader, element, f"the check of '{node.check.variable}'")
    elif isinstance(node, behaviours.WaitForBlackboardVariableValue):
        _wait_until(reader, element, code)
    else:
        element.tag, element.attributes["code"] = "ScriptCondition", code


def _check_values(reader: _TreeReader, element: Element, node: Any) -> None:
    codes = [_comparison(check) for check in node.checks]
    joined = {operator.and_: " && ", operator.or_: " || "}.get(node.operator)
    if joined is None or not all(codes):
        _leave(reader, element, "its checks")
        return
    element.tag, element.attributes["code"] = "ScriptCondition", joined.join(f"({code})" for code in codes)


def _compare_variables(reader: _TreeReader, element: Element, node: Any) -> None:
    sign = COMPARISONS.get(node.operator)
    if sign is None or "." in node.var1_key + node.var2_key:
        _leave(reader, element, "its comparison")
        return
    element.tag, element.attributes["code"] = (
        "ScriptCondition",
        f"{_entry(node.var1_key)} {sign} {_entry(node.var2_key)}",
    )


def _leave(reader: _TreeReader, element: Element, what: str) -> None:
    """Report that a leaf cannot be converted; it becomes a stub leaf, which the user writes."""
    reader.note(LOST, element, f"{what} is computed in Python")


def _comparison(check: Any) -> str:
    """Return a comparison of a blackboard entry with a constant as a script; empty if it is no such comparison."""
    sign = COMPARISONS.get(check.operator)
    known, value = _constant(check.value_generator)
    if sign is None or not known or "." in check.variable:
        return ""
    if isinstance(value, bool):
        return f"{_entry(check.variable)} {sign} {str(value).lower()}"
    if isinstance(value, int | float):
        return f"{_entry(check.variable)} {sign} {value}"
    return f"{_entry(check.variable)} {sign} '{value}'" if isinstance(value, str) and "'" not in value else ""


def _constant(generator: Callable[[], object]) -> tuple[bool, object]:
    """Return (True, value) for a node's constant, (False, None) for a value that a function computes.

    py_trees wraps constants in functions of its own; only these are called, functions of users are not.
    """
    is_constant = getattr(generator, "__module__", "").startswith("py_trees.") and generator.__name__ == "<lambda>"
    return (True, generator()) if is_constant else (False, None)


def _entry(key: str) -> str:
    return re.sub(r"\W", "_", key.strip("/"), flags=re.ASCII)


_SAME_NAME = (
    *(decorators.Inverter, decorators.RunningIsFailure, decorators.RunningIsSuccess, decorators.SuccessIsRunning),
    *(decorators.FailureIsRunning, decorators.PassThrough, decorators.Count),
)

_READERS: Mapping[type, NodeReader] = {
    **{kind: _renamed(kind.__name__) for kind in _SAME_NAME},
    composites.Sequence: _composite("Sequence"),
    composites.Selector: _composite("Fallback"),
    composites.Parallel: _parallel,
    decorators.FailureIsSuccess: _renamed("ForceSuccess"),
    decorators.SuccessIsFailure: _renamed("ForceFailure"),
    decorators.Timeout: _renamed("Timeout", "msec", "duration", 1000),
    decorators.Retry: _renamed("RetryUntilSuccessful", "num_attempts", "num_failures"),
    decorators.Repeat: _renamed("Repeat", "num_cycles", "num_success"),
    decorators.OneShot: _one_shot,
    decorators.Condition: _condition,
    decorators.EternalGuard: _eternal_guard,
    decorators.StatusToBlackboard: _status_to_blackboard,
    decorators.ForEach: _for_each,
    behaviours.Success: _renamed("AlwaysSuccess"),
    behaviours.Failure: _renamed("AlwaysFailure"),
    behaviours.Running: _running,
    behaviours.Dummy: _running,
    timers.Timer: _renamed("Sleep", "msec", "duration", 1000),
    behaviours.SetBlackboardVariable: _set_variable,
    behaviours.UnsetBlackboardVariable: _unset_variable,
    behaviours.CheckBlackboardVariableValue: _check_value,
    behaviours.WaitForBlackboardVariableValue: _check_value,
    behaviours.CheckBlackboardVariableValues: _check_values,
    behaviours.CompareBlackboardVariables: _compare_variables,
}
"""Functions that convert nodes of py_trees, by class; a subclass is converted as its nearest base class here."""
