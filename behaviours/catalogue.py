"""Every leaf that ships with MissionTree, by its word."""

from collections.abc import Mapping

from behaviours.arm import Gesture
from behaviours.base import Arc, Drive, Stop, Turn
from behaviours.basics import Fail, Log, Pretend, Set, Succeed, Wait
from behaviours.head import Look, LookAt
from behaviours.head_motion import Nod, ShakeHead, SweepHead
from behaviours.leaf import Leaf
from behaviours.objects import FindObject, ObjectSeen
from behaviours.robots import FindRobot, RobotSeen
from behaviours.scan import Scan
from behaviours.scene import Dark, MotionSeen, SceneUniform
from behaviours.sight import FaceCentred, FacesAtLeast, FaceSeen, FindFace
from behaviours.tracking.follow_person import FollowPerson
from behaviours.tracking.track_face import TrackFace
from behaviours.tracking.track_object import TrackObject
from behaviours.tracking.track_robot import TrackRobot
from behaviours.voice import Say

LEAVES: Mapping[str, type[Leaf]] = {
    leaf.word: leaf
    for leaf in (
        FaceSeen,
        FaceCentred,
        FacesAtLeast,
        FindFace,
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
        Stop,
        Gesture,
        Say,
        Wait,
        Log,
        Set,
        Succeed,
        Fail,
        Pretend,
    )
}
"""The vocabulary of missions."""
