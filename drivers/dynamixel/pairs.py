"""Two servos on one joint, which would work against each other: recognised by the names of their joints."""

from collections.abc import Collection, Iterator

from drivers.api.keys import Mistake

SECOND = frozenset({"mimic", "shadow", "slave", "twin", "mirror", "dual", "secondary"})
"""Words that say of a joint that it is another one's second servo: `shoulder_mimic`, as in files of ROS."""


def second_servos(joints: Collection[str]) -> Iterator[Mistake]:
    """Yield the joints of an arm that are the second servos of others by their names."""
    for name in joints:
        words = name.split("_")
        for token in SECOND & {word.lower() for word in words}:
            first = "_".join(word for word in words if word.lower() != token)
            if first in joints:
                message = f"joints '{first}' and '{name}' seem to be two servos on one joint, which are not driven here"
                hint = f"one would work against the other; if they are two joints, call one without '{token}'"
                about = (("joints", name), ("joints", first))
                yield Mistake(message, ("joints", name), named=True, hint=hint, about=about)
