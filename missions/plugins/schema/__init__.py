"""JSON Schemas of missions and other files: completion, help and errors in YAML editors."""
