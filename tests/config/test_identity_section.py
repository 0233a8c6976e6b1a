"""The identity section of a camera, and strangers in a world."""

import pytest

from config.diagnostics import InvalidFileError, SourceText
from config.world import parse_world
from drivers.api.sensor_sections import CameraKeys, IdentityKeys
from missions.library.drivers import parse_robot


def camera(identity: str) -> CameraKeys:
    found = parse_robot(SourceText("r.yaml", f"robot: r\ncamera:\n  source: 0\n{identity}")).camera
    assert found is not None
    return found


def test_people_are_recognised_without_a_section() -> None:
    assert camera("").identity == IdentityKeys(people="", method="patches", model="")


def test_folder_method_and_model_are_read() -> None:
    found = camera("  identity: {people: ~/them, method: sface, model: ~/sface.onnx}\n").identity
    assert found == IdentityKeys(people="~/them", method="sface", model="~/sface.onnx")
    assert camera("  identity: {method: dlib}\n").identity == IdentityKeys(people="", method="dlib", model="")


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ("{method: sface}", "'sface' needs 'model'"),
        ("{method: eigen}", "'method' cannot be 'eigen'"),
        ("{poeple: here}", "no key 'poeple'"),
    ],
)
def test_mistakes_are_shown(section: str, said: str) -> None:
    with pytest.raises(InvalidFileError, match=said):
        camera(f"  identity: {section}\n")


def test_people_are_known_by_default() -> None:
    text = "world: w\npeople:\n  - {name: Anna, at: [1.5 m, 0 m]}\n  - {name: Zoe, at: [2.5 m, 1 m], known: false}\n"
    assert [person.known for person in parse_world(SourceText("w.yaml", text)).people] == [True, False]
