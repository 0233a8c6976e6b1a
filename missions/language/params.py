"""A mission's params: their names, types and defaults, and the values that a caller gives them."""

from collections.abc import Mapping as Named

from behaviours.leaf import REQUIRED
from config.faults import Diagnostic, Mark, Source, note, one_of
from config.marked import Mapping, Node, Scalar
from config.units import article, seen
from drivers.api.quick import dataclass
from missions.language.notes import Notes
from missions.language.param_types import WRONG, ParamType, declared, inferred

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
