"""Export of steps that BehaviorTree.CPP has an equal node for.

If a step becomes several nodes, the outermost has the attribute ``MARK`` with the word of the step, so that an import
makes one step of them again.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

from config.units import parse_quantity
from config.yaml_nodes import Mapping as Entries
from config.yaml_nodes import Node, Scalar
from missions.language.nodes import SWITCHES, WAIT_FOR
from missions.language.plan import Step
from missions.plugins.interchange.custom_nodes import output_ports
from missions.plugins.interchange.node_kinds import CASES, COUNTS, FILLER, MARK, REASON
from missions.plugins.interchange.script_writer import (
    ANY,
    FLAG,
    OTHER,
    TEXT,
    WHOLE,
    NotAScriptError,
    script_condition,
    script_expression,
    script_value,
)
from missions.plugins.interchange.tree_writer import TreeWriter, can_be_skipped
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.yaml_ports import ONE_NAME, port_text


def native_element(writer: TreeWriter, step: Step) -> Element:
    """Return the XML element of a step other than a modifier. Raises NotAScriptError if there is no equal node."""
    translate = _NATIVE.get(step.kind)
    if translate is None:
        raise NotAScriptError("" if step.leaf is not None else f"'{step.kind}'")
    return translate(writer, step)


def native_modifier(writer: TreeWriter, step: Step, child: Element) -> Element:
    """Return the XML element of a modifier around ``child``, the element of the modified node.

    Raises NotAScriptError if there is no equal node.
    """
    translate = _MODIFIERS.get(step.kind)
    if translate is None or len(step.children) > 1:
        raise NotAScriptError(f"'{step.kind}'")
    return translate(writer, step, child)


_CONTROLS = {
    "sequence": "Sequence",
    "selector": "Fallback",
    "reactive_sequence": "ReactiveSequence",
    "reactive_selector": "ReactiveFallback",
}


def _composite(writer: TreeWriter, step: Step) -> Element:
    if extra := writer.settings(step):
        raise NotAScriptError(f"'{extra[0]}'")
    if (leaf := _leaf_with_outputs(writer, step)) is not None:
        return leaf
    code = _code_on_failure(writer, step)
    children = writer.children(step)
    if code and "_onFailure" not in children[0].attributes:
        children[0].attributes["_onFailure"] = code
        return children[0]
    return writer.new(_CONTROLS[step.kind], step, None, children, is_named=True)


def _leaf_with_outputs(writer: TreeWriter, step: Step) -> Element | None:
    """Return the node of a leaf with several output ports, which an import has translated to a leaf and a ``set``.

    None for other steps.
    """
    first, last = step.children[0], step.children[-1]
    name, leaf = first.output_variable, first.leaf
    if (step.kind, last.kind, len(step.children)) != ("sequence", "set", 2) or name is None or leaf is None:
        return None
    value = writer.mission.value(last)
    entries = value.entries if isinstance(value, Entries) else []
    reads = {
        key.text: re.fullmatch(rf"\${{{name}\.(\w+)}}", node.text) for key, node in entries if isinstance(node, Scalar)
    }
    outputs = {found[1]: f"{{{key}}}" for key, found in reads.items() if found is not None}
    is_all = len(outputs) == len(entries) and writer.mission.source.text.count(name) == len(entries) + 1
    written = first.arguments_as_written
    is_same = all(written.get(port, f"${entry}") == f"${entry}" for port, entry in outputs.items())
    is_plain = step.name == step.kind and last.name == last.kind
    if not (is_all and is_same and is_plain and outputs.keys() <= {*output_ports(leaf)}):
        return None
    element = writer.element(replace(first, output_variable=None))
    node = element.children[-1] if element.children else element
    node.attributes |= outputs
    element.comments += writer.mission.comments(last)
    return element


def _code_on_failure(writer: TreeWriter, step: Step) -> str:
    """Return the script ``_onFailure`` that an import has translated to a selector; empty for other steps.

    The second child of the selector sets variables and fails again, with the same reason.
    """
    second = step.children[-1]
    if (step.kind, second.kind, len(step.children)) != ("selector", "sequence", 2) or can_be_skipped(step.children[0]):
        return ""
    *assignments, last = second.children
    if any(each.name != each.kind for each in (step, second, *second.children)):
        return ""
    reason = writer.argument(last, "because") if last.kind == "fail" else None
    if not isinstance(reason, Scalar) or reason.text != "${failure}" or any(each.kind != "set" for each in assignments):
        return ""
    try:
        return "; ".join(_set(writer, each).attributes.get("code", "") for each in assignments).strip("; ")
    except NotAScriptError:
        return ""


def _race(writer: TreeWriter, step: Step) -> Element:
    if any(map(can_be_skipped, step.children)):
        raise NotAScriptError("a skipped node in a 'race'")
    attributes = {"success_count": "1", "failure_count": "1", MARK: "race"}
    return writer.new("Parallel", step, attributes, writer.children(step), is_named=True)


def _wait_for(writer: TreeWriter, step: Step) -> Element:
    if can_be_skipped(step.children[0]):
        raise NotAScriptError("a loop around a skipped node")
    attributes = {"num_attempts": "-1", MARK: WAIT_FOR}
    return writer.new("RetryUntilSuccessful", step, attributes, writer.children(step), is_named=True)


def _parallel(writer: TreeWriter, step: Step) -> Element:
    settings = {name: value.constant for name, value in step.arguments.items() if value.template is None}
    if len(settings) < len(step.arguments):
        raise NotAScriptError("a calculated count")
    if settings and any(map(can_be_skipped, step.children)):
        raise NotAScriptError("a skipped node in a 'parallel' with counts")
    if settings.pop("wait_for_all", False):
        count = len(step.children)
        needed, failures = settings.get("success_count", count), settings.get("failure_count", 1)
        needed = needed if isinstance(needed, int) else count
        most = min(failures if isinstance(failures, int) else count, count - needed + 1)
        attributes = {"max_failures": str(most), MARK: "parallel"}
        if settings:
            attributes[COUNTS] = ", ".join(f"{key}: {value}" for key, value in settings.items())
        return writer.new("ParallelAll", step, attributes, writer.children(step), is_named=True)
    written = {name: "-1" if value == "all" else str(value) for name, value in settings.items()}
    attributes = {**written, **({MARK: "parallel"} if written else {})}
    return writer.new("Parallel", step, attributes, writer.children(step), is_named=True)


def _switch(writer: TreeWriter, step: Step) -> Element:
    text, kind = script_expression(writer.argument(step, "on"), writer.mission.kinds)
    has_default = len(step.children) > len(step.cases)
    children = writer.children(step)
    cases = [case.text for case, _ in writer.case_entries(step)]
    if kind == FLAG:
        places = {("true" if case is True else "false"): place for place, case in enumerate(step.cases)}
        ends = [places.get(word, len(step.cases) if has_default else None) for word in ("true", "false")]
        if ends[0] == ends[1]:
            raise NotAScriptError("a switch with a default alone")
        if ends[1] is None:
            ends = ends[:1]
        filler = writer.new("AlwaysFailure", step, {MARK: FILLER})
        branches = [filler if place is None else children[place] for place in ends]
        names = ["null" if place is None else "default" if place == len(cases) else cases[place] for place in ends]
        condition = writer.new("ScriptCondition", step, {"code": text})
        tag = "WhileDoElse" if SWITCHES[step.kind].reactive else "IfThenElse"
        marks = {MARK: step.kind, CASES: f"[{', '.join(names)}]"}
        return writer.new(tag, step, marks, [condition, *branches], is_named=True)
    plain = all(isinstance(case, str | int) and not isinstance(case, bool) for case in step.cases)
    if kind not in (TEXT, WHOLE, ANY) or text not in writer.mission.kinds:
        raise NotAScriptError(f"a '{step.kind}' on this value")
    if not plain or not 2 <= len(cases) <= 6:
        raise NotAScriptError(f"a '{step.kind}' with these cases")
    if not SWITCHES[step.kind].reactive:
        raise NotAScriptError(f"a 'switch' that keeps its case (a 'reactive_switch' becomes Switch{len(cases)})")
    attributes = {"variable": f"{{{text}}}", **{f"case_{n}": case for n, case in enumerate(cases, start=1)}}
    if not has_default:
        children.append(writer.new("AlwaysFailure", step, {MARK: FILLER}))
    return writer.new(f"Switch{len(cases)}", step, {**attributes, MARK: step.kind}, children, is_named=True)


def _check(writer: TreeWriter, step: Step) -> Element:
    code = script_condition(writer.argument(step, "condition"), writer.mission.kinds)
    return writer.new("ScriptCondition", step, {"code": code}, is_named=True)


def _wait_until(writer: TreeWriter, step: Step) -> Element:
    code = script_condition(writer.argument(step, "condition"), writer.mission.kinds)
    condition = writer.new("ScriptCondition", step, {"code": code})
    attributes = {"num_attempts": "-1", MARK: step.kind}
    return writer.new("RetryUntilSuccessful", step, attributes, [condition], is_named=True)


def _set(writer: TreeWriter, step: Step) -> Element:
    kinds, assigned = writer.mission.kinds, dict[str, str]()
    values = writer.mission.assigned(step)
    removed = [name for name, value in values.items() if value.template is None and value.constant is None]
    for name, value in values.items():
        if name in removed:
            continue
        reads = () if value.template is None else value.template.reads
        if any(read.name in assigned or read.name in removed for read in reads):
            raise NotAScriptError("a variable that the same step sets")
        assigned[name] = f"{name} := {script_value(value, kinds, kinds.get(name, OTHER))}"
    script = "; ".join(assigned.values())
    if not removed:
        return writer.new("Script", step, {"code": script}, is_named=True)
    parts = [writer.new("UnsetBlackboard", step, {"key": name}) for name in removed]
    parts += [writer.new("Script", step, {"code": script})] if script else []
    return writer.new("Sequence", step, {MARK: step.kind}, parts, is_named=True)


def _wait(writer: TreeWriter, step: Step) -> Element:
    return writer.new("Sleep", step, {"msec": _milliseconds(writer.argument(step, "duration"))}, is_named=True)


def _succeed(writer: TreeWriter, step: Step) -> Element:
    return writer.new("AlwaysSuccess", step, None, is_named=True)


def _fail(writer: TreeWriter, step: Step) -> Element:
    given = {REASON: port_text(writer.argument(step, "because"), is_text=True)} if step.arguments_as_written else {}
    return writer.new("AlwaysFailure", step, given, is_named=True)


def _if(writer: TreeWriter, step: Step, child: Element) -> Element:
    code = script_condition(writer.mission.value(step), writer.mission.kinds)
    if "_skipIf" in child.attributes:
        raise NotAScriptError("a second 'if'")
    child.attributes["_skipIf"] = f"!({code})"
    return child


def _guarded(writer: TreeWriter, step: Step, child: Element) -> Element:
    """Return a ``while`` or ``until`` as a reactive composite of two children: the condition and the node."""
    code = script_condition(writer.mission.value(step), writer.mission.kinds)
    writer.require_unskipped(step)
    tag = "ReactiveSequence" if step.kind == "while" else "ReactiveFallback"
    condition = writer.new("ScriptCondition", step, {"code": code})
    return writer.new(tag, step, {MARK: step.kind}, [condition, child])


def _for(writer: TreeWriter, step: Step, child: Element) -> Element:
    """Return a ``for`` as a Parallel with two children, a Sleep and the modified node; the first to end decides."""
    writer.require_unskipped(step)
    sleep = writer.new("Sleep", step, {"msec": _milliseconds(writer.mission.value(step))})
    attributes = {"success_count": "1", "failure_count": "1", MARK: step.kind}
    return writer.new("Parallel", step, attributes, [sleep, child])


def _timed(writer: TreeWriter, step: Step, child: Element) -> Element:
    writer.require_unskipped(step)
    tag, port = ("Timeout", "msec") if step.kind == "timeout" else ("Delay", "delay_msec")
    return writer.new(tag, step, {port: _milliseconds(writer.mission.value(step))}, [child])


def _rounds(writer: TreeWriter, step: Step, child: Element) -> Element:
    writer.require_unskipped(step)
    tag, port = ("RetryUntilSuccessful", "num_attempts") if step.kind == "retry" else ("Repeat", "num_cycles")
    value = writer.mission.value(step)
    text = value.text.strip() if isinstance(value, Scalar) else ""
    pointer = ONE_NAME.fullmatch(text)
    if not pointer and text != "forever" and not text.isdigit():
        raise NotAScriptError("a calculated count")
    count = f"{{{pointer[1]}}}" if pointer else "-1" if text == "forever" else text
    return writer.new(tag, step, {port: count, MARK: step.kind}, [child])


def _result(writer: TreeWriter, step: Step, child: Element) -> Element:
    tags = {"invert": "Inverter", "on_failure": "ForceSuccess", "on_success": "ForceFailure"}
    return writer.new(tags[step.kind], step, None, [child])


def _once(writer: TreeWriter, step: Step, child: Element) -> Element:
    writer.require_unskipped(step)
    if step.arguments["value"].constant is not True:
        raise NotAScriptError("'once' with an expression")
    if not writer.mission.is_main:
        raise NotAScriptError("'once' in a mission that others run")
    return writer.new("RunOnce", step, {"then_skip": "false"}, [child])


def _milliseconds(node: Node) -> str:
    """Return a duration in whole milliseconds, as text; for ``${x} ms``, the pointer ``{x}``.

    Raises NotAScriptError for other calculations, and for fractions of a millisecond.
    """
    text = node.text.strip() if isinstance(node, Scalar) else ""
    if text.endswith(" ms") and (pointer := ONE_NAME.fullmatch(text.removesuffix(" ms").strip())):
        return f"{{{pointer[1]}}}"
    found = parse_quantity(text)
    if found is None or found.dimension != "duration":
        raise NotAScriptError("a calculated duration")
    milliseconds = round(float(found) * 1000, 6)
    if milliseconds != int(milliseconds) or not 1 <= milliseconds < 2**32:
        raise NotAScriptError("a duration of no whole milliseconds")
    return str(int(milliseconds))


_NATIVE: Mapping[str, Callable[[TreeWriter, Step], Element]] = {
    **dict.fromkeys(_CONTROLS, _composite),
    "race": _race,
    WAIT_FOR: _wait_for,
    **dict.fromkeys(SWITCHES, _switch),
    "parallel": _parallel,
    "check": _check,
    "wait_until": _wait_until,
    "set": _set,
    "wait": _wait,
    "succeed": _succeed,
    "fail": _fail,
}

_MODIFIERS: Mapping[str, Callable[[TreeWriter, Step, Element], Element]] = {
    "if": _if,
    "while": _guarded,
    "until": _guarded,
    "for": _for,
    "timeout": _timed,
    "delay": _timed,
    "retry": _rounds,
    "repeat": _rounds,
    "invert": _result,
    "on_failure": _result,
    "on_success": _result,
    "once": _once,
}
