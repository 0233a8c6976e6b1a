"""Cameras: a device, a video, a stream or a folder of pictures."""
