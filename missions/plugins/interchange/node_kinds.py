"""Tables of the kinds of nodes of BehaviorTree.CPP, Nav2, MoveIt Pro and py_trees, and the words that replace them.

Import and export read these tables. Versions 3 and 4 of BehaviorTree.CPP differ in a few names and ports.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Role = Literal["control", "decorator", "leaf", "subtree"]


@dataclass(frozen=True, slots=True)
class ForeignKind:
    """A kind of node of another program, such as BehaviorTree.CPP or Nav2, and how missions express it.

    ``word`` is the composite, modifier or leaf with the same meaning; if it is empty, several are needed. ``keys`` are
    written beside the word. ``port`` is the port whose number, in ``unit``, becomes the value of the word. ``ports``
    has the default of each port. ``difference`` is a remark for the report if the word's meaning differs, otherwise
    empty.
    """

    role: Role
    word: str = ""
    keys: Mapping[str, object] = field(default_factory=dict)
    port: str = ""
    unit: str = ""
    ports: Mapping[str, str] = field(default_factory=dict)
    difference: str = ""


def _control(word: str = "", difference: str = "", **ports: str) -> ForeignKind:
    return ForeignKind("control", word, ports=ports, difference=difference)


def _decorator(word: str = "", difference: str = "", **ports: str) -> ForeignKind:
    return ForeignKind("decorator", word, ports=ports, difference=difference)


NEXT_TICK = "the next round starts at the next tick"

BTCPP_KINDS: Mapping[str, ForeignKind] = {
    "Sequence": _control("sequence"),
    "AsyncSequence": _control("sequence"),
    "SequenceWithMemory": _control(),
    "ReactiveSequence": _control("reactive_sequence"),
    "Fallback": _control("selector"),
    "AsyncFallback": _control("selector"),
    "ReactiveFallback": _control("reactive_selector"),
    "Parallel": _control("parallel", success_count="-1", failure_count="1"),
    "ParallelAll": _control("parallel", max_failures="1"),
    "IfThenElse": _control("switch"),
    "WhileDoElse": _control("reactive_switch"),
    "TryCatch": _control(catch_on_halt="false"),
    "Inverter": ForeignKind("decorator", "invert", {"invert": True}),
    "ForceSuccess": ForeignKind("decorator", "on_failure", {"on_failure": "succeed"}),
    "ForceFailure": ForeignKind("decorator", "on_success", {"on_success": "fail"}),
    "KeepRunningUntilFailure": ForeignKind("decorator", "repeat", {"repeat": "forever"}),
    "RetryUntilSuccessful": ForeignKind(
        "decorator", "retry", port="num_attempts", ports={"num_attempts": ""}, difference=NEXT_TICK
    ),
    "Repeat": ForeignKind("decorator", "repeat", port="num_cycles", ports={"num_cycles": ""}, difference=NEXT_TICK),
    "Timeout": ForeignKind("decorator", "timeout", port="msec", unit="ms", ports={"msec": ""}),
    "Delay": ForeignKind("decorator", "delay", port="delay_msec", unit="ms", ports={"delay_msec": ""}),
    "RunOnce": _decorator("once", then_skip="true"),
    "Precondition": _decorator(**{"if": "", "else": "FAILURE"}),
    **{
        f"Loop{each}": _decorator("for_each", queue="", value="", if_empty="SUCCESS")
        for each in ("Int", "Bool", "Double", "String")
    },
    "SkipUnlessUpdated": _decorator(entry=""),
    "WaitValueUpdate": _decorator(entry=""),
    **{
        f"BlackboardCheck{each}": _decorator("while", value_A="", value_B="", return_on_mismatch="FAILURE")
        for each in ("Int", "Double", "String", "Bool")
    },
    "SubTree": ForeignKind("subtree", "mission"),
    "Script": ForeignKind("leaf", "set", port="code", ports={"code": ""}),
    "ScriptCondition": ForeignKind("leaf", "check", port="code", ports={"code": ""}),
    "SetBlackboard": ForeignKind("leaf", "set", port="value", ports={"value": "", "output_key": ""}),
    "UnsetBlackboard": ForeignKind("leaf", "set", port="key", ports={"key": ""}, difference="the entry becomes null"),
    "Sleep": ForeignKind("leaf", "wait", port="msec", unit="ms", ports={"msec": ""}),
    "AlwaysSuccess": ForeignKind("leaf", "succeed"),
    "AlwaysFailure": ForeignKind("leaf", "fail"),
    **{
        f"Switch{count}": _control(
            "reactive_switch", variable="", **{f"case_{number}": "" for number in range(1, count + 1)}
        )
        for count in range(2, 7)
    },
}
"""Kinds of nodes that are built into BehaviorTree.CPP, by name."""

NAV2_KINDS: Mapping[str, ForeignKind] = {
    "PipelineSequence": _control("race"),
    "RecoveryNode": _control("retry", "a failed recovery does not end it", number_of_retries="1"),
    "RoundRobin": ForeignKind("control", "selector", {"in_turn": True}, ports={"wrap_around": "false"}),
    "NonblockingSequence": _control("race"),
    "PersistentSequence": _control("sequence"),
    "PauseResumeController": _control(),
    "RateController": ForeignKind("decorator", "wait", port="hz", ports={"hz": "10.0"}),
    "DistanceController": ForeignKind("decorator", "wait_until", port="distance", unit="m", ports={"distance": "1.0"}),
    "SpeedController": _decorator(
        "wait",
        "its period is that of the maximum rate, at any speed",
        min_rate="0.1",
        max_rate="1.0",
        min_speed="0.0",
        max_speed="0.5",
    ),
    "GoalUpdatedController": _decorator("wait_until", goal="{goal}", goals="{goals}"),
    "SingleTrigger": _decorator("once", "it stays ended until the mission starts again"),
    "GoalUpdater": _decorator(input_goal="", output_goal="", input_goals="", output_goals=""),
    "PathLongerOnApproach": _decorator(path="", prox_len="", length_factor=""),
}
"""Kinds of control nodes and decorators of Nav2, by name."""

MOVEIT_PRO_KINDS: Mapping[str, ForeignKind] = {
    "ForEach": _decorator("for_each", "the index counts from 1", vector_in="", out="", index=""),
    "ForEachUntilSuccess": _decorator("for_each", "the index counts from 1", vector_in="", out="", index=""),
}
"""Kinds of decorators of MoveIt Pro, by name."""

PY_TREES_KINDS: Mapping[str, ForeignKind] = {
    "FailureIsSuccess": ForeignKind("decorator", "on_failure", {"on_failure": "succeed"}),
    "SuccessIsFailure": ForeignKind("decorator", "on_success", {"on_success": "fail"}),
    "RunningIsFailure": ForeignKind("decorator", "on_running", {"on_running": "fail"}),
    "RunningIsSuccess": ForeignKind("decorator", "on_running", {"on_running": "succeed"}),
    "SuccessIsRunning": ForeignKind("decorator", "repeat", {"repeat": "forever"}),
    "FailureIsRunning": ForeignKind("decorator", "retry", {"retry": "forever"}),
    "Retry": ForeignKind("decorator", "retry", port="num_failures", ports={"num_failures": ""}),
    "OneShot": ForeignKind(
        "decorator", "once", {"once": True}, ports={"policy": ""}, difference="a failure counts as an end, too"
    ),
    "PassThrough": _decorator(),
    "Count": _decorator(difference="its counts are not kept"),
}
"""Kinds of decorators of py_trees, by name, without those that have the same name in BehaviorTree.CPP."""

KINDS: Mapping[str, ForeignKind] = {**BTCPP_KINDS, **NAV2_KINDS, **MOVEIT_PRO_KINDS, **PY_TREES_KINDS}

OLD_NAMES: Mapping[str, str] = {
    "SequenceStar": "SequenceWithMemory",
    "FallbackStar": "Fallback",
    "RetryUntilSuccesful": "RetryUntilSuccessful",
    "SubTreePlus": "SubTree",
    "SubtreePlus": "SubTree",
    "Subtree": "SubTree",
    "Selector": "Fallback",
    "ParallelNode": "Parallel",
    "Negation": "Inverter",
    "Recovery": "RecoveryNode",
    "BlackboardCheck": "BlackboardCheckString",
}
"""Present name of each kind of node that had another name in earlier versions, by the old name."""

OLD_PORTS: Mapping[tuple[str, str], str] = {
    ("Parallel", "success_threshold"): "success_count",
    ("Parallel", "failure_threshold"): "failure_count",
    ("Parallel", "threshold"): "success_count",
    ("Timeout", "timeout_ms"): "msec",
    ("Delay", "msec"): "delay_msec",
    ("Repeat", "num_success"): "num_cycles",
}
"""Present name of each port that had another name in earlier versions, by kind of node and old name."""

CONDITION_ATTRIBUTES = ("_failureIf", "_successIf", "_skipIf", "_while")
"""Attributes of a node with scripts that are evaluated before it starts, in this order; ``_while`` also while it runs.
"""

END_ATTRIBUTES = ("_onHalted", "_onFailure", "_onSuccess", "_post")
"""Attributes of a node with scripts that run after it was halted, has failed, has succeeded, or ended in any way."""

EDITOR_ATTRIBUTES = ("_collapsed", "_favorite", "_fullpath", "_uid", "_hardcoded", "_subtreeOnly", "_autoremap")
"""Attributes of a node without a meaning for its translation, except ``_autoremap``, which the SubTree nodes read."""

COMMON_ATTRIBUTES = frozenset(
    {"ID", "name", "_description", *CONDITION_ATTRIBUTES, *END_ATTRIBUTES, *EDITOR_ATTRIBUTES}
)
"""Attributes that every kind of node can have, so that they are not ports."""

WITHOUT_COUNTERPART = (
    *("SkipUnlessUpdated", "WaitValueUpdate", "PauseResumeController", "GoalUpdater", "PathLongerOnApproach"),
)
"""Kinds of nodes that are translated to stub leaves, although their ports are known."""

NAV2_ERRORS = ("error_code_id", "error_msg")

NAV2_OUTPUTS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("ComputePathToPose", "ComputePathThroughPoses"), ("path", *NAV2_ERRORS, "planning_time")),
    "ComputeRoute": ("path", "route", "planning_time", *NAV2_ERRORS),
    "ComputeAndTrackRoute": ("execution_duration", *NAV2_ERRORS),
    "FollowObject": ("total_elapsed_time", *NAV2_ERRORS),
    **dict.fromkeys(("FollowPath", "NavigateToPose", "NavigateThroughPoses"), NAV2_ERRORS),
    **dict.fromkeys(("Spin", "BackUp", "DriveOnHeading", "AssistedTeleop", "Wait"), NAV2_ERRORS),
    "SmoothPath": ("smoothed_path", "smoothing_duration", "was_completed", *NAV2_ERRORS),
    **dict.fromkeys(("RemovePassedGoals", "RemoveInCollisionGoals"), ("output_goals", "output_waypoint_statuses")),
    **dict.fromkeys(("TruncatePath", "TruncatePathLocal", "ConcatenatePaths"), ("output_path",)),
    "PlannerSelector": ("selected_planner",),
    "ControllerSelector": ("selected_controller",),
    "SmootherSelector": ("selected_smoother",),
    "GoalCheckerSelector": ("selected_goal_checker",),
    "ProgressCheckerSelector": ("selected_progress_checker",),
    "PathHandlerSelector": ("selected_path_handler",),
    "DockRobot": ("success", *NAV2_ERRORS, "num_retries"),
    "UndockRobot": ("success", *NAV2_ERRORS),
    "GoalUpdater": ("output_goal", "output_goals"),
    "GetPoseFromPath": ("pose",),
    **dict.fromkeys(("GetNextFewGoals", "AppendGoalPoseToGoals"), ("output_goals",)),
    "GetCurrentPose": ("current_pose",),
    "ExtractRouteNodesAsGoals": ("goals",),
    "ValidatePath": ("collision_poses",),
    "IsPathValid": ("invalid_pose_ids",),
    "ToggleCollisionMonitor": ("success",),
}
"""Output ports of leaves of Nav2, by the name of the leaf; XML files of Nav2 rarely declare them."""

CONDITIONS = (
    *("GoalUpdated", "GlobalUpdatedGoal", "GoalReached", "InitialPoseReceived", "IsBatteryCharging", "IsBatteryLow"),
    *("IsPathValid", "IsStopped", "IsStuck", "IsWithinPathTrackingBounds", "IsGoalNearby", "PathExpiringTimer"),
    *("TimeExpired", "TransformAvailable", "DistanceTraveled", "ArePosesNear", "AreErrorCodesPresent"),
    *("WouldAControllerRecoveryHelp", "WouldAPlannerRecoveryHelp", "WouldARouteRecoveryHelp"),
    *("WouldASmootherRecoveryHelp", "WasEntryUpdated"),
)
"""Leaves of Nav2 and BehaviorTree.CPP that are conditions: they end at their first tick."""

MARK = "_mission"
"""Attribute of an XML element that `mission show` has exported: the word of the step from which it was made.

