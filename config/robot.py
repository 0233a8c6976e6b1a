"""Robot files: which parts a robot has, by which drivers, where they are plugged in, how far and fast they may go.

A part that the file does not name is a part that the robot does not have. What a section may hold, its driver declares:
so readers are given the table of drivers. SI units and radians throughout.
"""

import re
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, Self, TypeVar

from config.diagnostics import InvalidFileError, SourceText, closest, suggest_from
from config.fields import Fields, fields_of, value_of
from config.notices import NoticeConfig, NoticeEntry, notice_of
from config.section_reader import add_mistakes, read_keys
from config.units import quoted_value
from config.yaml_nodes import Mapping as MarkedMapping
from config.yaml_nodes import Scalar, read_source
from drivers.api.driver import BrokenDriver, Driver, DriverCatalogue
from drivers.api.fast_dataclass import dataclass
from drivers.api.keys import KeyDiagnostic, declared_keys, key, keys
from drivers.api.kinds import KINDS, PartKind
from drivers.api.sections import ArmKeys, BaseKeys, HeadKeys, RangeKeys, ScreenKeys, VoiceKeys
from drivers.api.sensor_sections import CameraKeys, MicrophoneKeys

K = TypeVar("K")

PART_NAME = "[a-z][a-z0-9_]*"
"""What a part under a name of its own may be called."""


@keys
class RobotKeys:
    """The keys of a robot file beside its parts."""

    robot: str = key(help="What the robot is called.")
    summary: str = key(default="", help="What it is, in a line.")
    rate: float = key("frequency", default=20.0, low=1.0, high=200.0, help="How often its missions are ticked at most.")
    sensor_timeout: float = key(
        "duration",
        default=5.0,
        low=0.5,
        high=600.0,
        help="How long a mission waits for a sensor that does not report; then what depends on it fails.",
    )
    notices: tuple[NoticeEntry, ...] = key(default=(), help="Where it tells how tasks went, each a word or a section.")


@dataclass(frozen=True, slots=True)
class Section:
    """What a robot file says of one part: its driver, and the keys of that.

    ``name`` is what the part is called, where that is not its kind.
    """

    driver: Driver
    keys: Any
    name: str = ""

    @property
    def part(self) -> str:
        """What the part is called."""
        return self.name or self.driver.kind


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """A whole robot. ``rate`` is the ceiling of ticks per second; ``notices`` say where it is told how tasks went.

    ``sensor_timeout`` (s) is how long a node may be suspended. ``sections`` are its parts by name: their kind, or a
    name of its own for one more of a kind. The properties are the keys that every driver of a kind has.
    """

    name: str
    summary: str
    rate: float
    sections: Mapping[str, Section] = field(default_factory=dict)
    notices: tuple[NoticeConfig, ...] = ()
    path: Path | None = field(default=None, compare=False)
    sensor_timeout: float = 5.0

    @property
    def parts(self) -> frozenset[str]:
        """The names of the parts that it has."""
        return frozenset(self.sections)

    @property
    def extra_parts(self) -> Mapping[str, str]:
        """The kinds of further parts, by their own names."""
        return {name: section.driver.kind for name, section in self.sections.items() if section.name}

    def kind_of(self, part: str) -> PartKind:
        """Return the kind of a part that it has."""
        return KINDS[self.sections[part].driver.kind]

    def keys(self, cls: type[K]) -> K | None:
        """Return the keys of the part whose keys are of a class: of a kind (``ArmKeys``), or of one driver."""
        return next((each.keys for each in self.sections.values() if isinstance(each.keys, cls)), None)

    def with_keys(self, part: str, keys: object) -> Self:
        """Return the robot with other keys of a part that it has."""
        return replace(self, sections={**self.sections, part: replace(self.sections[part], keys=keys)})

    @property
    def base(self) -> BaseKeys | None:
        """The section ``base``."""
        return self.keys(BaseKeys)

    @property
    def head(self) -> HeadKeys | None:
        """The section ``head``, not those of other heads."""
        found = self.sections.get("head")
        return None if found is None else found.keys

    @property
    def arm(self) -> ArmKeys | None:
        """The section ``arm``, not those of other arms."""
        found = self.sections.get("arm")
        return None if found is None else found.keys

    @property
    def range(self) -> RangeKeys | None:
        """The section ``range``."""
        return self.keys(RangeKeys)

    @property
    def has_range_guard(self) -> bool:
        """Whether its base keeps away from what its range finder sees."""
        return self.range is not None and self.base is not None and self.base.has_range_guard

    @property
    def camera(self) -> CameraKeys | None:
        """The section ``camera``."""
        return self.keys(CameraKeys)

    @property
    def microphone(self) -> MicrophoneKeys | None:
        """The section ``microphone``."""
        return self.keys(MicrophoneKeys)

    @property
    def voice(self) -> VoiceKeys | None:
        """The section ``voice``."""
        return self.keys(VoiceKeys)

    @property
    def screen(self) -> ScreenKeys | None:
        """The section ``screen``."""
        return self.keys(ScreenKeys)


