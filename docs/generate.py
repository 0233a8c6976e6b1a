"""Write the generated tables of the docs from the declarations that the checker reads.

``make docs`` runs it. It replaces the text between ``<!-- NAME: begin -->`` and ``<!-- NAME: end -->`` of each page,
and renews the pictures of the gallery. A test fails while a page is stale.
"""

import inspect
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf
from pathlib import Path

from behaviours.catalogue import LEAVES
from behaviours.leaf import Leaf
from config import yaml_nodes
from config.cases import CommonKeys, ExpectKeys, JudgedSuiteKeys
from config.controller import RuleBaseKeys
from config.defaults import DefaultsKeys
from config.diagnostics import MAX_DIAGNOSTICS
from config.fleet import FleetKeys
from config.gesture import GestureKeys
from config.move import MoveKeys
from config.object import ObjectKeys
from config.robot import RobotKeys
from config.units import EXAMPLES, MAX_POWER, UNITS
from config.world import WorldConfig
from config.yaml_nodes import MAX_BYTES, MAX_NODES
from docs import claims, dumps
from drivers.api.gait import GaitKeys
from drivers.table import BUILT_IN_DRIVERS
from missions.cli.commands import OLD_NAMES, declared_commands
from missions.cli.option_declarations import DeclaredOption
from missions.cli.run import command as run
from missions.codec import message_fields
from missions.control.messages import ERRORS, MESSAGES
from missions.language import expressions, operators
from missions.language.check_context import MAX_DEPTH, MAX_STEPS
from missions.language.modifiers import MAX_HALT_LIMIT
from missions.language.nodes import COMPOSITES, MODIFIER_KEYS, MODIFIERS, ORDER_KEYS
from missions.language.operators import FUNCTIONS
from missions.language.parallel_counts import COUNTS
from missions.language.param_types import PARAM_TYPES
from missions.language.robot_state import ROBOT_STATE
from missions.library.catalogue import bounds_text, default_text, details, kind_text, summary
from missions.library.drivers import DriverTable
from missions.options import Option
from missions.plugins.schema.robots import keys_table, markdown_code, markdown_table, robot_reference
from missions.plugins.studio.studio_commands import COMMANDS
from missions.plugins.testing.failsafe.scenario import CHOICES, FAULTS, SILENT_FAULT, FailsafeSetting, run_scenario
from missions.plugins.testing.failsafe.scenario_text import distinct_moments

HERE = Path(__file__).parent


def composites() -> str:
    """Return the table of the composites with a list of children."""
    return markdown_table(
        ("word", "what it does"), ((markdown_code(word), kind.help) for word, kind in COMPOSITES.items())
    )


def modifiers() -> str:
    """Return the table of the modifiers, and of the keys beside them."""
    rows = [(markdown_code(word), each.takes, each.help) for word, each in MODIFIERS.items()]
    keys = [
        (f"{markdown_code(word)} beside {markdown_code(only)}", takes, text)
        for word, (only, takes, text) in MODIFIER_KEYS.items()
    ]
    return markdown_table(("word", "takes", "what it does"), rows + keys)


def counts() -> str:
    """Return the table of the keys that count the children of a parallel."""
    rows = ((markdown_code(word), takes, text) for word, (takes, text) in COUNTS.items())
    return markdown_table(("word", "takes", "what it does"), rows)


def mission_limits() -> str:
    """Return the table of the limits of a mission."""
    rows = (
        ("steps, those of sub-missions counted each time", f"{MAX_STEPS:,}"),
        ("depth of the tree, with modifiers and sub-missions", f"{MAX_DEPTH}"),
        ("time of a `finally`", f"{Leaf.halt_limit:g} s, with `halt_limit` at most {MAX_HALT_LIMIT:g} s"),
        ("size of a file", f"{MAX_BYTES // 10**6} MB"),
        ("values in a file, aliases counted each time", f"{MAX_NODES:,}"),
        ("lists and mappings inside one another in a file", f"{yaml_nodes.MAX_DEPTH}"),
        ("errors shown for one file", f"{MAX_DIAGNOSTICS}"),
        ("an expression", f"{expressions.MAX_LENGTH:,} characters"),
        ("parts of an expression inside one another", f"{expressions.MAX_NESTING}"),
        ("a text that an expression makes", f"{operators.MAX_TEXT:,} characters"),
        (
            "a list that a mission makes",
            f"{operators.MAX_MEMBERS:,} members, {operators.MAX_LIST_TEXT:,} characters of text",
        ),
        (
            "a list or a mapping with expressions in it",
            f"{operators.MAX_DATA_VALUES:,} values, {operators.MAX_DATA_DEPTH} inside one another",
        ),
        ("a whole number", f"{operators.MAX_NUMBER:,.0f}"),
        ("the power of a unit, such as 2 of `m^2`", f"{MAX_POWER}"),
    )
    return markdown_table(("limit", "value"), rows)


