"""The ``identity`` section of a robot file's camera: how people are recognised, and where their pictures are."""

from dataclasses import dataclass
from typing import Literal

from config.fields import Fields

Method = Literal["fisher", "sface"]
"""With what ships with OpenCV, or with a network whose file the user gives."""


@dataclass(frozen=True, slots=True)
class IdentityConfig:
    """``people`` is the folder of their pictures, empty for that of the user; ``model`` the file of SFace."""

    people: str = ""
    method: Method = "fisher"
    model: str = ""


def read_identity(fields: Fields | None) -> IdentityConfig:
    """Read the section; without one, people are recognised as they are by default."""
    if fields is None:
        return IdentityConfig()
    methods: list[Method] = ["fisher", "sface"]
    identity = IdentityConfig(
        people=fields.text("people", ""),
        method=fields.choice("method", methods, "fisher"),
        model=fields.text("model", ""),
    )
    node = fields.node_of("method")
    if identity.method == "sface" and not identity.model and node is not None:
        fields.fault(node.mark, "'sface' needs 'model', the file of its network", "model: ~/sface.onnx")
    fields.done()
    return identity
