"""Context of a test file: the mission under test, and the robot, the world and the params of each case."""

from collections.abc import Callable, Sequence
from collections.abc import Mapping as Named
from dataclasses import dataclass, field
from pathlib import Path

from behaviours.leaf import Leaf
from config.cases import CommonKeys, SuiteKeys
from config.defaults import DefaultsKeys, load_defaults
from config.diagnostics import InvalidFileError, add_diagnostic, suggest_from
from config.fields import Fields
from config.library import DEFAULT_ROBOT, DEFAULT_WORLD, UnknownNameError, find_file
from config.robot import RobotConfig
from config.units import quoted_value
from config.world import load_world
from config.yaml_nodes import Listing, Mapping, Scalar
from drivers.api.joints import qualified_joint_name
from drivers.api.sections import ArmKeys
from missions.assembly.part_factory import with_carriers
from missions.language.nodes import MODIFIERS
from missions.language.parallel_counts import source_text
from missions.language.plan import Plan, Step
from missions.library.drivers import load_robot
from missions.library.shipped import MISSIONS_FOLDER, behaviour_files, find_mission, load_mission
from missions.library.target import target_of
from missions.library.vocabulary import load_leaves
from missions.plugins.testing.expectations import CaseNames

PARAM_SOURCE = "--param"
"""File name that the mission checker uses for params given by the caller."""


@dataclass(frozen=True, slots=True)
class CaseSetting:
    """Setting of a test case: robot, world, people, and the mission's ``plan``; None if the mission has errors."""

    params: Named[str, str]
    robot: str | None
    world: str | None
    config: RobotConfig
    plan: Plan | None
    people: tuple[str, ...] = ()

    @property
    def parts(self) -> frozenset[str]:
        """Parts of the robot that the mission uses: the only parts that a run has."""
        if self.plan is None:
            return self.config.parts
        return with_carriers(self.config, self.plan.tree.parts)

    @property
    def names(self) -> CaseNames:
        """Names that expectations may use."""
        keys = {part: self.config.sections[part].keys for part in sorted(self.parts)}
        arms = {part: its.limits for part, its in keys.items() if isinstance(its, ArmKeys)}
        joints = tuple(qualified_joint_name(part, joint) for part, limits in arms.items() for joint in limits)
        return CaseNames(
            self.node_error, tuple(self.plan.returns) if self.plan is not None else None, joints, self.people
        )

    @property
    def nodes(self) -> list[Step]:
        """Steps of the mission, without its modifiers."""
        return [step for step in (() if self.plan is None else self.plan.tree.walk()) if step.kind not in MODIFIERS]

    def steps(self, name: str) -> list[Step]:
        """Return the steps of the mission that have ``name`` as their name or word, such as ``drive``; no modifiers."""
        return [step for step in self.nodes if name in (step.kind, step.word, step.name)]

    def node_error(self, name: str) -> str:
        """Return the error for a node name; empty if the mission has such a node."""
        if self.plan is None or self.steps(name):
            return ""
        known = {word for step in self.nodes for word in (step.kind, step.word, step.name)}
        return f"mission '{self.plan.mission}' has no {quoted_value(name)}; {suggest_from(name, known)}"


