"""Robot files: parts, drivers, ports and limits of a robot, with required keys and defaults."""

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
"""Regular expression of the names of a robot's parts."""


@keys
class RobotKeys:
    """Keys at the top of a robot file, such as its name; the sections of its parts have keys of their own."""

    robot: str = key(help="Name of the robot.")
    summary: str = key(default="", help="Description in a line.")
    rate: float = key("frequency", default=20.0, low=1.0, high=200.0, help="Maximum tick rate of missions.")
    sensor_timeout: float = key(
        "duration",
        default=5.0,
        low=0.5,
        high=600.0,
        help="Maximum time that a mission waits for a sensor; then the behaviours that need it fail.",
    )
    notices: tuple[NoticeEntry, ...] = key(
        default=(), help="Channels for notices about tasks, each a word or a section."
    )


@dataclass(frozen=True, slots=True)
class Section:
    """Section of a robot file for one part: its driver, and the values of the driver's keys."""

    driver: Driver
    keys: Any
    name: str = ""

    @property
    def part(self) -> str:
        """Name of the part."""
        return self.name or self.driver.kind


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """Contents of a robot file. ``rate`` is the maximum tick rate in Hz; ``notices`` are channels for task notices.

    ``sensor_timeout`` (s) is how long a node may be suspended. ``sections`` are the parts by name: the kind, or a name
    of its own for an additional part of a kind. Properties such as ``base`` return the keys of a section, as far as all
    drivers of its kind share them.
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
        """Names of the robot's parts."""
        return frozenset(self.sections)

    @property
    def extra_parts(self) -> Mapping[str, str]:
        """Kind of each additional part, by the part's name."""
        return {name: section.driver.kind for name, section in self.sections.items() if section.name}

    def kind_of(self, part: str) -> PartKind:
        """Return the kind of a part."""
        return KINDS[self.sections[part].driver.kind]

    def keys(self, cls: type[K]) -> K | None:
        """Return the keys of the first section whose class is ``cls``, or None without one.

        ``cls`` is the class of a kind of part (``ArmKeys``), or of one driver.
        """
        return next((each.keys for each in self.sections.values() if isinstance(each.keys, cls)), None)

    def with_keys(self, part: str, keys: object) -> Self:
        """Return a copy of the robot with other keys for one part."""
        return replace(self, sections={**self.sections, part: replace(self.sections[part], keys=keys)})

    @property
    def base(self) -> BaseKeys | None:
        """Section ``base``, or None."""
        return self.keys(BaseKeys)

    @property
    def head(self) -> HeadKeys | None:
        """Section ``head``, or None; not those of additional heads."""
        found = self.sections.get("head")
        return None if found is None else found.keys

    @property
    def arm(self) -> ArmKeys | None:
        """Section ``arm``, or None; not those of additional arms."""
        found = self.sections.get("arm")
        return None if found is None else found.keys

    @property
    def range(self) -> RangeKeys | None:
        """Section ``range``, or None."""
        return self.keys(RangeKeys)

    @property
    def has_range_guard(self) -> bool:
        """True if the base stops at obstacles that the range finder sees."""
        return self.range is not None and self.base is not None and self.base.has_range_guard

    @property
    def camera(self) -> CameraKeys | None:
        """Section ``camera``, or None."""
        return self.keys(CameraKeys)

    @property
    def microphone(self) -> MicrophoneKeys | None:
        """Section ``microphone``, or None."""
        return self.keys(MicrophoneKeys)

    @property
    def voice(self) -> VoiceKeys | None:
        """Section ``voice``, or None."""
        return self.keys(VoiceKeys)

    @property
    def screen(self) -> ScreenKeys | None:
        """Section ``screen``, or None."""
        return self.keys(ScreenKeys)


def load_robot(path: Path, drivers: DriverCatalogue) -> RobotConfig:
    """Read a robot file. Raises InvalidFileError with all errors."""
    return parse_robot(read_source(path), drivers, path)


def parse_robot(source: SourceText, drivers: DriverCatalogue, path: Path | None = None) -> RobotConfig:
    """Return the robot in a text. Raises InvalidFileError with all errors."""
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
    parsed = read_keys(fields, RobotKeys)
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    notices = tuple(map(notice_of, parsed.notices))
    return RobotConfig(parsed.robot, parsed.summary, parsed.rate, sections, notices, path, parsed.sensor_timeout)


def _driver_alone(fields: Fields, name: str, kind: PartKind, drivers: DriverCatalogue) -> str:
    """Return a hint if a part has only the name of its driver instead of a section; else an empty text."""
    node = fields.node.get(name) if isinstance(fields.node, MarkedMapping) else None
    known = isinstance(node, Scalar) and node.text in drivers.names(kind.name)
    return f"write {name}: {{driver: {node.text}}}, with its other keys" if isinstance(node, Scalar) and known else ""


def _named_parts(fields: Fields) -> dict[str, PartKind]:
    """Return the additional parts with their kind: the sections with a key ``kind``."""
    several = {kind.name: kind for kind in KINDS.values() if kind.allows_several}
    found: dict[str, PartKind] = {}
    for name, node in fields.node.entries if isinstance(fields.node, MarkedMapping) else ():
        kind = node.get("kind") if isinstance(node, MarkedMapping) else None
        if kind is None or name.text in KINDS or name.text in {each.word for each in declared_keys(RobotKeys)}:
            continue
        if re.fullmatch(PART_NAME, name.text) is None:
            hint = "write small letters, digits and '_', beginning with a letter"
            fields.add_error(name.mark, f"invalid part name '{name.text}'", hint, sure=True)
        named = kind.text if isinstance(kind, Scalar) else ""
        if named not in several:
            message = f"'kind' cannot be {quoted_value(value_of(kind))}: it is one of {', '.join(several)}"
            fields.add_error(kind.mark, message, suggest_from(named, several), sure=True)
        found[name.text] = several.get(named) or next(iter(several.values()))
    return found


def _read_section(fields: Fields, name: str, kind: PartKind, drivers: DriverCatalogue) -> Section | None:
    named = "" if name == kind.name else name
    if named:
        fields.node_of("kind")
    driver = _find_driver(fields, kind, drivers)
    return None if driver is None else Section(driver, read_keys(fields, driver.keys), named)


def _find_driver(fields: Fields, kind: PartKind, drivers: DriverCatalogue) -> Driver | None:
    """Return the driver that a section names; for an unknown name, add an error and return the most similar driver."""
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
    """Add errors that involve several sections: shared ports, and the errors from ``check`` of the drivers."""
    keys = {kind: section.keys for kind, section in sections.items()}
    ports: dict[str, str] = {}
    for kind, section in sections.items():
        fields, driver = read[kind], section.driver
        if fields is None:
            continue
        port = getattr(section.keys, "port", "")
        if port and (first := ports.setdefault(port, kind)) != kind:
            add_mistakes(fields, [KeyDiagnostic(f"port {port} is used by '{first}' already", ("port",))])
        if driver.check is not None:
            try:
                mistakes = list(driver.check(section.keys, keys))
            except Exception as error:  # of a driver from outside, whatever it is
                about = f"the driver '{driver.name}' cannot check this: {type(error).__name__}"
                mistakes = [KeyDiagnostic(about, ("driver",))]
            add_mistakes(fields, mistakes)
        elif lacking := [need for need in driver.needs if need not in sections]:
            message = (
                f"'driver: {driver.name}' is made of the {' and the '.join(lacking)}, which this robot does not have"
            )
            fields.add_error(fields.node.mark, message)
