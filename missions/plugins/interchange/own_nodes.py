"""Import of XML elements that `mission show` has exported: they become the steps from which they were made.

Such an element has the attribute ``MARK``, or the declaration of its node in ``TreeNodesModel`` has a word of missions.
"""

from collections.abc import Callable, Mapping, Sequence

from config.yaml_nodes import Listing, Scalar
from config.yaml_writer import yaml_word
from missions.language.nodes import (
    COMPOSITES,
    FOR_EACH,
    HALT_LIMIT,
    MISSION,
    MODIFIERS,
    RECOVER,
    RETRY,
    SWITCHES,
    WAIT_FOR,
)
from missions.plugins.interchange import leaves
from missions.plugins.interchange.context import SkipAs, TreeContext, assigned_value, skip_in, with_outputs
from missions.plugins.interchange.foreign_trees import SourceTree, normal_form, ports_of
from missions.plugins.interchange.mission_text import MissionStep, PlainExpression, Verbatim, wrapped
from missions.plugins.interchange.node_kinds import (
    AS,
    CALCULATED,
    CASES,
    COUNTS,
    DEFAULTS,
    FILLER,
    GIVEN,
    MARK,
    PREPARED,
    REASON,
    RESULT,
    RETURNS,
    UNSKIPPED,
)
from missions.plugins.interchange.port_directions import model_of
from missions.plugins.interchange.report import LOST
from missions.plugins.interchange.scripts import TEXT
from missions.plugins.interchange.stub_leaves import kind_of_port, stores_several
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.yaml_ports import (
    YAML_PREFIX,
    entries_of,
    flow_text,
    is_pointer,
    is_text_argument,
    port_value,
    read_entries,
    read_flow,
)

MAX_CASE_LENGTH = 200


