"""Translation of trees of other programs to steps of missions: selects the function for each kind of node."""

from collections.abc import Callable, Mapping

from missions.plugins.interchange import composites, decorators, leaves, nav2
from missions.plugins.interchange.blackboard import SubtreeCall, constant_value, entry_of
from missions.plugins.interchange.conditions import with_conditions
from missions.plugins.interchange.context import SkipAs, TreeContext, description_of, remark_of, skip_in
from missions.plugins.interchange.foreign_trees import call_ports, normal_form
from missions.plugins.interchange.mission_text import MissionStep, Verbatim, wrapped
from missions.plugins.interchange.node_kinds import (
    BTCPP_KINDS,
    COMMON_ATTRIBUTES,
    KINDS,
    NEXT_TICK,
    OLD_PORTS,
    WITHOUT_COUNTERPART,
    ForeignKind,
)
from missions.plugins.interchange.own_nodes import translate_call, translate_own
from missions.plugins.interchange.report import DIFFERS, LOST
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.yaml_ports import is_pointer


def translate_node(tree: TreeContext, element: Element, skip_as: SkipAs, parent: str) -> MissionStep:
    """Translate an XML node of any kind, and all nodes below it: see ``TranslateNode``."""
    kind, role = normal_form(element, tree.project)
    step = translate_own(tree, element, skip_as)
    if step is None:
        step = _by_kind(tree, element, kind, role, skip_as, parent)
        _note_dropped(tree, element, kind)
    step.comments = [*element.comments, *description_of(element), *step.comments, *element.last_comments]
    step.origin = element
    return with_conditions(tree, element, step, skip_as)


def _by_kind(tree: TreeContext, element: Element, kind: str, role: str, skip_as: SkipAs, parent: str) -> MissionStep:
    known = KINDS.get(kind)
    if kind in tree.rules or (known is not None and _is_namesake(element, kind, known, role)):
        known = None
    if known is not None and known.role in ("control", "decorator"):
        return _known_parent(tree, element, kind, known, skip_as, parent)
    if kind == "SubTree":
        return _subtree(tree, element)
    if kind in _LEAVES and kind not in tree.rules:
        return tree.add_name(_LEAVES[kind](tree, element), element)
    if known is not None:
        return tree.add_name(MissionStep(known.word), element)
    if element.children or role in ("Control", "Decorator"):
        return _unknown_parent(tree, element, kind, role or ("Control" if len(element.children) > 1 else "Decorator"))
    return leaves.leaf(tree, element, kind, role)


def _is_namesake(element: Element, kind: str, known: ForeignKind, role: str) -> bool:
    """Return whether a node is a leaf of the user that has only the name of a known parent, such as ``Retry``."""
    return known.role in ("control", "decorator") and (
        role in ("Action", "Condition") or (not element.children and kind not in BTCPP_KINDS)
    )


def _known_parent(
    tree: TreeContext, element: Element, kind: str, known: ForeignKind, skip_as: SkipAs, parent: str
) -> MissionStep:
    if not element.children:
        tree.report.add(LOST, element, "has no child; it succeeds here", kind)
        tree.report.carried[kind] += 1
        return tree.add_name(MissionStep("succeed"), element)
    if known.role == "decorator":
        if len(element.children) > 1:
            tree.report.add(LOST, element, "has several children; they run one after another here", kind)
            inner = Element("Sequence", {}, element.source, element.line, element.column, element.children)
            element = Element(element.tag, element.attributes, element.source, element.line, element.column, [inner])
        step = _decorator(tree, element, kind, known, skip_as, parent)
    elif kind in WITHOUT_COUNTERPART:
        step = None
    elif kind in _CONTROLS:
        step = _CONTROLS[kind](tree, element, kind)
    else:
        step = tree.add_name(
            MissionStep(known.word, tree.children(element, skip_in(known.word)), dict(known.keys)), element
        )
    if step is None:
        return _unknown_parent(tree, element, kind, known.role.capitalize())
    tree.report.carried[kind] += 1
    if known.difference and known.difference != NEXT_TICK:
        tree.report.add(DIFFERS, element, known.difference, kind)
    return step


def _unknown_parent(tree: TreeContext, element: Element, kind: str, role: str) -> MissionStep:
    """Return a sequence for a control node or decorator without a counterpart: a stub leaf, then its children."""
    tree.report.stubbed[kind] += 1
    stub = leaves.stub_step(tree, element, kind, role)
    children = tree.children(element, "success")
    if not children:
        return stub
    text = f"no counterpart: the stub '{stub.word}' stands before its children, which run in order"
    tree.report.add(LOST, element, text, kind)
    name = stub.keys.pop("name", None)
    return MissionStep("sequence", [stub, *children], {} if name is None else {"name": name})


