"""``for_each``: a behaviour done once for each member of a list."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence

from config.faults import one_of
from config.marked import Listing, Mapping, Node, Scalar
from config.units import article, seen
from drivers.api.quick import dataclass
from missions.language.arguments import default_value
from missions.language.counts import written_entries
from missions.language.expressions import UNREAD, Value, shown
from missions.language.modifiers import outdent, read_expression
from missions.language.nodes import AT_ONCE, FOR_EACH, MISSION
from missions.language.notes import Notes
from missions.language.operators import described
from missions.language.param_types import kind_of, list_members
from missions.language.plan import Hole, Step

KEYS = ("in", "as", "number", "do")
FORM = 'write for_each: {in: places, as: place, do: {go_to: "${place}"}}'


@dataclass(frozen=True, slots=True)
class Members:
    """The members of a list, as a for_each goes through them."""

    values: tuple[object, ...]

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.values)

    def member(self, place: int) -> object:
        """Return the member at a place, from 0."""
        return self.values[place]

    def number(self, place: int) -> object:
        """Return the number of the member at a place, from 1."""
        return place + 1


def read_for_each(
    notes: Notes, key: Scalar, value: Node | None, name: str, read_step: Callable[[Notes, Node], Step]
) -> Step | None:
    """Read a for_each."""
    if not isinstance(value, Mapping):
        notes.fault(key.mark, f"'{FOR_EACH}' needs 'in', 'as' and 'do'", FORM)
        return None
    for word, _ in value.entries:
        if word.text not in KEYS:
            hint = outdent(word.text, FOR_EACH) or one_of(word.text, KEYS)
            notes.fault(word.mark, f"'{FOR_EACH}' has no key '{word.text}'", hint)
    for needed in ("in", "as", "do"):
        if value.get(needed) is None:
            notes.fault(key.mark, f"'{FOR_EACH}' needs '{needed}'", FORM)
    binds = tuple(filter(None, (_name(notes, value, which) for which in ("as", "number"))))
    if len(set(binds)) < len(binds):
        notes.fault(value.mark, f"'as' and 'number' cannot both be '{binds[0]}'")
    among, do = value.get("in"), value.get("do")
    members = UNREAD if among is None else _members(notes, among)
    child = None if do is None else read_step(notes, do)
    if child is None or among is None:
        return None
    said = {word: text for word, text in written_entries(value).items() if word != "do"}
    mark, source = key.mark, notes.source
    return Step(FOR_EACH, name, mark, source, (child,), arguments={"in": members}, binds=binds, written=said)


def _name(notes: Notes, value: Mapping, word: str) -> str:
    """Return the variable that a key names; nothing where there is none."""
    node = value.get(word)
    if node is None:
        return ""
    if not isinstance(node, Scalar) or node.value is None:
        notes.fault(node.mark, f"'{word}' needs a word", "such as 'place'")
        return ""
    notes.new_name(node, f"'{word}'")
    return node.text


def _members(notes: Notes, node: Node) -> Value:
    if isinstance(node, Scalar):
        if node.value is None:
            notes.fault(node.mark, "'in' needs a list", FORM)
            return UNREAD
        return read_expression(notes, "'in'", node, as_members)
    if isinstance(node, Mapping):
        notes.fault(node.mark, "'in' needs a list, not a mapping", FORM)
        return UNREAD
    return _listed(notes, node)


def _listed(notes: Notes, node: Listing) -> Value:
    try:
        found = list_members(node, default_value)
    except ValueError as error:
        notes.fault(node.mark, f"'in' {error}")
        return UNREAD
    for item, member in zip(node.items, found, strict=True):
        first, kind = kind_of(found[0]), kind_of(member)
        if kind != first:
            both = f"{article(first)} and {article(kind)}, {seen(shown(member))}"
            notes.fault(item.mark, f"'in' needs members of one type, got {both}")
            break
    return Value(as_members(found))


def as_members(value: object) -> Members:
    """Return the members of a list. Raises ValueError for anything else."""
    if isinstance(value, list | tuple):
        return Members(tuple(value))
    raise ValueError(f"needs a list, got {described(value)}")


def check_names(notes: Notes, tree: Step) -> None:
    """Note what gives another value to a name that a for_each is using: something it does, or something beside it."""
    for step in tree.walk():
        if step.kind == FOR_EACH:
            (below,) = step.children
            for name in below.names.intersection(step.binds):
                _note(notes, below, name, [step])
        elif step.kind in AT_ONCE:
            for child, name, loops in _beside(step.children):
                _note(notes, child, name, loops)


def _beside(children: Sequence[Step]) -> Iterator[tuple[Step, str, Iterator[Step]]]:
    """Yield each child with each name that it sets, and with the loops of other children that use this name."""
    setters = Counter(name for child in children for name in child.names)
    shared = {name for name, count in setters.items() if count > 1}
    users: dict[str, list[tuple[Step, Step]]] = defaultdict(list)
    for child in children if shared else ():
        for loop in own_steps(child):
            for name in shared.intersection(loop.binds) if loop.kind == FOR_EACH else ():
                users[name].append((child, loop))
    for child in children if users else ():
        for name in child.names & users.keys():
            yield child, name, (loop for user, loop in users[name] if user is not child)


def _note(notes: Notes, steps: Step, name: str, loops: Iterable[Step]) -> None:
    """Note each step among ``steps`` that sets the ``name`` of these loops; what a hole may set is not known."""
    for loop in loops:
        for step in own_steps(steps):
            if name in step.own_names and step.leaf is not Hole:
                where = f"for_each (line {loop.mark.line}) is using"
                notes.fault_at(
                    step, f"'{step.kind}' gives another value to '{name}', which {where}", "take another name"
                )


def own_steps(step: Step) -> Iterator[Step]:
    """Yield a step and all below it that have the same variables: those inside a sub-mission have their own."""
    waiting = [step]
    while waiting:
        found = waiting.pop()
        yield found
        if found.kind != MISSION:
            waiting.extend(reversed(found.children))