def orders() -> str:
    """Return the table of the keys that set the order of a selector's children."""
    rows = ((markdown_code(word), f"`{owner}`", takes, text) for word, (owner, takes, text) in ORDER_KEYS.items())
    return markdown_table(("word", "beside", "takes", "what it does"), rows)


def units() -> str:
    """Return the table of the dimensions with their units."""
    rows = (
        (name, ", ".join(map(markdown_code, known)), markdown_code(EXAMPLES[name])) for name, known in UNITS.items()
    )
    return markdown_table(("dimension", "units", "example"), rows)


def state() -> str:
    """Return the table of the robot's values that expressions can read."""
    values = ((name, *each) for name in ROBOT_STATE for each in ROBOT_STATE[name].values.items())
    rows = ((markdown_code(f"{name}.{member}"), value.help) for name, member, value in values)
    return markdown_table(("name", "what it is"), rows)


def functions() -> str:
    """Return the list of the functions of expressions."""
    return dumps.wrap_paragraph(f"Functions: {', '.join(map(markdown_code, FUNCTIONS))}.")


def param_types() -> str:
    """Return the list of the types of params."""
    return dumps.wrap_paragraph(f"Types: {', '.join(map(markdown_code, PARAM_TYPES))}.")


def leaves() -> str:
    """Return an entry for each leaf."""
    return "\n\n".join(entry(leaf) for leaf in LEAVES.values())


def entry(leaf: type[Leaf]) -> str:
    """Return the section of one leaf: facts and arguments."""
    facts = [f"Drives {', '.join(sorted(leaf.drives))}."] if leaf.drives else []
    facts += [f"Needs {', '.join(sorted(leaf.needs))}."] if leaf.needs else []
    facts += [f"Uses {', '.join(sorted(leaf.optional_parts))} if the robot has them."] if leaf.optional_parts else []
    facts += [f"`as` stores {leaf.output_doc}."] if leaf.output_doc else []
    texts = (summary(leaf), *details(leaf).split("\n\n"), " ".join(facts))
    parts = [f"## {leaf.tag}", *map(dumps.wrap_paragraph, texts)]
    rows = [
        (
            markdown_code(each.name) + (" (may stand alone)" if each.principal else ""),
            kind_text(each),
            bounds_text(each),
            "must be given" if each.required else markdown_code(default_text(each)),
            each.help,
        )
        for each in leaf.arguments.values()
    ]
    if rows:
        parts.append(markdown_table(("argument", "takes", "limits", "default", "meaning"), rows))
    language = (
        "" if any(each.kind == "file" for each in leaf.arguments.values()) else "yaml"
    )  # no such file: not checked
    parts.append(f"```{language}\n{leaf.example}\n```")
    return "\n\n".join(part for part in parts if part)


def robot_keys() -> str:
    """Return the keys of every driver that ships, by kind of part."""
    return robot_reference(
        DriverTable(), frozenset((kind, name) for kind, names in BUILT_IN_DRIVERS.items() for name in names)
    )


def studio_commands() -> str:
    """Return the table of the studio's commands."""
    rows = (
        (
            markdown_code(word),
            kind.role,
            _describe_members(kind, leave=("id",)),
            " ".join((inspect.getdoc(kind) or "").split()),
        )
        for word, kind in COMMANDS.items()
    )
    return markdown_table(("command", "who", "fields", "what it does"), rows)


def studio_messages() -> str:
    """Return the table of the studio's messages."""
    rows = (
        (markdown_code(word), _describe_members(kind), " ".join((inspect.getdoc(kind) or "").split()))
        for word, kind in MESSAGES.items()
    )
    return markdown_table(("message", "fields", "what it says"), rows)


def studio_errors() -> str:
    """Return the table of the errors in answers."""
    return markdown_table(("error", "means"), ((markdown_code(name), about) for name, about in ERRORS.items()))


SITUATIONS = (
    *(FailsafeSetting(fault=fault) for fault in FAULTS if fault != "nothing"),
    FailsafeSetting(fault="bumper left", reflexes="bumper: stop"),
    FailsafeSetting(fault="bumper left", reflexes="latch"),
    FailsafeSetting(fault="cliff left", reflexes="latch"),
    FailsafeSetting(wish="ahead, gently", fault="bumper left"),
    FailsafeSetting(wish="back", fault="cliff left"),
    FailsafeSetting(battery="low"),
    FailsafeSetting(battery="critical"),
    FailsafeSetting(battery="critical, on the dock"),
    FailsafeSetting(wish="too fast"),
    FailsafeSetting(who="both", fault=SILENT_FAULT),
)
"""Situations of the failsafe table in docs/base.md."""


def commands() -> str:
    """Return a table of all commands, by their groups."""
    rows = ((each.group, markdown_code(f"mission {name}"), each.help) for name, each in declared_commands())
    return markdown_table(("group", "command", "what it does"), rows)


