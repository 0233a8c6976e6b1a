"""RPLIDAR A1 and A2: range finders that turn, over their serial protocol."""
