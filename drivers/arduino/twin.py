"""Twins of the heads on an Arduino."""

from drivers.arduino.declared import ArduinoKeys, SecondKeys
from drivers.head.twin import HeadTwin, twin_of
from drivers.sim.stage import Stage


def make(keys: ArduinoKeys, stage: Stage) -> HeadTwin:
    """Return the twin of a head."""
    return twin_of(keys, keys.away, stage)


def make_second(keys: SecondKeys, stage: Stage) -> HeadTwin:
    """Return the twin of a second pan/tilt on the board of a head."""
    board: ArduinoKeys = stage.keys["head"]
    return twin_of(keys, board.away, stage)
