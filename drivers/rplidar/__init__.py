"""RPLIDAR A1 and A2: rotating range finders with a serial protocol."""
