"""``for_each``: a behaviour that runs once for each member of a list."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence

from config.diagnostics import suggest_from
from config.yaml_nodes import Mapping, Node, Scalar
from drivers.api.fast_dataclass import dataclass
from missions.language.check_context import CheckContext
from missions.language.expressions import INVALID_VALUE, Value
from missions.language.lists import common_type, untyped_members
from missions.language.modifiers import outdent_hint, read_expression
from missions.language.nodes import AT_ONCE, FOR_EACH, MISSION
from missions.language.operators import describe_value
from missions.language.parallel_counts import entries_as_written
from missions.language.plan import PlaceholderLeaf, Step

FOR_EACH_KEYS = ("in", "as", "number", "do")
FOR_EACH_EXAMPLE = 'write for_each: {in: places, as: place, do: {go_to: "${place}"}}'


@dataclass(frozen=True, slots=True)
class ListMembers:
    """Members of the list over which a ``for_each`` loops."""

    values: tuple[object, ...]

    def __hash__(self) -> int:
        return len(self.values)  # a member may be a mapping, which has no hash

    @property
    def count(self) -> int:
        """Number of members of the list."""
        return len(self.values)

    def member(self, place: int) -> object:
        """Return the member of the list at index ``place``, from 0."""
        return self.values[place]

    def number(self, place: int) -> object:
        """Return the number of the list's member at index ``place``: numbers count from 1, indices from 0."""
        return place + 1


def read_for_each(
    context: CheckContext, key: Scalar, value: Node | None, name: str, read_step: Callable[[CheckContext, Node], Step]
) -> Step | None:
    """Return the step of a ``for_each``; None if it has errors."""
    if not isinstance(value, Mapping):
        context.fault(key.mark, f"'{FOR_EACH}' needs 'in', 'as' and 'do'", FOR_EACH_EXAMPLE)
        return None
    for word, _ in value.entries:
        if word.text not in FOR_EACH_KEYS:
            hint = outdent_hint(word.text, FOR_EACH) or suggest_from(word.text, FOR_EACH_KEYS)
            context.fault(word.mark, f"'{FOR_EACH}' has no key '{word.text}'", hint)
    for needed in ("in", "as", "do"):
        if value.get(needed) is None:
            context.fault(key.mark, f"'{FOR_EACH}' needs '{needed}'", FOR_EACH_EXAMPLE)
    binds = tuple(filter(None, (_name(context, value, which) for which in ("as", "number"))))
    if len(set(binds)) < len(binds):
        context.fault(value.mark, f"'as' and 'number' cannot both be '{binds[0]}'")
    among, do = value.get("in"), value.get("do")
    members = INVALID_VALUE if among is None else _members(context, among)
    child = None if do is None else read_step(context, do)
    if child is None or among is None:
        return None
    written = {word: text for word, text in entries_as_written(value).items() if word != "do"}
    mark, source = key.mark, context.source
    return Step(
        FOR_EACH, name, mark, source, (child,), arguments={"in": members}, binds=binds, arguments_as_written=written
    )


def _name(context: CheckContext, value: Mapping, word: str) -> str:
    """Return the variable name under the key ``word`` of a ``for_each``; empty if it is missing or invalid."""
    node = value.get(word)
    if node is None:
        return ""
    if not isinstance(node, Scalar) or node.value is None:
        context.fault(node.mark, f"'{word}' needs a word", "such as 'place'")
        return ""
    context.check_new_name(node, f"'{word}'")
    return node.text


def _members(context: CheckContext, node: Node) -> Value:
    if isinstance(node, Scalar):
        if node.value is None:
            context.fault(node.mark, "'in' needs a list", FOR_EACH_EXAMPLE)
            return INVALID_VALUE
        return read_expression(context, "'in'", node, as_members)
    if isinstance(node, Mapping):
        context.fault(node.mark, "'in' needs a list, not a mapping", FOR_EACH_EXAMPLE)
        return INVALID_VALUE
    if node.items and common_type(context, "'in'", node) is None:
        return INVALID_VALUE
    return Value(as_members(untyped_members(node)))


def as_members(value: object) -> ListMembers:
    """Return the members of a list. Raises ValueError for any other value."""
    if isinstance(value, list | tuple):
        return ListMembers(tuple(value))
    raise ValueError(f"needs a list, got {describe_value(value)}")


def check_loop_names(context: CheckContext, tree: Step) -> None:
    """Report each step that sets a loop variable of a for_each, if it is inside this for_each or parallel to it."""
    for step in tree.walk():
        if step.kind == FOR_EACH:
            (below,) = step.children
            for name in below.variables.intersection(step.binds):
                _report_conflict(context, below, name, [step])
        elif step.kind in AT_ONCE:
            for child, name, loops in _parallel_conflicts(step.children):
                _report_conflict(context, child, name, loops)


def _parallel_conflicts(children: Sequence[Step]) -> Iterator[tuple[Step, str, Iterator[Step]]]:
    """Yield each child of a parallel with each variable that it sets and another child's for_each uses.

    The third item yields these for_each steps.
    """
    setters = Counter(name for child in children for name in child.variables)
    shared = {name for name, count in setters.items() if count > 1}
    users: dict[str, list[tuple[Step, Step]]] = defaultdict(list)
    for child in children if shared else ():
        for loop in steps_in_scope(child):
            for name in shared.intersection(loop.binds) if loop.kind == FOR_EACH else ():
                users[name].append((child, loop))
    for child in children if users else ():
        for name in child.variables & users.keys():
            yield child, name, (loop for user, loop in users[name] if user is not child)


def _report_conflict(context: CheckContext, steps: Step, name: str, loops: Iterable[Step]) -> None:
    """Report each step in ``steps`` that sets the variable ``name``, which the for_each steps in ``loops`` use.

    Steps that could not be read are skipped.
    """
    for loop in loops:
        for step in steps_in_scope(steps):
            if name in step.direct_variables and step.leaf is not PlaceholderLeaf:
                where = f"for_each (line {loop.mark.line}) is using"
                context.fault_at(step, f"'{step.kind}' sets '{name}', which {where}", "use another name")


def steps_in_scope(step: Step) -> Iterator[Step]:
    """Yield ``step`` and all steps below it that share its variables, so none inside a sub-mission."""
    waiting = [step]
    while waiting:
        found = waiting.pop()
        yield found
        if found.kind != MISSION:
            waiting.extend(reversed(found.children))
