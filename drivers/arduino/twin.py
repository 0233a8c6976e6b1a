"""Simulated heads on an Arduino."""

from drivers.arduino.declared import ArduinoKeys, SecondPanTiltKeys
from drivers.head.twin import ServoHeadTwin, make_head_twin
from drivers.sim.context import SimContext


def make(keys: ArduinoKeys, context: SimContext) -> ServoHeadTwin:
    """Return the twin of a head on an Arduino."""
    return make_head_twin(keys, keys.away, context)


def make_second(keys: SecondPanTiltKeys, context: SimContext) -> ServoHeadTwin:
    """Return the twin of a second pan/tilt device on the board of a head."""
    board: ArduinoKeys = context.part_keys["head"]
    return make_head_twin(keys, board.away, context)
