"""Translation of leaves: to a leaf of missions, by the table of leaves, or to a stub leaf."""

from missions.plugins.interchange.blackboard import constant_value, entry_of, kind_of_constant
from missions.plugins.interchange.context import TreeContext, quantity, set_step, with_outputs
from missions.plugins.interchange.foreign_trees import PortModel, ports_of
from missions.plugins.interchange.leaf_rules import TIMEOUT, TIMEOUT_ARGUMENT, LeafRule, PortRule, check_argument
from missions.plugins.interchange.mission_text import Computed, MissionStep, PlainExpression, Verbatim, snake_word
from missions.plugins.interchange.node_kinds import KINDS, NAV2_ERRORS
from missions.plugins.interchange.port_directions import model_of
from missions.plugins.interchange.report import DIFFERS, LOST
from missions.plugins.interchange.scripts import TEXT, Formula, as_condition
from missions.plugins.interchange.stub_leaves import StubArgument, kind_of_port
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.yaml_ports import is_pointer


def sleep(tree: TreeContext, element: Element) -> MissionStep:
    """Return a Sleep node as a ``wait`` step; as ``succeed`` if its time is 0."""
    text = tree.port(element, "Sleep", "msec")
    if is_pointer(text):
        name = tree.pointer(text, "msec")
        return MissionStep("wait", Verbatim(f'"${{{name}}} ms"'), reads=(name,))
    number = constant_value(text)
    seconds = float(number) / 1000 if isinstance(number, int | float) else 0.0
    if seconds <= 0:
        return MissionStep("succeed")
    return MissionStep("wait", quantity(seconds, "s"))


def script_step(tree: TreeContext, element: Element) -> MissionStep:
    """Return a Script node as ``set`` steps for its assignments; a stub leaf if missions cannot express it."""
    script = tree.script(element, element.attributes.get("code", ""))
    if script is None:
        return _script_stub(tree, element)
    steps = tree.set_steps(script.assignments)
    if not steps:
        return MissionStep("succeed", comments=[element.attributes.get("code", "")])
    return steps[0] if len(steps) == 1 else MissionStep("sequence", steps)


def script_condition(tree: TreeContext, element: Element) -> MissionStep:
    """Return a ScriptCondition node as a ``check``, after ``set`` steps for its assignments.

    A stub leaf if missions cannot express the script.
    """
    script = tree.script(element, element.attributes.get("code", ""))
    if script is None or (script.condition is None and not script.assignments):
        return _script_stub(tree, element)
    condition = script.condition
    if condition is None:
        last = script.assignments[-1].entry
        condition = Formula(tree.variable(last), tree.kinds.get(last), (last,))
    check = MissionStep("check", PlainExpression(as_condition(condition).text), reads=tree.variables_of(condition))
    steps = tree.set_steps(script.assignments)
    return MissionStep("sequence", [*steps, check]) if steps else check


def _script_stub(tree: TreeContext, element: Element) -> MissionStep:
    return stub_step(tree, element, "Script", "Action")


def set_blackboard(tree: TreeContext, element: Element) -> MissionStep:
    """Return a SetBlackboard node as a ``set`` step for the variable of its entry."""
    entry = entry_of(element.attributes.get("output_key", ""))
    value = element.attributes.get("value", "")
    if not entry:
        return MissionStep("succeed")
    name = tree.variable(entry)
    if is_pointer(value):
        other = tree.pointer(value, "value")
        return MissionStep("set", {name: Computed(other)}, reads=(other,), sets=(name,))
    return MissionStep("set", {name: constant_value(value)}, sets=(name,))


def unset_blackboard(tree: TreeContext, element: Element) -> MissionStep:
    """Return an UnsetBlackboard node as a step that sets the variable of its entry to null."""
    entry = entry_of(element.attributes.get("key", ""))
    if not entry:
        return MissionStep("succeed")
    tree.report.add(DIFFERS, element, KINDS["UnsetBlackboard"].difference)
    return set_step({tree.variable(entry): None})


def leaf(tree: TreeContext, element: Element, kind: str, role: str) -> MissionStep:
    """Return a leaf of another program as the leaf of missions that replaces it, otherwise as a stub leaf.

    ``kind`` is its name, such as "Grasp"; ``role`` is "Action" or "Condition", or empty if unknown.
    """
    rule = tree.rules.get(kind)
    if rule is None or not rule.leaf:
        return stub_step(tree, element, kind, role)
    arguments, misfits = dict[str, object](), dict[str, str]()
    step = MissionStep(rule.leaf)
    declared = tree.leaves[rule.leaf].arguments
    for port, value in ports_of(element).items():
        if (port_rule := rule.ports.get(port)) is not None:
            written = _ruled_value(tree, step, value, port, port_rule)
            try:
                if not is_pointer(value):
                    wanted = declared.get(port_rule.argument, TIMEOUT_ARGUMENT)
                    check_argument(wanted, written.text if isinstance(written, Verbatim) else written)
                arguments[port_rule.argument] = written
            except ValueError as error:
                misfits[port] = f"the port '{port}': {error}"
    arguments |= {name: Verbatim(text) for name, text in rule.constants.items()}
    missing = [each.name for each in declared.values() if each.required and each.name not in arguments]
    if missing:
        needs = f"'{rule.leaf}' needs {' and '.join(map(repr, missing))}, which no port gives"
        return stub_step(tree, element, kind, role, "; ".join((*misfits.values(), needs)))
    if TIMEOUT in arguments and TIMEOUT not in declared:
        step.keys["timeout"] = arguments.pop(TIMEOUT)
    is_principal = [declared[name].principal for name in arguments] == [True]
    alone = next(iter(arguments.values()), None)
    step.value = alone if is_principal and not str(alone).startswith("{") else arguments or None
    for text in misfits.values():
        tree.report.add(LOST, element, text, kind)
    _store_output(tree, step, element, kind, rule)
    tree.stubs.note_ports(kind, element)
    return tree.add_name(step, element)


