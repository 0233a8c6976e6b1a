"""What a leaf asks of an arm's joints, as it is told to whoever follows the mission."""

from collections.abc import Iterator, Mapping

import pytest

from behaviours.leaf import Leaf
from drivers.api import Coupling, Device, Joints
from drivers.errors import BadRequest
from drivers.servos.joint import JointSpec
from drivers.servos.twin import JointsTwin
from drivers.sim.timeline import Timeline
from missions.executive.proxy import for_leaf, make_proxy
from missions.executive.tick_cache import TickCache

SPECS = {"elbow": JointSpec(1), "wrist": JointSpec(2, lower=-1.0, upper=1.0)}


class Told:
    """Joints whose commands are kept, and that somebody may forbid to move."""

    def __init__(self) -> None:
        self.timeline = Timeline()
        self.twin = JointsTwin(SPECS, self.timeline.clock)
        self.timeline.call_every(self.twin.STEP_INTERVAL, self.twin.step)
        self.commands: list[Mapping[str, object]] = []
        self.permits = 0
        self.twin.open()
        self.joints = for_leaf(make_proxy("arm", Joints, self.twin, TickCache(), self._permit), "wave", self._tell)

    def _tell(self, part: str, source: str, values: Mapping[str, object]) -> None:
        assert (part, source) == ("arm", "wave")
        self.commands.append(values)

    def _permit(self, device: Device, leaf: Leaf | None) -> None:
        assert (device, leaf) == (self.twin, None)
        self.permits += 1

    def torque(self) -> list[bool]:
        return [state.value.torque for state in self.joints.states().values() if state.value is not None]


@pytest.fixture
def told() -> Iterator[Told]:
    told = Told()
    yield told
    told.twin.close()


def test_hold_and_relax_commands_name_their_joints(told: Told) -> None:
    told.joints.hold()
    told.joints.relax(["wrist"])
    told.joints.hold(["wrist"])
    assert told.torque() == [True, True]
    assert told.commands == [{"hold": True}, {"relax": ["wrist"]}, {"hold": ["wrist"]}]
    assert told.permits == 0  # whatever happens, joints may be brought to rest
    with pytest.raises(BadRequest, match="no joint 'knee'"):
        told.joints.relax(["knee"])


def test_follow_command_needs_a_permit_to_begin_but_not_to_end(told: Told) -> None:
    told.joints.follow([Coupling("elbow", "wrist", scale=-1.0)])
    told.twin.turn_by_hand("elbow", 0.4)
    told.timeline.run_until(1.0)
    assert told.twin.true_angle("wrist", 1.0) == pytest.approx(-0.4, abs=0.01)
    assert told.permits == 1
    told.joints.follow(())
    assert told.permits == 1
    assert told.commands == [{"follow": {"wrist": "elbow"}}, {"follow": {}}]
    with pytest.raises(BadRequest, match="no joint 'knee'"):
        told.joints.follow([Coupling("elbow", "knee")])
    assert len(told.commands) == 2


def test_recover_command_names_the_recovered_joints(told: Told) -> None:
    told.twin.overload("wrist")
    assert told.joints.recover() == ("wrist",)
    assert told.commands == [{"recover": ["wrist"]}]
    assert told.permits == 1


def test_move_command_records_the_accepted_goals(told: Told) -> None:
    assert told.joints.move({"wrist": 2.0}) == {"wrist": 1.0}
    assert told.commands == [{"wrist": 1.0}]
