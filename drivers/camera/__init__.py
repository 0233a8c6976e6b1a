"""Cameras: pictures of a device, a video, a stream or a folder."""
