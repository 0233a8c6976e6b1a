"""Stub leaves: for each leaf of an imported tree that missions lack, a Python class whose arguments are its ports.

A mission with stubs can be checked, shown and mocked. A stub refuses to run until its author writes ``update``.
"""

import json
import keyword
import textwrap
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import get_origin

from behaviours.leaf import Leaf
from config.diagnostics import SourceText
from config.yaml_nodes import plain_value
from missions.library.vocabulary import RESERVED_WORDS
from missions.plugins.interchange.foreign_trees import DIRECTIONS, PortModel, ports_of
from missions.plugins.interchange.mission_text import MAX_WORD_BYTES, identifier, snake_word
from missions.plugins.interchange.scripts import FLAG, NUMBER, TEXT
from missions.plugins.interchange.xml_reader import Element
from missions.plugins.interchange.xml_writer import element_lines

NUMBER_TYPES = ("int", "unsigned", "double", "float", "size_t", "uint8_t", "uint16_t", "uint32_t", "uint64_t",
                "int8_t", "int16_t", "int32_t", "int64_t", "unsigned int", "long")  # fmt: skip
TEXT_TYPES = ("std::string", "string", "str", "const char*", "std::string_view")


def kind_of_port(port: PortModel) -> str | None:
    """Return the kind of a port's values from its C++ type: number, flag or text; None for other types."""
    name = port.type.strip().removeprefix("const ")
    return NUMBER if name in NUMBER_TYPES else FLAG if name == "bool" else TEXT if name in TEXT_TYPES else None


def stores_several(leaf: type[Leaf]) -> bool:
    """Return whether ``as`` stores a mapping with the values of several output ports."""
    return get_origin(leaf.output_type) is Mapping


@dataclass(slots=True)
class StubArgument:
    """An argument of a stub leaf, made from an input port.

    ``kinds`` are the kinds of the values that nodes of the imported trees pass to it, None for an unknown kind.
    """

    port: PortModel
    kinds: list[str | None] = field(default_factory=list)

    @property
    def kind(self) -> str | None:
        """Kind of the argument's values: that of the port's C++ type, or that of all values; None if unknown."""
        declared, used = kind_of_port(self.port), set(self.kinds)
        if declared == TEXT or not used:
            return declared
        if declared is not None:
            return declared if used <= {declared, None} else None
        return used.pop() if len(used) == 1 else None


@dataclass(slots=True)
class StubLeaf:
    """A stub for one leaf of the imported trees: ``id`` is its name there, ``tag`` its name in missions.

    ``arguments`` and ``outputs`` are by port, in the order in which they were found; ``uses`` counts its nodes.
    ``ports`` are all ports, also those that no node uses.
    """

    id: str
    tag: str
    role: str
    arguments: dict[str, StubArgument] = field(default_factory=dict)
    outputs: dict[str, PortModel] = field(default_factory=dict)
    ports: dict[str, PortModel] = field(default_factory=dict)
    uses: int = 0

    def note_argument(self, name: str, port: PortModel, kind: str | None) -> None:
        """Note that a node passes a value of this ``kind`` to the argument ``name``; None for an unknown kind."""
        self.arguments.setdefault(name, StubArgument(port)).kinds.append(kind)

    @property
    def is_instant(self) -> bool:
        """True if the leaf is a condition, which ends at its first tick."""
        return self.role == "Condition"

    @property
    def class_name(self) -> str:
        """Name of the leaf's Python class, made from its ID."""
        words = identifier(self.id)[:MAX_WORD_BYTES].split("_")
        name = "".join(part[:1].upper() + part[1:] for part in words) or "Stub"
        return (
            name if name.isidentifier() and not keyword.iskeyword(name) and name not in PYTHON_NAMES else f"Stub{name}"
        )


PYTHON_NAMES = ("Leaf", "Any", "Status", "Mapping", "argument", "float", "bool", "str")
"""Names that the file with the stub classes uses, so that no class and no argument can have them."""