@dataclass(frozen=True, slots=True)
class SuiteContext:
    """Properties shared by all cases of a test file. ``mission`` is a path; names are relative to ``folder``."""

    folder: Path
    mission: str
    behaviours: Sequence[Path] = ()
    leaves: Named[str, type[Leaf]] = field(default_factory=dict)
    robot: str | None = None
    """Default robot of the cases, for cases that name none; None for the default of `mission run`.

    Shipped tests name a robot. The attribute ``world`` is the default world in the same way.
    """
    world: str | None = None
    plans: dict[tuple[str, frozenset[tuple[str, str]]], Plan] = field(default_factory=dict, compare=False)
    """Valid mission plans by robot and params, shared by the test file's cases."""

    @classmethod
    def read(cls, fields: Fields, keys: SuiteKeys, folder: Path, behaviours: Sequence[Path] = ()) -> "SuiteContext":
        """Return the context of a test file; ``behaviours`` are added to its own.

        Raises InvalidFileError if the behaviours cannot be loaded.
        """
        files, mission = [*behaviours, *(folder / file for file in keys.behaviours if file)], ""
        try:
            mission = str(find_mission(keys.tests, folder)) if keys.tests else ""
        except UnknownNameError as error:
            fields.add_error((fields.node_of("tests") or fields.node).mark, str(error))
        found = behaviour_files(mission, files) if mission else files
        own = DefaultsKeys() if folder.resolve().is_relative_to(MISSIONS_FOLDER) else load_defaults()
        return cls(folder, mission, tuple(found), load_leaves(found, files), own.robot or None, own.world or None)

    def read_setting(self, fields: Fields, keys: CommonKeys) -> CaseSetting:
        """Return the setting of a case, with its mission checked for the robot and the params of the case."""
        robot = self._read_name(fields, "robot", keys.robot, load_robot) or self.robot
        world = self._read_name(fields, "world", keys.world, load_world) or self.world
        of = robot or DEFAULT_ROBOT
        config = load_robot(find_file("robots", of))
        params = self._read_params(fields)
        key = of, frozenset((name, value.text) for name, (_, value) in params.items())
        plan = self.plans.get(key) or self._check_mission(fields, params, config)
        if plan is not None and not fields.diagnostics:
            self.plans[key] = plan
        return CaseSetting(
            {name: value.text for name, (_, value) in params.items()},
            robot,
            world,
            config,
            plan,
            tuple(person.name for person in load_world(find_file("worlds", world or DEFAULT_WORLD)).people),
        )

    def _read_name(self, fields: Fields, key: str, name: str | None, load: Callable[[Path], object]) -> str | None:
        """Return the robot or world named by a case, or None for the default; a path is relative to the folder."""
        node = fields.node_of(key)
        if node is None or not name:
            return None
        beside = self.folder / name
        if beside.is_file():
            name = str(beside)
        try:
            load(find_file(f"{key}s", name))
        except UnknownNameError as error:
            fields.add_error(node.mark, str(error))
            return None
        except InvalidFileError as error:
            for fault in error.diagnostics:
                add_diagnostic(fields.diagnostics, fault)
            return None
        return name

    def _read_params(self, fields: Fields) -> dict[str, tuple[Scalar, Scalar]]:
        section, found = fields.node_of("params"), {}
        for name, value in section.entries if isinstance(section, Mapping) else ():
            if isinstance(value, Scalar):
                found[name.text] = name, value
            elif isinstance(value, Listing):
                text = source_text(value)
                found[name.text] = name, Scalar(value.mark, text, text)
            else:
                fields.add_error(value.mark, f"'{name.text}' needs one value, or a list")
        return found

    def _check_mission(
        self, fields: Fields, params: Named[str, tuple[Scalar, Scalar]], robot: RobotConfig
    ) -> Plan | None:
        """Check the mission as a run would; return its plan, or None if the mission itself has errors.

        An error in a param is reported at the param in the test case.
        """
        if not self.mission:
            return None
        values = {name: value.text for name, (_, value) in params.items()}
        try:
            return load_mission(self.mission, params=values, complete=True, robot=target_of(robot), leaves=self.leaves)
        except InvalidFileError as error:
            own = [fault for fault in error.diagnostics if not fault.source.name.startswith(PARAM_SOURCE)]
            for fault in error.diagnostics:
                name = fault.source.name.removeprefix(PARAM_SOURCE).strip()
                if fault in own:
                    add_diagnostic(fields.diagnostics, fault)
                elif name in params:
                    key, value = params[name]
                    fields.add_error((key if fault.mark.column == 1 else value).mark, fault.message, fault.suggestion)
                else:
                    fields.add_error(fields.node.mark, fault.message, "give it under 'params:'")
            # Where only the params are wrong, the rest of the case can still be read.
            return None if own else load_mission(self.mission, leaves=self.leaves)
