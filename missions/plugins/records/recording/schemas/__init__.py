"""What the messages of a record look like: a JSON Schema (draft 2020-12) for each. A test holds their bytes."""

import json

from missions.plugins.records.recording.schemas.definitions import FOXGLOVE_SCHEMAS, MISSIONTREE_SCHEMAS


def schema(name: str) -> bytes:
    """Return the schema of that name, ``foxglove.Log`` or ``missiontree.Moment``, without blanks."""
    found = MISSIONTREE_SCHEMAS.get(name) or FOXGLOVE_SCHEMAS[name]
    described = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": name, **found}
    return json.dumps(described, separators=(",", ":"), ensure_ascii=False).encode()
