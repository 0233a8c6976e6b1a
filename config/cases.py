"""Keys of a mission's test file: runs, their conditions, and their expectations."""

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from drivers.api import Mood
from drivers.api.keys import inside, key, keys

CASE_TIMEOUT = 120.0
"""Default timeout of a test case in seconds of simulated time."""

DISTANCE_TOLERANCE = 0.1
"""Default tolerance in metres of the base's position that a test case expects."""

GIVEN_HINT = "write 'gesture: fails twice' for a mock, or 'camera frozen from 5 s to 8 s'"
SCRIPT_HINT = "such as 'fails twice, then succeeds', in quotes within { }"

Eyes = Literal["pixels", "truth"]
Result = Literal["success", "failure", "error", "interrupted", "running"]
Texts = str | tuple[str, ...]
Count = Annotated[int, inside(low=0, wrong="how often '{}' has to start needs a whole number")]


@keys
class MockTurnKeys:
    """Keys of one entry of the list ``then`` of a mock: the outcome of one of the mock's later starts."""

    does: str = key(default="", help="Outcomes of the mock; `succeeds` if only a `result` is given.")
    result: object = key(
        default=None, help="Output: the value that `as` stores, the results of a mission, or a phrase."
    )


@keys
class MockKeys(MockTurnKeys):
    """Keys of a mock of a leaf in a test file, if the mock has a result."""

    then: object = key(default=None, help="Results of the later starts, one after another; the last one is repeated.")


Script = Annotated[str, inside(wrong="what '{}' does instead is missing", hint=SCRIPT_HINT)]
Mock = Mapping[str, Script | Annotated[MockKeys, inside(each="a mock")]]
Given = Annotated[str | Mock, inside(wrong="neither a mock nor something that goes wrong", hint=GIVEN_HINT)]
"""Entry of ``given`` in a test file: a fault of a device as text, or a mock of a leaf."""


@keys
class PoseKeys:
    """Keys of the base's pose that a test case expects."""

    near: tuple[float, float] = key(
        "length",
        wrong="'{}' needs a place, such as [1 m, 0 m]",
        help="Position in the world: [x, y]; `base.x` is from the start.",
    )
    within: float = key("length", default=DISTANCE_TOLERANCE, low=0.0, help="Maximum distance from it.")
    heading: str = key(default="", help="Heading: `90 deg`, or `90 deg +- 5 deg`; the default tolerance is 10 deg.")


@keys
class ExpectKeys:
    """Keys of the section ``expect`` of a test case."""

    result: Result | None = key(
        default=None, help="Result of the run; `running` if it still goes on after the `timeout` of the case."
    )
    reason: str | None = key(default=None, help="Text that the reason contains.")
    within: float | None = key("duration", default=None, low=0.0, help="Maximum duration.")
    after: float | None = key("duration", default=None, low=0.0, help="Minimum duration.")
    said: Texts = key(default=(), help="Texts that were said, in this order; `[]` for none.")
    never_said: Texts = key(default=(), help="Texts that were not said.")
    heard_by: Mapping[str, Texts] = key(
        default={},
        wrong="'{}' needs people and what they hear",
        hint="such as {Anna: [hello], Ben: []}",
        help="Texts that each person heard, in this order: `{Anna: [message], Ben: []}`; `[]` for none.",
    )
    showed: Texts = key(
        default=(),
        blank=True,
        help='Texts on the screen, in this order; `[]` for none, `""` for a cleared text.',
    )
    moods: Texts = key(default=(), among=[*Mood], help="Moods on the screen, in this order; `[]` for none.")
    notified: Texts = key(default=(), help="Texts of `notify`, in this order; `[]` for none.")
    ran: Texts | Mapping[str, Count] = key(
        default=(), help="Nodes that ran, optionally with the number of starts: `{gesture: 2}`."
    )
    never_ran: Texts = key(default=(), help="Nodes that did not run.")
    succeeded: Texts = key(default=(), help="Nodes that succeeded at least once.")
    failed: Texts = key(default=(), help="Nodes that failed at least once.")
    order: Texts = key(default=(), help="Events in this order, with any others in between.")
    faults: Texts = key(default=(), help="A text for each notice of the robot's parts; `[]` for none.")
    reflexes: Texts = key(default=(), help="Reflexes that fired, such as `bumper` or `bumper left`; `[]` for none.")
    base: Literal["stopped"] | None = key(default=None, help="The base stands still at the end, or was told to stop.")
    pose: PoseKeys | None = key(default=None, help="True pose of the base at the end.")
    joints: Mapping[str, str] = key(
        default={},
        wrong="'{}' needs joints and their angles",
        hint="such as {elbow: 30 deg +- 5 deg}",
        help="True angles of joints at the end: `{elbow: 30 deg +- 5 deg, right_arm.elbow: 0 deg}`; "
        "the default tolerance is 3 deg.",
    )
    returns: Mapping[str, object] = key(
        default={},
        wrong="'{}' needs names and values",
        hint="such as {greeted: 2}",
        help="Results of the mission: `{greeted: 2, names: [Anna, Ben]}`.",
    )


@keys
class CommonKeys:
    """Keys that the cases of a test file may share."""

    case: str = key(default="", help="Title.")
    params: Mapping[str, object] = key(default={}, help="Params of the mission.")
    robot: str | None = key(default=None, help="Robot, a name or file; by default that of `mission run`.")
    world: str | None = key(default=None, help="World, a name or file; by default that of `mission run`.")
    eyes: Eyes = key(
        default="pixels",
        help="`pixels` draws and searches pictures; `truth` takes faces from the world, which is faster.",
    )
    physics: bool = key(
        default=False,
        help="Simulate the robot as a body with masses by MuJoCo; `mission test --physics` does so for all cases.",
    )
    seed: int = key(default=0, low=0, help="Random seed.")
    timeout: float = key("duration", default=CASE_TIMEOUT, low=0.1, help="Simulated time after which the run is ended.")
    given: tuple[Given, ...] = key(default=(), help="Mocks and faults.")
    expect: ExpectKeys | None = key(default=None, help="Expectations.")


@keys
class CaseKeys(CommonKeys):
    """Keys of a test case."""

    case: str = key(help="Title.")
    expect: ExpectKeys = key(help="Expectations.")


@keys
class SuiteKeys:
    """Keys of a test file."""

    tests: str = key(help="Mission to test; a file beside the test file takes precedence over the library.")
    behaviours: tuple[str, ...] = key(
        default=(), wrong="'{}' needs a list of files of Python", help="Python files with additional leaves."
    )
    shared: CommonKeys | None = key(
        default=None,
        word="with",
        wrong="'{}' needs what all cases have in common",
        hint="such as {world: living_room}",
        help="Keys that all cases share; a case adds to lists and params, and replaces other keys.",
    )
    cases: tuple[CommonKeys, ...] = key(each="a case", help="Cases, a run each.")


@keys
class JudgedSuiteKeys(SuiteKeys):
    """Keys of a test file whose cases all have expectations."""

    cases: tuple[CaseKeys, ...] = key(each="a case", help="Cases, a run each.")


HEADING_TOLERANCE = math.radians(10)
"""Default tolerance in radians of the base's heading that a test case expects."""

JOINT_TOLERANCE = math.radians(3)
"""Default tolerance in radians of a joint's angle that a test case expects."""
