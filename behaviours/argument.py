"""The arguments of a leaf, declared once, in its class: for the checker, the catalogue, the schema and the docs."""

import math
from typing import Any

from drivers.api.quick import dataclass

REQUIRED: Any = object()
"""The default of an argument that must be given."""


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument of a leaf.

    ``kind`` is a dimension ("angle", "length", "duration", ...), "text", "number", "count", "flag", "value" (anything),
    "outcomes" (a list of statuses), "joint" (a name), "joints" (a joint, a group of them, or a list of both), or
    "gesture", "move", "gait", "controller" or "object" (looked up by name), "new move" (the name of what is to be
    recorded), "file" (a path from the mission's folder), "face" (a variable that holds one, or nothing), "phrases"
    (what may be said: one text, or a list of them, known before the mission starts), "choice" (one of the words in
    ``choices``), or a kind of part of which a robot may have several, "head" or "arm": its name, and the leaf sees that
    one as its robot's only one.
    ``span`` asks for two values, [low, high]; ``by_joint`` for one value for each of some joints, {elbow: 30 deg}.
    ``low`` and ``high`` are bounds in SI units. The ``principal`` one may be written without its name.
    ``attribute`` is the leaf's attribute that holds the value.
    """

    name: str
    kind: str
    help: str
    default: Any = REQUIRED
    principal: bool = False
    span: bool = False
    low: float = -math.inf
    high: float = math.inf
    by_joint: bool = False
    choices: tuple[str, ...] = ()
    attribute: str = ""

    @property
    def required(self) -> bool:
        """True when a mission must give it."""
        return self.default is REQUIRED


def argument(kind: str, help: str, *, called: str = "", **options: Any) -> Any:  # noqa: A002 - as argparse and click
    """Declare an argument of a leaf, as a class attribute.

    ``speed: float = argument("speed", "how fast", default=0.2)``. When the leaf starts, the attribute holds the value:
    SI floats for quantities, a pair of them for a span, a mapping for values by joint, a tuple of names for joints, and
    for phrases a mapping from how each is listened for to how it is written.
    ``called`` is its name in missions where that cannot be the attribute's, as ``name``, which every node has.
    """
    return Argument(name=called, kind=kind, help=help, **options)
