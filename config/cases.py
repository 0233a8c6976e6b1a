"""The keys of test files: what a case may say of its run, of what it is given, and of what is expected."""

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from drivers.api import Mood
from drivers.api.keys import inside, key, keys

CASE_TIMEOUT = 120.0
"""Seconds of simulated time after which a case that still runs has failed, unless its file says otherwise."""

DISTANCE_TOLERANCE = 0.1
"""Metres from where it is expected within which a base is there, unless the file says otherwise."""

GIVEN_HINT = "write 'gesture: fails twice' for a mock, or 'camera frozen from 5 s to 8 s'"
SCRIPT_HINT = "such as 'fails twice, then succeeds'"

Eyes = Literal["pixels", "truth"]
Result = Literal["success", "failure", "error", "interrupted"]
Texts = str | tuple[str, ...]
Count = Annotated[int, inside(low=0, wrong="how often '{}' has to start needs a whole number")]


@keys
class MockKeys:
    """A mock with a result of its own."""

    does: str = key(help="What it does.")
    result: object = key(default=None, help="What `as` keeps, by name; what a mission returns; or a phrase.")


Script = Annotated[str, inside(wrong="what '{}' does instead is missing", hint=SCRIPT_HINT)]
Mock = Mapping[str, Script | Annotated[MockKeys, inside(each="a mock")]]
Given = Annotated[str | Mock, inside(wrong="neither a mock nor something that goes wrong", hint=GIVEN_HINT)]
"""An entry of ``given``."""


@keys
class PoseKeys:
    """Where a base is to be."""

    near: tuple[float, float] = key("length", wrong="'{}' needs a place, such as [1 m, 0 m]", help="Where: [x, y].")
    within: float = key("length", default=DISTANCE_TOLERANCE, low=0.0, help="How far from there it may be.")
    heading: str = key(default="", help="Which way it looks: `90 deg`, or `90 deg +- 5 deg`; else 10 deg either way.")


@keys
class ExpectKeys:
    """What must come of a run."""

    result: Result | None = key(default=None, help="How it ends.")
    reason: str | None = key(default=None, help="A text that the reason contains.")
    within: float | None = key("duration", default=None, low=0.0, help="The longest time that it may take.")
    after: float | None = key("duration", default=None, low=0.0, help="The shortest.")
    said: Texts = key(default=(), help="Texts that were said, in this order; `[]` for none.")
    never_said: Texts = key(default=(), help="Texts that were not.")
    heard_by: Mapping[str, Texts] = key(
        default={},
        wrong="'{}' needs people and what they hear",
        hint="such as {Anna: [hello], Ben: []}",
        help="What each person heard of it: `{Anna: [message], Ben: []}`, in this order; `[]` for nothing.",
    )
    showed: Texts = key(
        default=(),
        blank=True,
        help='Texts that were on the screen, in this order; `[]` for none, `""` for words that are taken away.',
    )
    moods: Texts = key(default=(), among=[*Mood], help="Moods that were, in this order; `[]` for none.")
    notified: Texts = key(default=(), help="Texts of `notify`, in this order; `[]` for none.")
    ran: Texts | Mapping[str, Count] = key(
        default=(), help="Nodes that ran; with how often they started: `{gesture: 2}`."
    )
    never_ran: Texts = key(default=(), help="Nodes that did not.")
    succeeded: Texts = key(default=(), help="Nodes that succeeded at least once.")
    failed: Texts = key(default=(), help="Nodes that failed at least once.")
    order: Texts = key(default=(), help="What happened, in this order, whatever lies between.")
    faults: Texts = key(default=(), help="A text for each notice of the robot's parts; `[]` for none.")
    reflexes: Texts = key(default=(), help="Reflexes that fired, such as `bumper` or `bumper left`; `[]` for none.")
    base: Literal["stopped"] | None = key(
        default=None, help="The mission left the base standing, or had told it to stop."
    )
    pose: PoseKeys | None = key(default=None, help="Where the base truly is in the end.")
    joints: Mapping[str, str] = key(
        default={},
        wrong="'{}' needs joints and their angles",
        hint="such as {elbow: 30 deg +- 5 deg}",
        help="Where joints truly are in the end: `{elbow: 30 deg +- 5 deg, right_arm.elbow: 0 deg}`; 3 deg where "
        "nothing is said.",
    )
    returns: Mapping[str, object] = key(
        default={},
        wrong="'{}' needs names and values",
        hint="such as {greeted: 2}",
        help="The results of the mission: `{greeted: 2}`.",
    )


@keys
class CommonKeys:
    """What cases can have in common."""

    case: str = key(default="", help="Its title.")
    params: Mapping[str, object] = key(default={}, help="The mission's params.")
    robot: str | None = key(default=None, help="Its name or file; else the one that `mission run` takes.")
    world: str | None = key(default=None, help="Its name or file; else the one that `mission run` takes.")
    eyes: Eyes = key(
        default="pixels", help="With `pixels`, pictures are drawn and searched; with `truth`, faces are known: quicker."
    )
    physics: bool = key(
        default=False, help="Whether the robot is a body with masses, by MuJoCo: `mission test --physics` for all."
    )
    seed: int = key(default=0, low=0, help="For what is drawn by chance.")
    timeout: float = key(
        "duration", default=CASE_TIMEOUT, low=0.1, help="Simulated time after which a run that goes on has failed."
    )
    given: tuple[Given, ...] = key(default=(), help="Mocks, and what goes wrong.")
    expect: ExpectKeys | None = key(default=None, help="What must come of it.")


@keys
class CaseKeys(CommonKeys):
    """A case."""

    case: str = key(help="Its title.")
    expect: ExpectKeys = key(help="What must come of it.")


@keys
class SuiteKeys:
    """A test file."""

    tests: str = key(help="The mission that is tested; one beside the file goes before one of the library.")
    behaviours: tuple[str, ...] = key(
        default=(), wrong="'{}' needs a list of files of Python", help="Files with leaves of its own."
    )
    shared: CommonKeys | None = key(
        default=None,
        word="with",
        wrong="'{}' needs what all cases have in common",
        hint="such as {world: living_room}",
        help="What all cases have in common: keys of cases; what a case says itself goes before.",
    )
    cases: tuple[CommonKeys, ...] = key(each="a case", help="What is tried, each a run.")


@keys
class JudgedSuiteKeys(SuiteKeys):
    """A test file whose cases all say what they expect."""

    cases: tuple[CaseKeys, ...] = key(each="a case", help="What is tried, each a run.")


HEADING_TOLERANCE = math.radians(10)
"""Radians by which the heading of a base may be off, unless the file says otherwise."""

JOINT_TOLERANCE = math.radians(3)
"""The same for a joint."""
