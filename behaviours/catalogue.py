"""Every leaf that ships with MissionTree, by its word."""

from collections.abc import Mapping

from behaviours.arm import Gesture
from behaviours.basics import Fail, Log, Pretend, Set, Succeed, Wait
from behaviours.docking import Dock
from behaviours.driving.arc import Arc
from behaviours.driving.cruise import Cruise
from behaviours.driving.go_to import GoTo
from behaviours.driving.stop import Stop
from behaviours.driving.straight import Drive
from behaviours.driving.turning import Turn
from behaviours.feeling import BatteryBelow, Bumped, ButtonPressed, Cliff, Docked
from behaviours.head import Look, LookAt
from behaviours.head_motion import Nod, ShakeHead, SweepHead
from behaviours.hearing import Heard, Listen
from behaviours.identify import Identify
from behaviours.joint_conditions import JointAt, JointHot, JointLoaded, JointMoving
from behaviours.joints import MoveJoints, Torque
from behaviours.leaf import Leaf
from behaviours.mirror import FollowJoint, Mirror
from behaviours.moves import Play, RecordMove
from behaviours.notify import Notify
from behaviours.objects import FindObject, ObjectSeen
from behaviours.ranging import ObstacleWithin
from behaviours.robots import FindRobot, RobotSeen
from behaviours.scan import Scan
from behaviours.scene import Dark, MotionSeen, SceneUniform
from behaviours.screen import Face, Show
from behaviours.sight import FaceCentred, FacesAtLeast, FaceSeen, FindFace
from behaviours.signals import Led, Sound
from behaviours.sweep_joints import Sweep
from behaviours.tracking.follow_person import FollowPerson
from behaviours.tracking.track_face import TrackFace
from behaviours.tracking.track_object import TrackObject
from behaviours.tracking.track_robot import TrackRobot
from behaviours.voice import PlaySound, Say
from behaviours.wander import Wander

LEAVES: Mapping[str, type[Leaf]] = {
    leaf.word: leaf
    for leaf in (
        FaceSeen,
        FaceCentred,
        FacesAtLeast,
        FindFace,
        Identify,
        ObjectSeen,
        FindObject,
        RobotSeen,
        FindRobot,
        TrackFace,
        TrackObject,
        TrackRobot,
        FollowPerson,
        SceneUniform,
        Dark,
        MotionSeen,
        Look,
        LookAt,
        Scan,
        Nod,
        ShakeHead,
        SweepHead,
        Drive,
        Turn,
        Arc,
        GoTo,
        Cruise,
        Wander,
        Dock,
        Stop,
        Sound,
        Led,
        Bumped,
        Cliff,
        BatteryBelow,
        Docked,
        ButtonPressed,
        ObstacleWithin,
        Gesture,
        Play,
        RecordMove,
        MoveJoints,
        Sweep,
        Mirror,
        FollowJoint,
        Torque,
        JointAt,
        JointHot,
        JointLoaded,
        JointMoving,
        Say,
        PlaySound,
        Listen,
        Heard,
        Face,
        Show,
        Wait,
        Log,
        Notify,
        Set,
        Succeed,
        Fail,
        Pretend,
    )
}
"""The vocabulary of missions."""
