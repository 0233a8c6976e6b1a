"""Catalogue of all leaves of MissionTree, by tag. Modules are imported at the first look-up of their leaf."""

from collections.abc import Iterator, Mapping
from importlib import import_module
from itertools import chain
from types import MappingProxyType

from behaviours.leaf import Leaf

LEAF_PATHS: Mapping[str, str] = {
    "face_seen": "sight:FaceSeenLeaf",
    "face_centred": "sight:FaceCentred",
    "faces_at_least": "sight:FacesAtLeast",
    "find_face": "sight:FindFace",
    "identify": "sight:Identify",
    "object_seen": "search:ObjectSeenLeaf",
    "find_object": "search:FindObject",
    "robot_seen": "other_robots:RobotSeenLeaf",
    "find_robot": "other_robots:FindRobot",
    "track_face": "tracking.track:TrackFace",
    "track_object": "tracking.track:TrackObject",
    "track_robot": "tracking.track:TrackRobot",
    "follow_person": "tracking.track:FollowPerson",
    "scene_uniform": "scene:SceneUniform",
    "dark": "scene:Dark",
    "motion_seen": "scene:MotionSeenLeaf",
    "look": "head:LookLeaf",
    "look_at": "head:LookAt",
    "scan": "scan:Scan",
    "nod": "head_motion:Nod",
    "shake_head": "head_motion:ShakeHead",
    "sweep_head": "head_motion:SweepHead",
    "drive": "driving.motion:DriveLeaf",
    "turn": "driving.motion:TurnLeaf",
    "arc": "driving.motion:Arc",
    "go_to": "driving.go_to:GoTo",
    "velocity": "driving.motion:Cruise",
    "walk": "legs:WalkLeaf",
    "turn_in_place": "legs:TurnInPlace",
    "stand": "legs:Stand",
    "sit": "legs:Sit",
    "play_gait": "legs:PlayGait",
    "get_up": "legs:GetUp",
    "fallen": "legs:Fallen",
    "wander": "wander:Wander",
    "dock": "docking:DockLeaf",
    "stop": "driving.motion:StopLeaf",
    "sound": "signals:SoundLeaf",
    "led": "signals:Led",
    "bumped": "base_conditions:Bumped",
    "cliff": "base_conditions:Cliff",
    "battery_below": "base_conditions:BatteryBelow",
    "docked": "base_conditions:Docked",
    "button_pressed": "base_conditions:ButtonPressed",
    "obstacle_within": "base_conditions:ObstacleWithin",
    "gesture": "keyframe_playback:GestureLeaf",
    "play": "keyframe_playback:Play",
    "record_move": "keyframe_playback:RecordMove",
    "move_joints": "joints:MoveJoints",
    "sweep": "sweep_joints:SweepLeaf",
    "mirror": "mirror:Mirror",
    "follow_joint": "mirror:FollowJoint",
    "torque": "joints:Torque",
    "joint_at": "joints:JointAt",
    "joint_hot": "joints:JointHot",
    "joint_loaded": "joints:JointLoaded",
    "joint_moving": "joints:JointMoving",
    "say": "voice:Say",
    "play_sound": "voice:PlaySound",
    "listen": "hearing:Listen",
    "heard": "hearing:HeardLeaf",
    "face": "screen:FaceLeaf",
    "show": "screen:Show",
    "navigate": "ros2:Navigate",
    "navigate_through": "ros2:NavigateThrough",
    "call_service": "ros2:CallService",
    "ros2_action": "ros2:Ros2Action",
    "publish": "ros2:Publish",
    "topic": "ros2:TopicLeaf",
    "wait": "basics:Wait",
    "wait_until": "basics:WaitUntil",
    "check": "basics:Check",
    "log": "basics:Log",
    "notify": "basics:Notify",
    "set": "basics:Set",
    "succeed": "basics:Succeed",
    "fail": "basics:Fail",
    "pretend": "basics:Pretend",
}
"""Module (within ``behaviours``) and class of each leaf, by tag."""


class Catalogue(Mapping[str, type[Leaf]]):
    """Leaves by tag: built-in ones, imported at their first look-up, and the ``loaded`` classes of other packages.

    ``paths`` has the module and class of each built-in leaf, by tag. ``skipped`` lists the files and packages whose
    leaves could not be loaded.
    """

    def __init__(self, paths: Mapping[str, str], loaded: Mapping[str, type[Leaf]] = MappingProxyType({})) -> None:
        self.skipped: list[str] = []
        self._paths = paths
        self._loaded = loaded

    def __getitem__(self, word: str) -> type[Leaf]:
        if word in self._loaded:
            return self._loaded[word]
        module, _, name = self._paths[word].partition(":")
        leaf: type[Leaf] = getattr(import_module(f"behaviours.{module}"), name)
        return leaf

    def __contains__(self, word: object) -> bool:
        return word in self._paths or word in self._loaded

    def __iter__(self) -> Iterator[str]:
        return chain(self._paths, self._loaded)

    def __len__(self) -> int:
        return len(self._paths) + len(self._loaded)


LEAVES: Mapping[str, type[Leaf]] = Catalogue(LEAF_PATHS)
"""All leaves that ship with MissionTree, by tag."""
