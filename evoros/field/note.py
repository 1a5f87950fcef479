"""The comment of a drawn world, with all that it follows from."""

import json
from collections.abc import Mapping


def write_note(kind: str, values: Mapping[str, object]) -> str:
    """Return the comment of a drawn SDF file: a line for each value as JSON, after its name."""
    lines = (f"{key}: {json.dumps(value, default=_describe)}" for key, value in values.items())
    text = "\n".join(lines).replace("--", "-\\u002d")  # XML allows no -- in a comment
    return f"A {kind} that evoros generated from\n{text}\n"


def _describe(part: object) -> dict[str, object]:
    """Return the values of a part and its type by name: a file must not depend on module paths."""
    return {"type": type(part).__name__.lower(), **vars(part)}
