"""Objects that a mission looks for: constants, and all possible values of expressions."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import product

from missions.language.check_context import CheckContext
from missions.language.expressions import Value
from missions.language.for_each import ListMembers
from missions.language.plan import PlaceholderLeaf, Step
from perception.api import ThingSpec

OBJECT_KIND = "object"
"""Kind of an argument that names an object for the camera to find, such as "red ball"."""

MAX_COMBINATIONS = 2000
"""Maximum combinations of texts tried for one expression; with more, its value is unknown."""


MAX_FILLED = 20_000
"""Maximum combinations of texts tried for all expressions of a mission, whose results are new texts to try."""


def objects_to_find(tree: Step) -> tuple[ThingSpec, ...]:
    """Return the objects that a mission may look for, each once; the object detector needs them before the run."""
    texts: list[str] | None = None
    found: dict[ThingSpec, None] = {}
    for step in tree.walk():
        for value in _object_values(step):
            if value.template is not None:
                texts = _texts(tree) if texts is None else texts
                found |= dict.fromkeys(_possible_objects(value, texts))
            elif isinstance(value.constant, ThingSpec):
                found[value.constant] = None
    return tuple(found)


def check_objects(context: CheckContext, tree: Step) -> None:
    """Report each object argument whose possible values are unknown."""
    texts: list[str] | None = None
    for step in () if context.missing_params else tree.walk():
        for value in _object_values(step):
            if value.template is None or not value.template.reads or any(read.member for read in value.template.reads):
                continue  # the values of members, such as the name of an object, are unknown
            texts = _texts(tree) if texts is None else texts
            if next(_possible_objects(value, texts), None) is None:
                hint = "name it in a param, in the list of a for_each, or by 'set', or listen for its name"
                context.fault_at(
                    step, f"'{step.kind}': what it looks for must be known before the mission starts", hint
                )


def _object_values(step: Step) -> Iterator[Value]:
    declared = {} if step.leaf is None or step.leaf is PlaceholderLeaf else step.leaf.arguments
    return (value for name, value in step.arguments.items() if name in declared and declared[name].kind == OBJECT_KIND)


def _possible_objects(value: Value, texts: list[str]) -> Iterator[ThingSpec]:
    """Yield the objects that ``value`` can name, if each variable in its template can have any of the ``texts``."""
    for text in _fill_template(value, texts):
        try:
            wanted = text if value.convert is None else value.convert(text)
        except (ValueError, LookupError):  # not an object
            continue
        if isinstance(wanted, ThingSpec):
            yield wanted


def _fill_template(value: Value, texts: list[str]) -> Iterator[object]:
    """Yield all results of the template of ``value``, if each variable in it can have any of the ``texts``."""
    template = value.template
    names = () if template is None else tuple(dict.fromkeys(read.name for read in template.reads))
    if template is not None and len(texts) ** len(names) <= MAX_COMBINATIONS:
        for values in product(texts, repeat=len(names)):
            with suppress(ValueError):  # a text of the wrong form
                yield template.evaluate(dict(zip(names, values, strict=True)))


def _texts(tree: Step) -> list[str]:
    """Return all texts that a variable of a mission can have: constants, and results of templates with them."""
    values = [value for step in tree.walk() for value in step.arguments.values()]
    found = dict.fromkeys(text for value in values for text in _texts_within(value.constant))
    remaining = MAX_FILLED
    for value in values:
        if value.template is not None and value.template.reads and len(found) <= min(remaining, MAX_COMBINATIONS):
            tried = [*_fill_template(value, [*found])]
            remaining -= len(tried)
            found |= dict.fromkeys(each for each in tried if isinstance(each, str))
    return [*found]


def _texts_within(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, ListMembers):
        yield from _texts_within(value.values)
    elif isinstance(value, dict):
        yield from _texts_within(tuple(value.values()))
    elif isinstance(value, list | tuple):
        for member in value:
            yield from _texts_within(member)
