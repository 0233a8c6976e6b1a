"""The JSON Schema of missions: completion, hover help and mistakes while typing, in any editor that knows YAML."""