def old_names() -> str:
    """Return the table of the former names of commands."""
    rows = (
        (markdown_code(f"mission {old}"), markdown_code(new if "make" in new else f"mission {new}"))
        for old, new in OLD_NAMES.items()
    )
    return markdown_table(("before", "now"), rows)


def run_options() -> str:
    """Return the table of the options of `mission run`, from their declarations."""
    found = [each.declaration for each in run.params if isinstance(each, DeclaredOption) and not each.hidden]
    groups = [*dict.fromkeys(each.group for each in found)]
    rows = (
        (each.group or "Output", markdown_code(each.flag), _takes(each), each.bounds, _default(each), each.help)
        for each in sorted(found, key=lambda it: groups.index(it.group))
    )
    return markdown_table(("group", "option", "takes", "bounds", "default", "what it does"), rows)


def _takes(option: Option) -> str:
    if option.among:
        return ", ".join(map(markdown_code, option.among))
    return option.metavar if option.metavar.isupper() and "=" in option.metavar else option.kind


def _default(option: Option) -> str:
    plain = isinstance(option.default, str | int | float) and option.default is not False and option.default != inf
    return markdown_code(str(option.default)) if plain else ""


def failsafe() -> str:
    """Return the table of a base's reactions, computed by stepping through each situation."""
    usual = FailsafeSetting()
    rows = []
    for each in SITUATIONS:
        chosen = [f"{name}: {word}" for name in CHOICES if (word := getattr(each, name)) != getattr(usual, name)]
        story = distinct_moments(run_scenario(each))
        told = [(moment.t, words) for moment, words in story if moment.t >= 0.0] or [(0.0, story[-1][1])]
        rows.append(("<br>".join(chosen), "<br>".join(f"{t:.2f} s: {words}" for t, words in told)))
    return markdown_table(("situation", "reaction"), rows)


def _describe_members(kind: type, leave: Sequence[str] = ()) -> str:
    """Return the message_fields of a message with their descriptions, optional ones in brackets."""
    found = []
    for each in message_fields(kind):
        if each.name not in leave:
            name = markdown_code(each.name) if each.required else f"[{markdown_code(each.name)}]"
            found.append(f"{name}: {each.description}" if each.description else name)
    return "<br>".join(found)


TABLES: Mapping[str, Callable[[], str]] = {
    "composites": composites,
    "counts": counts,
    "orders": orders,
    "modifiers": modifiers,
    "mission_limits": mission_limits,
    "units": units,
    "state": state,
    "functions": functions,
    "param_types": param_types,
    "leaves": leaves,
    "robot_keys": robot_keys,
    "robot_top": partial(keys_table, RobotKeys),
    "gesture_keys": partial(keys_table, GestureKeys),
    "controller_keys": partial(keys_table, RuleBaseKeys, (RuleBaseKeys,)),
    "rule_keys": partial(keys_table, RuleBaseKeys),
    "world_keys": partial(keys_table, WorldConfig),
    "test_keys": partial(keys_table, JudgedSuiteKeys, {CommonKeys, ExpectKeys}),
    "expect_keys": partial(keys_table, ExpectKeys),
    "move_keys": partial(keys_table, MoveKeys),
    "gait_keys": partial(keys_table, GaitKeys),
    "default_keys": partial(keys_table, DefaultsKeys),
    "fleet_keys": partial(keys_table, FleetKeys),
    "object_keys": partial(keys_table, ObjectKeys),
    "claims": claims.claims,
    "commands": commands,
    "old_names": old_names,
    "run_options": run_options,
    "failsafe": failsafe,
    "gallery": dumps.gallery,
    "studio_commands": studio_commands,
    "studio_messages": studio_messages,
    "studio_errors": studio_errors,
}
"""Generators of the tables, by the name in their markers."""


def renewed(page: str) -> str:
    """Return ``page`` with new text between its markers. Raises KeyError for an unknown name."""
    return re.sub(
        r"(<!-- (\w+): begin -->\n).*?(<!-- \2: end -->)",
        lambda found: f"{found[1]}{TABLES[found[2]]()}\n{found[3]}",
        page,
        flags=re.DOTALL,
    )


def first_line(documented: object) -> str:
    """Return the first line of a docstring."""
    return (inspect.getdoc(documented) or "").partition("\n")[0]


def main() -> None:
    """Renew every page and picture, and print the names of the changed files."""
    for path in sorted(HERE.glob("*.md")):
        page = path.read_text(encoding="utf-8")
        new = renewed(page)
        if new != page:
            path.write_text(new, encoding="utf-8")
            sys.stdout.write(f"wrote {path.name}\n")
    for path in dumps.write():
        sys.stdout.write(f"renewed {path.name}\n")


if __name__ == "__main__":
    main()
