"""What nodes declare of their state is what their source keeps: one that is forgotten would merge different states."""

import pytest

from behaviours.node import Node
from missions.executive.build import NODES
from missions.plugins.verify.snapshot import declared_state
from missions.plugins.verify.stand_ins import SetStandIn, StandIn, WaitStandIn
from tests.missions.testing.verify.sources import state_in_source

LEFT_OUT = {"is_skipped", "visited_tick", "moved_parts", "_moved_late"}
"""State that no decision reads in an exploration: a part of the status, and the motions of leaves; a stand-in has none.
"""

CLASSES: list[type[Node]] = [*dict.fromkeys(NODES.values()), StandIn, SetStandIn, WaitStandIn]


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_node_declares_all_of_its_state(kind: type[Node]) -> None:
    keeps, lasts = (names - LEFT_OUT for names in state_in_source(CLASSES)[kind])
    running, lasting = declared_state(kind)
    assert running | lasting == keeps
    assert lasting == lasts


def test_undeclared_attribute_is_found() -> None:
    class Forgetful(StandIn):
        def initialise(self) -> None:
            self.tries = 0

        def halting(self) -> bool:
            self.tries += 1
            return self.tries > 1

    keeps, _ = state_in_source([Forgetful])[Forgetful]
    running, lasting = declared_state(Forgetful)
    assert keeps - running - lasting - LEFT_OUT == {"tries"}
