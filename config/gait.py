"""Gait files: how a humanoid walks, by parameters, or by where its soles are over a cycle.

By parameters, for the walking engine; what is not given is as the robot's own stride has it::

    gait: stroll
    walk: {step: 60 mm, turn: 5 deg}

By points, from the trunk's origin to the middles of the soles, gone through smoothly, again and again::

    gait: march
    period: 1 s
    points:
      - {at: 0 %, left: [0 mm, 60 mm, -415 mm], right: [0 mm, -60 mm, -415 mm]}
      - {at: 30 %, left: [0 mm, 60 mm, -390 mm], right: [0 mm, -60 mm, -415 mm], on: right}
"""

from pathlib import Path

from config.declared import read_keys
from config.faults import InvalidFileError
from config.fields import fields_of
from config.marked import read_source
from drivers.api.gait import GaitKeys


def load_gait(path: Path) -> GaitKeys:
    """Read a gait file. Raises InvalidFileError with every mistake in it."""
    fields = fields_of(read_source(path), what="a gait file")
    found = read_keys(fields, GaitKeys)
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return found
