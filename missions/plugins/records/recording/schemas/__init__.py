"""JSON Schemas (draft 2020-12) of the messages of a record.

A test compares the text of each schema, so that no change of a message goes unnoticed.
"""

import json

from missions.plugins.records.recording.schemas.definitions import FOXGLOVE_SCHEMAS, MISSIONTREE_SCHEMAS


def schema(name: str) -> bytes:
    """Return a schema by name, such as ``foxglove.Log`` or ``missiontree.Moment``, as compact JSON."""
    found = MISSIONTREE_SCHEMAS.get(name) or FOXGLOVE_SCHEMAS[name]
    described = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": name, **found}
    return json.dumps(described, separators=(",", ":"), ensure_ascii=False).encode()
