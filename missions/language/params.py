"""A mission's params: their names, types and defaults, and the values that a caller gives them."""

from collections import defaultdict
from collections.abc import Iterator
from collections.abc import Mapping as Named

from behaviours.leaf import REQUIRED, Leaf
from config.faults import Diagnostic, Mark, Source, note, one_of
from config.marked import Listing, Mapping, Node, Scalar
from config.units import article, seen
from drivers.api.quick import dataclass
from missions.language.counts import COUNTS
from missions.language.nodes import BRANCHES, FOR_EACH, MISSION, MODIFIERS, SWITCHES
from missions.language.notes import Notes
from missions.language.param_types import WRONG, ParamType, declared, inferred

# What sets the variables of a mission: read before its steps, since an expression may stand above what sets it.

KNOWN = {*BRANCHES, *MODIFIERS, *COUNTS, "name", "with"}
"""The words besides those of leaves and ``as`` that mean something beside a behaviour."""

Leaves = Named[str, type[Leaf]]


def setters(node: Node, leaves: Leaves) -> dict[str, list[type[Leaf] | None]]:
    """Return the variables that anything below ``node`` sets, each with the leaves that ``as`` keeps something of.

    None stands for what may be anything: ``returns``, a leaf such as ``set``, or ``as`` beside a mission.
    """
    found = defaultdict(list)
    for name, leaf in _pairs(node, leaves):
        found[name].append(leaf)
    return dict(found)


def of_one_kind(found: Named[str, list[type[Leaf] | None]]) -> dict[str, type[Leaf]]:
    """Return the variables into which leaves alone put something, and all of them of one type; each with a leaf."""
    kinds = {name: {None if leaf is None else leaf.keeps for leaf in leaves} for name, leaves in found.items()}
    one = [name for name, types in kinds.items() if len(types) == 1 and None not in types]
    return {name: leaf for name in one if (leaf := found[name][0]) is not None}


def _pairs(node: Node, leaves: Leaves) -> Iterator[tuple[str, type[Leaf] | None]]:
    if isinstance(node, Listing):
        for item in node.items:
            yield from _pairs(item, leaves)
    elif isinstance(node, Mapping):
        for key, value in node.entries:
            yield from _beside(node, key.text, value, leaves)


def _beside(node: Mapping, word: str, value: Node, leaves: Leaves) -> Iterator[tuple[str, type[Leaf] | None]]:
    """Yield what one key of a node sets, or what is below it."""
    leaf = leaves.get(word)
    if word == "as" and isinstance(value, Scalar):
        yield value.text, next((leaves[key.text] for key, _ in node.entries if key.text in leaves), None)
    elif isinstance(value, Mapping) and ((leaf is not None and leaf.open_ended) or _is_returns(node, word)):
        yield from ((name.text, None) for name, _ in value.entries)
    elif word == FOR_EACH and isinstance(value, Mapping):
        names = (value.get("as"), value.get("number"))
        yield from ((name.text, None) for name in names if isinstance(name, Scalar))
        do = value.get("do")
        yield from () if do is None else _pairs(do, leaves)
    elif word in SWITCHES and isinstance(value, Mapping):
        cases = value.get("cases")
        branches = [case for _, case in cases.entries] if isinstance(cases, Mapping) else []
        for branch in (*branches, value.get("default")):
            if branch is not None:
                yield from _pairs(branch, leaves)
    elif isinstance(value, Listing):
        yield from _pairs(value, leaves)
    elif isinstance(value, Mapping) and leaf is None and word not in KNOWN:
        # A word that nobody knows: it may be meant for one that sets what is written below it.
        yield from ((name.text, None) for name, _ in value.entries)
        yield from _pairs(value, leaves)
    elif isinstance(value, Scalar) and leaf is None and value.text.isidentifier() and word not in KNOWN:
        yield value.text, None


def _is_returns(beside: Mapping, key: str) -> bool:
    return key == "returns" and beside.get(MISSION) is not None


KEYS = ("default", "type", "of", "choices", "help", "low", "high")
"""The keys of a param in its long form."""


@dataclass(frozen=True, slots=True)
class Param:
    """One param: an argument of the mission. ``default`` is REQUIRED for one that the caller must give, or WRONG."""

    name: str
    default: object
    help: str
    type: ParamType

    @property
    def kind(self) -> str:
        """The word for its type."""
        return self.type.kind

    @property
    def required(self) -> bool:
        """True when the caller must give it."""
        return self.default is REQUIRED

    @property
    def known(self) -> bool:
        """True when it has a value even where the caller gives none."""
        return self.default not in (REQUIRED, WRONG)

    def take(self, text: str) -> object:
        """Read a value from a command line. Raises ValueError that says what was expected."""
        return self.type.take(text)


def read_params(notes: Notes, node: Node | None) -> dict[str, Param]:
    """Read the ``params`` of a mission: ``name: default``, or ``name: {default, type, help, low, high}``."""
    if node is not None and not isinstance(node, Mapping):
        notes.fault(node.mark, "'params' needs names and their defaults", "write 'patience: 60 s' under it")
    found: dict[str, Param] = {}
    for key, value in node.entries if isinstance(node, Mapping) else ():
        notes.new_name(key, "a param")
        param = _long(notes, key.text, value) if isinstance(value, Mapping) else _short(notes, key.text, value)
        if param is None:  # noted: what it holds is not known
            notes.stored.add(key.text)
            notes.awaited.add(key.text)
        else:
            found[key.text] = param
    return found


def _short(notes: Notes, name: str, value: Node) -> Param | None:
    found = inferred(notes, name, value)
    return None if found is None else Param(name, found.default(notes, value, f"param '{name}'"), "", found)


def _long(notes: Notes, name: str, node: Mapping) -> Param | None:
    what = f"param '{name}'"
    for key, _ in node.entries:
        if key.text not in KEYS:
            notes.fault(key.mark, f"{what} has no key '{key.text}'", one_of(key.text, KEYS))
    found, given, text = declared(notes, name, node), node.get("default"), node.get("help")
    if found is None:
        return None
    default = REQUIRED if given is None else found.default(notes, given, what)
    return Param(name, default, text.text if isinstance(text, Scalar) else "", found)


def take_params(
    notes: Notes, params: Named[str, Param], given: Named[str, str], mission: str, *, complete: bool
) -> None:
    """Put the caller's values in the place of the defaults; where ``complete``, note what is still missing."""
    for name, param in params.items():
        if param.known:
            notes.params[name] = param.default
        elif name not in given:
            notes.stored.add(name)
            notes.awaited.add(name)
            notes.kinds[name] = param.type.values
            if complete and param.required:
                source = Source("--param", "")
                hint = f'--param {name}="..."' + (f"  ({param.help})" if param.help else "")
                message = f"mission '{mission}' needs '{name}', {article(param.kind)}"
                note(notes.faults, Diagnostic(source, Mark(), message, hint))
    for name, text in given.items():
        source = Source(f"--param {name}", f"{name}={text}")
        if name not in params and name in notes.awaited:
            continue
        if name not in params:
            hint = one_of(name, params) or "it has none"
            message = f"mission '{mission}' has no param {seen(name)}"
            note(notes.faults, Diagnostic(source, Mark(1, 1, len(name)), message, hint))
            continue
        try:
            notes.params[name] = params[name].take(text)
        except (ValueError, LookupError) as error:
            message = f"'{name}' {error.args[0] if error.args else error}"
            note(notes.faults, Diagnostic(source, Mark(1, len(name) + 2, max(1, len(text))), message))
