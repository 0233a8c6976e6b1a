"""The types of ROS 2 that rosbags lacks, as their packages define them: of Nav2, Create 3, vision, and our own."""

from collections.abc import Mapping

UUID, TIME, HEADER = "unique_identifier_msgs/UUID", "builtin_interfaces/Time", "std_msgs/Header"

MESSAGES: Mapping[str, str] = {
    "irobot_create_msgs/msg/HazardDetection": "std_msgs/Header header\nuint8 type",
    "irobot_create_msgs/msg/HazardDetectionVector": (
        "std_msgs/Header header\nirobot_create_msgs/HazardDetection[] detections"
    ),
    "irobot_create_msgs/msg/DockStatus": "std_msgs/Header header\nbool dock_visible\nbool is_docked",
    "irobot_create_msgs/msg/LedColor": "uint8 red\nuint8 green\nuint8 blue",
    "irobot_create_msgs/msg/LightringLeds": (
        "std_msgs/Header header\nirobot_create_msgs/LedColor[6] leds\nbool override_system"
    ),
    "irobot_create_msgs/msg/AudioNote": "uint16 frequency\nbuiltin_interfaces/Duration max_runtime",
    "irobot_create_msgs/msg/AudioNoteVector": (
        "std_msgs/Header header\nirobot_create_msgs/AudioNote[] notes\nbool append"
    ),
    "turtlebot3_msgs/msg/SensorState": (
        "std_msgs/Header header\nuint8 bumper\nfloat32 cliff\nfloat32 sonar\nfloat32 illumination\nuint8 led\n"
        "uint8 button\nbool torque\nint32 left_encoder\nint32 right_encoder\nfloat32 battery"
    ),
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id"
    ),
    "vision_msgs/msg/Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
}
"""Messages: their fields, one a line."""

SERVICES: Mapping[str, tuple[str, str]] = {
    "std_srvs/srv/Empty": ("", ""),
    "std_srvs/srv/Trigger": ("", "bool success\nstring message"),
    "std_srvs/srv/SetBool": ("bool data", "bool success\nstring message"),
    "example_interfaces/srv/AddTwoInts": ("int64 a\nint64 b", "int64 sum"),
    "action_msgs/srv/CancelGoal": (
        "action_msgs/GoalInfo goal_info",
        "int8 return_code\naction_msgs/GoalInfo[] goals_canceling",
    ),
    "irobot_create_msgs/srv/ResetPose": ("geometry_msgs/Pose pose", "bool success"),
    "nav2_msgs/srv/ClearEntireCostmap": ("std_msgs/Empty request", "std_msgs/Empty response"),
}
"""Services: what is asked, and what is answered."""

_NAVIGATED = "uint16 error_code\nstring error_msg"
"""Of Kilted on; Jazzy has ``error_code`` alone, Humble a ``std_msgs/Empty``. See ``Types.decoded``."""

_PROGRESS = (
    "geometry_msgs/PoseStamped current_pose\nbuiltin_interfaces/Duration navigation_time\n"
    "builtin_interfaces/Duration estimated_time_remaining\nint16 number_of_recoveries\nfloat32 distance_remaining"
)

ACTIONS: Mapping[str, tuple[str, str, str]] = {
    "nav2_msgs/action/NavigateToPose": (
        "geometry_msgs/PoseStamped pose\nstring behavior_tree",
        _NAVIGATED,
        _PROGRESS,
    ),
    "nav2_msgs/action/NavigateThroughPoses": (
        "geometry_msgs/PoseStamped[] poses\nstring behavior_tree",
        _NAVIGATED,
        f"{_PROGRESS}\nint16 number_of_poses_remaining",
    ),
    "nav2_msgs/action/Spin": (
        "float32 target_yaw\nbuiltin_interfaces/Duration time_allowance",
        "builtin_interfaces/Duration total_elapsed_time\nuint16 error_code",
        "float32 angular_distance_traveled",
    ),
    "irobot_create_msgs/action/Dock": ("", "bool is_docked", "bool sees_dock"),
    "irobot_create_msgs/action/Undock": ("", "bool is_docked", ""),
    "missiontree_msgs/action/RunMission": (
        "string mission\nstring parameters",
        "string status\nstring reason",
        "string running",
    ),
}
"""Actions: goal, result, feedback."""
