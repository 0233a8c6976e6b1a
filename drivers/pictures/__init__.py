"""Pictures from any feed: decoding, rotation, and a capture thread."""