class StubTable:
    """Stub leaves of an import, by the ID of the leaf in the XML files.

    ``leaf_tags`` are the tags that other leaves have. ``outputs`` has, for each leaf, its output ports that are
    connected to a blackboard entry in any tree. ``ports`` has the ports of each leaf in the trees. ``written`` are the
    tags of stubs of earlier imports that are leaves now.
    """

    def __init__(
        self,
        leaf_tags: Collection[str],
        outputs: Mapping[str, Mapping[str, PortModel]],
        written: Collection[str] = (),
    ) -> None:
        self.written = written
        self._outputs = outputs
        self._taken = {*leaf_tags, *RESERVED_WORDS}
        self.stubs: dict[str, StubLeaf] = {}
        self.ports: dict[str, set[str]] = {}

    def note_ports(self, leaf_id: str, element: Element) -> None:
        """Note the ports that a node of the leaf has, in ``ports``, also if the leaf needs no stub."""
        self.ports.setdefault(leaf_id, set()).update(ports_of(element))

    def stub(self, leaf_id: str, role: str, word: str = "") -> StubLeaf:
        """Return the stub of the leaf with this ID and role, such as "Condition"; the first call creates it.

        Its tag is ``word``, or made from the ID.
        """
        if leaf_id not in self.stubs:
            found = StubLeaf(leaf_id, self._tag(word or leaf_id, role), role)
            found.outputs |= self._outputs.get(leaf_id, {})
            self.stubs[leaf_id] = found
        return self.stubs[leaf_id]

    def _tag(self, leaf_id: str, role: str) -> str:
        word = snake_word(leaf_id, "leaf")
        word = word if word[0].isalpha() else f"leaf_{word}"
        wishes = (word, f"{word}_{role.lower() or 'action'}", *(f"{word}_{number}" for number in range(2, 10_000)))
        tag = next(wish for wish in wishes if wish not in self._taken)
        self._taken.add(tag)
        return tag


def stub_file_text(title: str, stubs: Iterable[StubLeaf], file: str) -> str:
    """Return the text of a Python file with the classes of all stubs.

    ``title`` names the import. ``file`` is the path of the Python file, for the reason with which a stub fails.
    """
    classes, names = list[str](), set[str]()
    for stub in stubs:
        name, number = stub.class_name, 2
        while name in names:
            name, number = f"{stub.class_name}{number}", number + 1
        names.add(name)
        classes.append(_class_text(stub, name, file))
    head = f'"""Stub leaves of {_one_line(title)}: write the ``update`` of each, then remove its line ``stub``."""\n'
    imports = ["from py_trees.common import Status", "", "from behaviours.leaf import Leaf, argument"]
    if any("Mapping[" in text for text in classes):
        imports = ["from collections.abc import Mapping", *(["from typing import Any", ""]), *imports]
    elif any("Any" in text for text in classes):
        imports = ["from typing import Any", "", *imports]
    return head + "\n" + "\n".join(imports) + "\n\n\n" + "\n\n\n".join(classes) + "\n"


def _class_text(stub: StubLeaf, name: str, file: str) -> str:
    lines = [
        f"class {name}(Leaf):",
        f'    """Stub of the {stub.role.lower() or "leaf"} {_one_line(stub.id)}."""',
        "",
        f'    tag = "{stub.tag}"',
        f"    stub = {_python_text(f'write its update in {file}')}",
    ]
    if stub.is_instant:
        lines.append("    instant = True")
    if stub.outputs:
        helps = [port.help or output for output, port in stub.outputs.items()]
        lines.append(f"    output_doc = {_python_text('; '.join(map(_one_line, helps)))}")
        lines.append(f"    output_type = {_output_type(stub)}")
    lines += _node_model_lines(stub)
    attributes = set[str]()
    lines += [_argument_line(each, argument, stub, attributes) for each, argument in stub.arguments.items()]
    lines += [
        "",
        "    def update(self) -> Status:",
        "        return self.fail(f\"'{self.tag}' is a stub: {self.stub}\")",
    ]
    return "\n".join(lines)


