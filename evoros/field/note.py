"""The comment in the SDF file of a generated world: all that its field was drawn from."""

import json
from collections.abc import Mapping


def write_note(values: Mapping[str, object]) -> str:
    """Write each value on a line of its own as JSON, after its name."""
    lines = (f"{key}: {json.dumps(value, default=_describe)}" for key, value in values.items())
    text = "\n".join(lines).replace("--", "-\\u002d")  # XML allows no -- in a comment
    return f"A field that evoros generated from\n{text}\n"


def _describe(part: object) -> dict[str, object]:
    """Return the values of a part and its type by name: a file must not depend on module paths."""
    return {"type": type(part).__name__.lower(), **vars(part)}
