"""What fresh draws say of a champion, from its certificate."""

import json
from typing import Any

from evoros.base.errors import InputError
from evoros.storage.verification import read_text

from .records import Record


def describe_rates(record: Record) -> dict[str, str]:
    """Describe, by world, how often the champion completed it on fresh draws, with the interval.

    Worlds without such draws are left out.
    """
    certificate = _read_certificate(record)
    return {
        str(world): (
            f"fresh draws: {rate['completed']}/{rate['trials']} "
            f"[{100 * rate['low']:.0f}, {100 * rate['high']:.0f} %]"
        )
        for world, rate in certificate.get("worlds", {}).items()
        if rate["trials"]
    }


def _read_certificate(record: Record) -> dict[str, Any]:
    path = record.path / "champion" / "certificate.json"
    try:
        return dict(json.loads(read_text(path)))
    except ValueError as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error