This attribute and those below hold data for an import
that BehaviorTree.CPP has no place for; see ``missions.plugins.interchange.marks`` for their form in a file.
"""

GIVEN, DEFAULTS, CALCULATED, RETURNS, AS = "_given", "_defaults", "_calculated", "_returns", "_as"
"""Attributes of an exported SubTree node that hold parts of its ``mission`` step.

These are the names of the params in ``with``, those of params that have their defaults, calculated params, ``returns``
and ``as``.
"""

HEADER_KEYS = ("mission", "summary", "params", "returns", "properties", "if_interrupted")
"""Top-level keys of a mission that the declaration of its exported tree holds, as YAML in its description."""

REASON = "_reason"
"""Attribute of an exported AlwaysFailure node that holds the reason of the ``fail`` step."""

CASES = "_cases"
"""Attribute of an exported IfThenElse or WhileDoElse node: the cases of the switch, as a YAML list.

There is one case for each child after the condition; null for a filler, a child that only stands for a missing case.
"""

COUNTS = "_counts"
"""Attribute of an exported ParallelAll node: the counts of the ``parallel``, as a YAML mapping."""

NUMBER = "_number"
"""Attribute of an exported SubTree node: its number among those with the same name in the tree, from 2.

BehaviorTree.CPP refuses equal names.
"""

UNSKIPPED, FILLER, PREPARED = "unskipped", "no_case", "prepared"
"""Values of ``MARK`` for exported elements that stand for no step.

``UNSKIPPED`` marks a Sequence that turns a skip into a success, ``FILLER`` a child for a case that the switch lacks.
``PREPARED`` marks a Sequence of a Script, which calculates values, and the node that reads them by its ports.
"""

STEP_DESCRIPTION = "mission step "
"""First words of the description of a custom node in ``TreeNodesModel``; the word of its step follows in quotes."""

RESULT = "result"
"""Name of the output port for the result of an exported leaf."""
