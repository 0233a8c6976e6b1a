"""Pictures from any feed: decoded, turned, and held ready by a thread."""