def translate_own(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep | None:
    """Return the step from which an XML element was exported.

    None if the element was not exported from a mission, or has been edited into another form.
    """
    mark = element.attributes.get(MARK, "")
    if mark:
        writer = _MARKED.get(mark) if element.children else None
        step = None if writer is None else writer(tree, element, skip_as)
        return None if step is None else _with_name(step, element, mark)
    if REASON in element.attributes:
        return _with_name(MissionStep("fail", Verbatim(_value(tree, element, REASON, is_text=True))), element)
    kind, role = normal_form(element, tree.project)
    word = tree.project.models[kind].word if kind in tree.project.models else ""
    if not word:
        return None
    if not element.children:
        return _leaf(tree, element, kind, role, word)
    step = _custom(tree, element, word, [tree.node(child, skip_in(word), word) for child in element.children])
    return None if step is None else _with_name(step, element, word)


def _with_name(step: MissionStep, element: Element, word: str = "") -> MissionStep:
    """Give a step the name of its element; that of a modifier becomes a comment behind it."""
    name = element.attributes.get("name", "").strip()
    if name and word in MODIFIERS:
        step.remarks[word] = name
    elif name and "name" not in step.keys:
        step.keys = {"name": Verbatim(yaml_word(name)), **step.keys}
    return step


def _ports(element: Element) -> list[tuple[str, str]]:
    """Return the ports of an exported element and their texts.

    Editors add a port without a value; it is left out, since the export writes an empty text as YAML.
    """
    return [(port, text) for port, text in ports_of(element).items() if text]


def _value(tree: TreeContext, element: Element, port: str, *, is_text: bool = False) -> str:
    """Return the value of a port of an element as YAML text; report a value that is not YAML as lost."""
    text = element.attributes[port]
    try:
        return port_value(text, is_text=is_text)
    except ValueError as error:
        tree.report.add(LOST, element, f"the port '{port}': {error}")
        return port_value(text.removeprefix(YAML_PREFIX), is_text=True)


# Elements with a mark.


def _pair(word: str) -> Callable[[TreeContext, Element, SkipAs], MissionStep | None]:
    """Return a function that translates an element with two children: a condition, or a Sleep for ``for``, and a node.

    ``word`` is the modifier that it was exported from: ``while``, ``until`` or ``for``.
    """

    def translate(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep | None:
        if len(element.children) != 2:
            return None
        first, second = element.children
        if word == "for":
            return wrapped(tree.node(second, skip_as, word), word, leaves.sleep(tree, first).value)
        condition = tree.condition(first, first.attributes.get("code", ""))
        if condition is None:
            return None
        child = tree.node(second, skip_as, word)
        return wrapped(child, word, PlainExpression(condition.text), reads=tree.variables_of(condition))

    return translate


def _race(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep:
    del skip_as
    return MissionStep("race", tree.children(element, "success"))


def _parallel(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep:
    del skip_as
    step = MissionStep("parallel", tree.children(element, "success"))
    if "max_failures" in element.attributes:
        step.keys["wait_for_all"] = True
    counts = read_entries(f"{{{element.attributes.get(COUNTS, '')}}}")
    for key in ("success_count", "failure_count"):
        if element.attributes.get(key):
            step.keys[key] = "all" if element.attributes[key] == "-1" else Verbatim(_value(tree, element, key))
        elif key in counts:
            step.keys[key] = Verbatim(flow_text(counts[key]))
    return step


def _rounds(word: str, port: str) -> Callable[[TreeContext, Element, SkipAs], MissionStep | None]:
    def translate(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep | None:
        if len(element.children) != 1 or port not in element.attributes:
            return None
        text = element.attributes[port].strip()
        child = tree.node(element.children[0], skip_as, word)
        count = "forever" if text.startswith("-") else _value(tree, element, port)
        return wrapped(child, word, Verbatim(count))

    return translate


def _wait_for(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep | None:
    del skip_as
    if len(element.children) != 1:
        return None
    return MissionStep(WAIT_FOR, tree.node(element.children[0], "running", WAIT_FOR))


def _wait_until(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep | None:
    del skip_as
    code = element.children[0].attributes.get("code", "") if len(element.children) == 1 else ""
    condition = tree.condition(element, code) if code else None
    if condition is None:
        return None
    return MissionStep("wait_until", PlainExpression(condition.text), reads=tree.variables_of(condition))


def _set(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep | None:
    del skip_as
    values = dict[str, object]()
    reads = tuple[str, ...]()
    for child in element.children:
        step = tree.node(child, "success", "set")
        if step.word != "set" or not isinstance(step.value, dict):
            return None
        values |= step.value
        reads += step.reads
    return MissionStep("set", values, reads=reads, sets=tuple(values))


def _switch(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep | None:
    del skip_as
    word, children = element.attributes[MARK], list(element.children)
    cases = dict[str | Verbatim, object]()
    value: dict[str, object] = {"on": None, "cases": cases}
    on: str | None
    names: Sequence[str | Verbatim | None]
    reads: tuple[str, ...] = ()
    if "variable" in element.attributes:
        on = tree.variable(element.attributes["variable"].strip("{} "))
        names = [element.attributes.get(f"case_{number}") for number in range(1, len(children))] + ["default"]
        reads = (on,)
    else:
        if len(children) < 2:
            return None
        condition = tree.condition(children[0], children[0].attributes.get("code", ""))
        on = None if condition is None else condition.text
        reads = () if condition is None else tree.variables_of(condition)
        children = children[1:]
        names = _case_names(element)
    if on is None or len(names) != len(children) or not all(map(_can_be_case, names)):
        return None
    for name, child in zip(names, children, strict=True):
        if child.attributes.get(MARK) == FILLER:
            continue
        step = tree.node(child, "success", word)
        if name in ("default", Verbatim("default")):
            value["default"] = step
        elif name is not None:
            cases[name] = step
    value["on"] = PlainExpression(on)
    return MissionStep(word, value, reads=reads)


def _can_be_case(name: str | Verbatim | None) -> bool:
    """Return whether a text is short enough for a case of a switch, which is a key in YAML."""
    return name is not None and len(name.text if isinstance(name, Verbatim) else name) <= MAX_CASE_LENGTH


def _case_names(element: Element) -> list[Verbatim]:
    """Return the cases of an exported switch, in the order of its children; empty if they cannot be read."""
    try:
        ports = (element.attributes.get(f"case_{number}") for number in range(1, len(element.children) + 1))
        names = ", ".join(port_value(text, is_text=False) for text in ports if text)
        found = read_flow(element.attributes.get(CASES, f"[{names}]"))
    except ValueError:
        return []
    items = found.items if isinstance(found, Listing) else []
    return [Verbatim(flow_text(each)) for each in items if isinstance(each, Scalar)]


def _prepared(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep | None:
    """Return the step for a Sequence of a Script, which sets variables, and a leaf or SubTree, which reads them.

    The step has the values of the script directly, as arguments or params.
    """
    if len(element.children) != 2:
        return None
    script = tree.script(element, element.children[0].attributes.get("code", ""))
    if script is None:
        return None
    step = tree.node(element.children[1], skip_as, "")
    values = {
        Verbatim(port_value(f"{{{each.entry}}}", is_text=True)): assigned_value(each.formula, None)
        for each in script.assignments
    }
    step.value = _with_values(step.value, values)
    if "with" in step.keys:
        step.keys["with"] = _with_values(step.keys["with"], values)
    return step


def _with_values(value: object, values: Mapping[Verbatim, object]) -> object:
    """Return an argument, or a mapping of arguments, in which the variables in ``values`` have been replaced."""
    if isinstance(value, dict):
        return {name: _with_values(each, values) for name, each in value.items()}
    return values.get(value, value) if isinstance(value, Verbatim) else value


def _unskipped(tree: TreeContext, element: Element, skip_as: SkipAs) -> MissionStep | None:
    return tree.node(element.children[1], skip_as, "") if len(element.children) == 2 else None


_MARKED: Mapping[str, Callable[[TreeContext, Element, SkipAs], MissionStep | None]] = {
    **{word: _pair(word) for word in ("while", "until", "for")},
    "retry": _rounds("retry", "num_attempts"),
    "repeat": _rounds("repeat", "num_cycles"),
    "race": _race,
    "parallel": _parallel,
    WAIT_FOR: _wait_for,
    "wait_until": _wait_until,
    "set": _set,
    **dict.fromkeys(SWITCHES, _switch),
    PREPARED: _prepared,
    UNSKIPPED: _unskipped,
}


# Custom nodes.


def _custom(tree: TreeContext, element: Element, word: str, children: list[MissionStep]) -> MissionStep | None:
    if word in MODIFIERS:
        return _custom_modifier(tree, element, word, children)
    if word in SWITCHES:
        names = _case_names(element)
        value: dict[str, object] = {
            "on": PlainExpression(element.attributes.get("on", "")),
            "cases": dict(zip(names, children, strict=False)),
        }
        if len(children) > len(names):
            value["default"] = children[-1]
        return MissionStep(word, value) if names and all(map(_can_be_case, names)) else None
    if word == FOR_EACH:
        return _custom_loop(tree, element, children[0])
    if word == WAIT_FOR:
        return MissionStep(word, children[0])
    if word not in COMPOSITES:
        return None
    return MissionStep(word, children, {name: Verbatim(_value(tree, element, name)) for name, _ in _ports(element)})


def _custom_modifier(tree: TreeContext, element: Element, word: str, children: list[MissionStep]) -> MissionStep | None:
    step, *others = children
    if others:
        key = RECOVER if word == RETRY else word
        step = MissionStep("sequence", [step]) if key in step.keys or word in step.keys else step
    if element.attributes.get("value"):
        is_expression = MODIFIERS[word].value in ("condition", "expression")
        value = Verbatim(_value(tree, element, "value"))
        step = wrapped(step, word, PlainExpression(element.attributes["value"]) if is_expression else value)
    elif not others:
        return None
    if others:
        step.keys[key] = others[0]
        if element.attributes.get(HALT_LIMIT):
            step.keys[HALT_LIMIT] = Verbatim(_value(tree, element, HALT_LIMIT))
    return step


def _custom_loop(tree: TreeContext, element: Element, child: MissionStep) -> MissionStep:
    fields = dict[str, object]()
    for name in ("in", "as", "number"):
        text = element.attributes.get(name, "").strip()
        if is_pointer(text):
            fields[name] = text.strip("{} ")
        elif text:
            fields[name] = Verbatim(_value(tree, element, name))
    fields["do"] = child
    return MissionStep(FOR_EACH, fields)


def _leaf(tree: TreeContext, element: Element, kind: str, role: str, word: str) -> MissionStep:
    """Return the leaf of missions from which a custom node was exported; a stub leaf if no loaded leaf has its tag."""
    leaf = tree.leaves.get(word)
    model = model_of(tree.project, kind, tree.rules)
    declared = {} if leaf is None else leaf.arguments
    step = _with_name(MissionStep(word), element)
    stub = None
    if leaf is None:
        stub = tree.stubs.stub(kind, role or model.role or "Action", word)
        stub.uses += 1
        stub.ports |= model.ports
        step.word = stub.tag
        tree.report_stub(element, stub.tag, kind)
    if leaf is not None and leaf.open_ended:
        entries = read_entries(element.attributes.get("values", ""))
        step.value = {name: Verbatim(flow_text(node)) for name, node in entries.items()}
        step.sets = tuple(entries)
        return step
    arguments, outputs = dict[str, object](), dict[str, str]()
    for port, text in _ports(element):
        found = model.port(port)
        if found.direction != "in" or (port.rstrip("_") == RESULT and port not in declared):
            outputs[port] = text.strip("{} ")
            if found.direction != "inout":
                continue
        name = port.removesuffix("_") if port in ("name_", "ID_") else port
        is_text = is_text_argument(declared[name]) if name in declared else kind_of_port(found) == TEXT
        arguments[name] = Verbatim(_value(tree, element, port, is_text=is_text))
        if stub is not None:
            stub.note_argument(name, found, None if is_pointer(text) else kind_of_port(found))
    principal = next((name for name, each in declared.items() if each.principal), "")
    step.value = arguments[principal] if set(arguments) == {principal} else arguments or None
    several = stores_several(leaf) if leaf is not None else stub is not None and len(stub.outputs) > 1
    return with_outputs(step, outputs, several=several and RESULT not in outputs, fresh=tree.names.fresh)


# Missions.


def translate_call(tree: TreeContext, element: Element, inner: SourceTree, name: str) -> MissionStep | None:
    """Return the ``mission`` step for a SubTree node whose tree ``inner`` was exported from a mission.

    ``name`` is the name of the mission. None if the tree was not exported.
    """
    if not inner.header:
        return None
    returns, calculated = (read_entries(element.attributes.get(key, "")) for key in (RETURNS, CALCULATED))
    given_names, defaults = (element.attributes.get(key, "").split() for key in (GIVEN, DEFAULTS))
    results = returns or entries_of(inner.header.get("returns"))
    returned = {node.text for node in results.values() if isinstance(node, Scalar)}
    given: dict[str, object] = {}
    for port, text in _ports(element):
        is_result = port in returned and is_pointer(text) and text.strip("{} ") in results
        if (not is_result or port in given_names) and port not in defaults:
            given[port] = Verbatim(_value(tree, element, port))
    given |= {key: Verbatim(flow_text(node)) for key, node in calculated.items()}
    step = MissionStep(MISSION, name)
    if given:
        step.keys["with"] = given
    if returns:
        step.keys["returns"] = {key: Verbatim(flow_text(node)) for key, node in returns.items()}
    if AS in element.attributes:
        step.keys["as"] = element.attributes[AS]
    return _with_name(step, element)


def header_of(tree: SourceTree) -> Mapping[str, str]:
    """Return the top-level keys of a mission file, such as ``params``, as YAML text, from the tree of its export.

    Empty for a tree that was not exported from a mission.
    """
    found = {}
    for key, node in tree.header.items():
        lines = [f"{yaml_word(name)}: {flow_text(value)}" for name, value in entries_of(node).items()]
        if isinstance(node, Listing):
            lines = [f"- {flow_text(each)}" for each in node.items]
        found[key] = "".join(f"\n  {line}" for line in lines) if lines else f" {flow_text(node)}"
    return found