def _node_model_lines(stub: StubLeaf) -> list[str]:
    """Return the lines of the attribute ``node_model``; of the output ports, those that nodes use come first."""
    source = SourceText("", "")
    model = Element(stub.role or "Action", {"ID": stub.id}, source, 1)
    is_unused = {name: port.direction != "in" and name not in stub.outputs for name, port in stub.ports.items()}
    for name in sorted(stub.ports, key=is_unused.__getitem__):
        port = stub.ports[name]
        tag = next(tag for tag, direction in DIRECTIONS.items() if direction == port.direction)
        found = {"name": name, "type": port.type, "default": port.default}
        attributes = {key: value for key, value in found.items() if value or (key == "default" and value is not None)}
        model.children.append(Element(tag, attributes, source, 1, text=" ".join(port.help.split())))
    # Nothing in the XML may end the Python text around it.
    text = "\n".join(element_lines(model, 2)).replace("\\", "&#92;").replace('"""', "&quot;" * 3)
    return f'    node_model = """\n{text}"""'.split("\n")


PYTHON_TYPES = {NUMBER: "float", FLAG: "bool", TEXT: "str"}
ARGUMENT_KINDS = {NUMBER: "number", FLAG: "flag", TEXT: "text", None: "value"}


def _output_type(stub: StubLeaf) -> str:
    if len(stub.outputs) > 1:
        return "Mapping[str, Any]"
    return PYTHON_TYPES.get(kind_of_port(next(iter(stub.outputs.values()))) or "", "None")


def _argument_line(name: str, argument: StubArgument, stub: StubLeaf, taken: set[str]) -> str:
    """Return the line of an argument in the class of a stub; ``taken`` are the attributes of the lines before it."""
    attribute = identifier(name)
    if not attribute.isidentifier() or attribute.startswith("_"):
        attribute = f"port_{attribute.lstrip('_')}"
    while attribute in RESERVED_ATTRIBUTES or attribute in taken:
        attribute += "_"
    taken.add(attribute)
    options = "" if attribute == name else f", name={_python_text(name)}"
    required = argument.port.default is None and len(argument.kinds) == stub.uses
    if not required:
        options += f", default={_python_default(argument)}"
    python = PYTHON_TYPES.get(argument.kind or "", "Any")
    python += " | None" if not required and python != "Any" and options.endswith("None") else ""
    help_text = _one_line(argument.port.help) or f"port {_one_line(name)}"
    return (
        f'    {attribute}: {python} = argument("{ARGUMENT_KINDS[argument.kind]}", {_python_text(help_text)}{options})'
    )


RESERVED_ATTRIBUTES = frozenset(
    {*keyword.kwlist, *dir(Leaf), *PYTHON_NAMES}
    | {"name", "parent", "children", "status", "logger", "run", "robot", "scope", "reason", "key", "label"}
)
"""Names that an argument cannot have in Python: those of every leaf object, and those that the file itself uses."""


def _python_default(argument: StubArgument) -> str:
    text = argument.port.default
    if text is None:
        return "None"
    if argument.kind == NUMBER:
        value = plain_value(text.strip())
        return repr(value) if isinstance(value, int | float) and not isinstance(value, bool) else "None"
    if argument.kind == FLAG:
        return {"true": "True", "1": "True", "false": "False", "0": "False"}.get(text.strip().lower(), "None")
    return _python_text(text)


def _python_text(text: str) -> str:
    """Return a text as a Python literal in double quotes, without line breaks."""
    return json.dumps(text, ensure_ascii=False)


def _one_line(text: str) -> str:
    """Return a text as one line of at most 100 characters without quotes and backslashes, for a docstring."""
    plain = " ".join(text.split()).replace("\\", "/").replace('"', "'")
    return textwrap.shorten(plain, 100, placeholder="...") if plain else ""