def _store_output(tree: TreeContext, step: MissionStep, element: Element, kind: str, rule: LeafRule) -> None:
    """Store the output of a leaf that ``rule`` names by ``as``, and report the ports that the rule does not name."""
    model = model_of(tree.project, kind, tree.rules)
    guessed = tree.project.guessed_outputs.get(kind, ())
    for port, value in ports_of(element).items():
        if port in rule.ports:
            continue
        is_output = port in rule.outputs or model.port(port).direction == "out"
        if is_output and "as" not in step.keys and is_pointer(value) and tree.leaves[rule.leaf].output_doc:
            step.keys["as"] = name = tree.pointer(value, port)
            step.sets += (name,)
            if port in guessed:
                text = f"its output seems to be '{port}'; if so, add outputs: [{port}] to your table"
                tree.report.add(DIFFERS, element, text, kind)
        else:
            seems = ", which seems to be an output" if port in guessed else ""
            tree.report.add(LOST, element, f"the port '{port}'{seems}: it is not in the table of leaves", kind)


def _ruled_value(tree: TreeContext, step: MissionStep, value: str, port: str, rule: PortRule) -> object:
    if is_pointer(value):
        name = tree.pointer(value, port)
        step.reads += (name,)
        if rule.reversed or rule.drops_sign:
            formula = f"{'-' * rule.reversed}{f'abs({name})' if rule.drops_sign else name}"
            return Computed(f"{formula} * 1 {rule.unit}" if rule.unit else formula)
        return Verbatim(f'"${{{name}}} {rule.unit}"') if rule.unit else Computed(name)
    constant = constant_value(value)
    if isinstance(constant, bool | str):
        return constant
    number = abs(constant) if rule.drops_sign else constant
    signed = -number if rule.reversed else number
    return quantity(signed, rule.unit) if rule.unit else signed


def stub_step(tree: TreeContext, element: Element, kind: str, role: str, reason: str = "") -> MissionStep:
    """Return the step of a stub leaf: its input ports are arguments, and its outputs are stored in variables.

    ``kind`` is the name of the leaf in the XML file, ``role`` its role, such as "Condition", or empty if unknown.
    ``reason`` is that for which the table of leaves has no effect on the node.
    """
    tree.stubs.note_ports(kind, element)
    model = model_of(tree.project, kind, tree.rules)
    stub = tree.stubs.stub(kind, role or model.role or "Action")
    stub.uses += 1
    stub.ports |= model.ports
    step = MissionStep(stub.tag)
    arguments, outputs = dict[str, object](), dict[str, str]()
    for port, value in ports_of(element).items():
        declared = stub.ports.setdefault(port, model.port(port))
        if declared.direction in ("out", "inout") and is_pointer(value):
            outputs[port] = tree.pointer(value, port)
        if declared.direction != "out":
            arguments[port] = _argument(tree, step, value, port, declared)
            stub.note_argument(port, declared, _kind_of_value(tree, value, port, declared))
    for port, declared in model.ports.items():
        if declared.direction != "out" and port not in arguments and (declared.default or declared.help):
            stub.arguments.setdefault(port, StubArgument(declared))
    step.value = arguments or None
    tree.add_name(step, element)
    guessed = [f"'{port}'" for port in outputs if port in tree.project.guessed_outputs.get(kind, ())]
    ports = f", whose output seems to be {' and '.join(guessed)}" if guessed else ""
    namesake = snake_word(kind)
    if not reason and stub.tag != namesake and namesake in tree.leaves:
        reason = f"'{namesake}' exists; to use it, add to your table of leaves: {kind}: {{leaf: {namesake}}}"
    because = f": {reason}" if reason else ""
    tree.report_stub(element, stub.tag, kind, f"{ports}{because}")
    for port in sorted(set(outputs).intersection(NAV2_ERRORS)):
        tree.report.add(DIFFERS, element, f"'{port}' is stored after a success only; a failure has a reason", kind)
    return with_outputs(step, outputs, several=len(stub.outputs) > 1, fresh=tree.names.fresh)


def _argument(tree: TreeContext, step: MissionStep, value: str, port: str, model: PortModel) -> object:
    if is_pointer(value):
        name = tree.pointer(value, port)
        step.reads += (name,)
        return Computed(name)
    return value if kind_of_port(model) == TEXT else constant_value(value)


def _kind_of_value(tree: TreeContext, value: str, port: str, model: PortModel) -> str | None:
    """Return the kind of a port's value; None if unknown, or if the port's type is text, which fits any value."""
    if is_pointer(value):
        return tree.kinds.get(entry_of(value, port))
    return None if kind_of_port(model) == TEXT else kind_of_constant(value)
