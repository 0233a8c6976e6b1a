"""Options of `mission run` for publishing a run to ROS 2."""

from drivers.api.fast_dataclass import dataclass
from missions.options import ROS2, option
from missions.request import RunOptions


@dataclass(frozen=True, kw_only=True)
class Ros2Options(RunOptions):
    """Options for publishing a run to ROS 2."""

    ros2: bool = option(
        "Report the run to ROS 2: topics /mission/tree, variables, detections, events.", default=False, group=ROS2
    )
    ros2_router: str | None = option(
        "The router, instead of the robot's: tcp/127.0.0.1:7447.", metavar="ADDRESS", group=ROS2
    )