def load_robot(path: Path, drivers: DriverCatalogue) -> RobotConfig:
    """Read a robot file. Raises InvalidFileError with every mistake in it."""
    return parse_robot(read_source(path), drivers, path)


def parse_robot(source: SourceText, drivers: DriverCatalogue, path: Path | None = None) -> RobotConfig:
    """Read the text of a robot file. Raises InvalidFileError with every mistake in it."""
    fields = fields_of(source, subject="a robot file")
    kinds = {**KINDS, **_named_parts(fields)}
    read = {name: fields.section(name, hint=_driver_alone(fields, name, kind, drivers)) for name, kind in kinds.items()}
    sections: dict[str, Section] = {}
    for name, kind in kinds.items():
        section = read[name]
        found = None if section is None else _read_section(section, name, kind, drivers)
        if found is not None:
            sections[name] = found
    _check_together(read, sections)
    told = read_keys(fields, RobotKeys)
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    notices = tuple(map(notice_of, told.notices))
    return RobotConfig(told.robot, told.summary, told.rate, sections, notices, path, told.sensor_timeout)


def _driver_alone(fields: Fields, name: str, kind: PartKind, drivers: DriverCatalogue) -> str:
    """Say what to write where the name of a driver stands in the place of a section."""
    node = fields.node.get(name) if isinstance(fields.node, MarkedMapping) else None
    known = isinstance(node, Scalar) and node.text in drivers.names(kind.name)
    return f"write {name}: {{driver: {node.text}}}, with its other keys" if isinstance(node, Scalar) and known else ""


def _named_parts(fields: Fields) -> dict[str, PartKind]:
    """Return the parts under names of their own, each with its kind: the sections that say one."""
    several = {kind.name: kind for kind in KINDS.values() if kind.allows_several}
    found: dict[str, PartKind] = {}
    for name, node in fields.node.entries if isinstance(fields.node, MarkedMapping) else ():
        kind = node.get("kind") if isinstance(node, MarkedMapping) else None
        if kind is None or name.text in KINDS or name.text in {each.word for each in declared_keys(RobotKeys)}:
            continue
        if re.fullmatch(PART_NAME, name.text) is None:
            hint = "write small letters, digits and '_', beginning with a letter"
            fields.add_error(name.mark, f"a part cannot be called '{name.text}'", hint, sure=True)
        named = kind.text if isinstance(kind, Scalar) else ""
        if named not in several:
            told = f"'kind' cannot be {quoted_value(value_of(kind))}: only of {' and '.join(several)} a robot may have several"
            fields.add_error(kind.mark, told, suggest_from(named, several), sure=True)
        found[name.text] = several.get(named) or next(iter(several.values()))
    return found


def _read_section(fields: Fields, name: str, kind: PartKind, drivers: DriverCatalogue) -> Section | None:
    """Read the section of a part, by the driver that it names."""
    named = "" if name == kind.name else name
    if named:
        fields.node_of("kind")
    driver = _find_driver(fields, kind, drivers)
    return None if driver is None else Section(driver, read_keys(fields, driver.keys), named)


def _find_driver(fields: Fields, kind: PartKind, drivers: DriverCatalogue) -> Driver | None:
    """Return the driver that a section names; where that is none, the one that is meant most likely."""
    node = fields.node_of("driver", required=not kind.default_driver, hint="`mission list drivers` has all")
    named = kind.default_driver if node is None else node.text if isinstance(node, Scalar) else ""
    mark = fields.node.mark if node is None else node.mark
    try:
        return drivers.find(kind.name, named)
    except BrokenDriver as error:
        fields.add_error(mark, f"'driver: {named}' cannot be used: {error}", sure=True)
        return None
    except KeyError:
        names = drivers.names(kind.name)
        if node is not None:
            fields.add_error(
                mark, f"'driver' cannot be {quoted_value(value_of(node))}", suggest_from(named, names), sure=True
            )
    # The other keys are looked at as well, so that all mistakes come at once.
    return drivers.find(kind.name, closest(named, names) or names[0])


def _check_together(read: Mapping[str, Fields | None], sections: Mapping[str, Section]) -> None:
    """Note what is wrong with a section together with others."""
    keys = {kind: section.keys for kind, section in sections.items()}
    ports: dict[str, str] = {}
    for kind, section in sections.items():
        fields, driver = read[kind], section.driver
        if fields is None:
            continue
        port = getattr(section.keys, "port", "")
        if port and (first := ports.setdefault(port, kind)) != kind:
            add_mistakes(fields, [KeyDiagnostic(f"port {port} is that of '{first}'", ("port",))])
        if driver.check is not None:
            try:
                mistakes = list(driver.check(section.keys, keys))
            except Exception as error:  # of a driver from outside, whatever it is
                about = f"the driver '{driver.name}' cannot check this: {type(error).__name__}"
                mistakes = [KeyDiagnostic(about, ("driver",))]
            add_mistakes(fields, mistakes)
        elif lacking := [need for need in driver.needs if need not in sections]:
            told = f"'driver: {driver.name}' is made of the {' and the '.join(lacking)}, which this robot does not have"
            fields.add_error(fields.node.mark, told)