def _note_dropped(tree: TreeContext, element: Element, kind: str) -> None:
    """Report the attributes of a node that have no meaning in a mission.

    Ports of leaves and SubTree nodes are reported where they are read.
    """
    known = KINDS.get(kind)
    for name in element.attributes:
        if name in COMMON_ATTRIBUTES or (kind == "SubTree" and name.startswith("_")):
            continue
        if name.startswith("_"):
            tree.report.add(LOST, element, f"the attribute '{name}'", kind)
        elif known is not None and known.role != "subtree" and kind not in tree.rules:
            port = OLD_PORTS.get((kind, name), name)
            if port not in known.ports:
                tree.report.add(LOST, element, f"the unknown port '{name}'", kind)


def _decorator(
    tree: TreeContext, element: Element, kind: str, known: ForeignKind, skip_as: SkipAs, parent: str
) -> MissionStep | None:
    if kind in WITHOUT_COUNTERPART:
        return None
    if kind in _DECORATORS:
        return _DECORATORS[kind](tree, element, kind, skip_as)
    if not known.word:
        return tree.node(element.children[0], skip_as, kind)
    if kind in nav2.PACED:
        return nav2.pace_alone(tree, element, kind, skip_as, parent)
    inner_skip: SkipAs = skip_as
    if kind == "Inverter":
        inner_skip = "failure" if skip_as == "success" else "success"
    child = tree.node(element.children[0], inner_skip, kind)
    if known.keys:
        for key, value in known.keys.items():
            child = wrapped(
                child, key, Verbatim(str(value)) if isinstance(value, str) else value, remark_of(element, child)
            )
        return child
    return decorators.measured(tree, element, kind, known, child)


def _subtree(tree: TreeContext, element: Element) -> MissionStep:
    name = element.attributes.get("ID", "").strip()
    inner = tree.project.find_tree(name, tree.tree.file)
    attributes = element.attributes
    is_old = tree.tree.version == 3
    shares = any(
        attributes.get(each, "").lower() in ("true", "1")
        for each in ("_autoremap", "__autoremap", "__shared_blackboard")
    )
    entries, constants = dict[str, str](), dict[str, object]()
    for port, value in call_ports(tree.project, inner, element).items():
        if is_pointer(value) or (is_old and element.tag == "SubTree"):
            entries[port] = entry_of(value, port)
        else:
            constants[port] = constant_value(value)
    if inner is None or inner.body is None:
        return _missing_subtree(tree, element, name or "SubTree")
    if (own := translate_call(tree, element, inner, name)) is not None:
        tree.calls.append((own, SubtreeCall(inner, element, entries, constants, shares)))
        return own
    step = tree.add_name(MissionStep("mission", name), element)
    tree.calls.append((step, SubtreeCall(inner, element, entries, constants, shares)))
    return step


def _missing_subtree(tree: TreeContext, element: Element, name: str) -> MissionStep:
    if name in tree.rules:
        return leaves.leaf(tree, element, name, "SubTree")
    tree.report.add(LOST, element, f"the tree '{name}' is in no file of this import: import its folder", "SubTree")
    tree.report.stubbed["SubTree (in another file)"] += 1
    return leaves.stub_step(tree, element, name, "SubTree")


Control = Callable[[TreeContext, Element, str], MissionStep | None]
Decorator = Callable[[TreeContext, Element, str, SkipAs], MissionStep | None]
LeafTranslation = Callable[[TreeContext, Element], MissionStep]

_CONTROLS: Mapping[str, Control] = {
    "Parallel": composites.parallel,
    "ParallelAll": composites.parallel_all,
    "IfThenElse": composites.choice("switch"),
    "WhileDoElse": composites.choice("reactive_switch"),
    "SequenceWithMemory": composites.sequence_with_memory,
    "TryCatch": composites.try_catch,
    "PipelineSequence": nav2.pipeline,
    "RecoveryNode": nav2.recovery,
    "NonblockingSequence": nav2.non_blocking,
    **{name: composites.switch for name in KINDS if name.startswith("Switch")},
}

_DECORATORS: Mapping[str, Decorator] = {
    "RunOnce": decorators.run_once,
    "SingleTrigger": nav2.single_trigger,
    "Precondition": decorators.precondition,
    "ForEach": decorators.for_each_of_vector,
    "ForEachUntilSuccess": decorators.for_each_of_vector,
    **{name: decorators.loop for name in KINDS if name.startswith("Loop")},
    **{name: decorators.blackboard_check for name in KINDS if name.startswith("BlackboardCheck")},
}

_LEAVES: Mapping[str, LeafTranslation] = {
    "Script": leaves.script_step,
    "ScriptCondition": leaves.script_condition,
    "SetBlackboard": leaves.set_blackboard,
    "UnsetBlackboard": leaves.unset_blackboard,
    "Sleep": leaves.sleep,
}
