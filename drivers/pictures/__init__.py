"""Pictures of cameras: decoding, rotation, and a thread that always has the newest picture ready."""
