"""The licence of a study, by its SPDX identifier."""

import re
from typing import Any

from evoros.base.errors import InputError

_IDENTIFIER = re.compile(r"[A-Za-z0-9][A-Za-z0-9.+-]*")


def check_licence(identifier: str | None) -> None:
    """Require that a licence is named as SPDX does."""
    if identifier is not None and not _IDENTIFIER.fullmatch(identifier):
        raise InputError(
            f"--license: must be an SPDX identifier such as CC-BY-4.0, not {identifier!r}; see "
            f"https://spdx.org/licenses"
        )


def describe_licence(identifier: str | None) -> dict[str, Any]:
    """Return the licence as metadata."""
    if identifier is None:
        return {
            "@id": "#license",
            "@type": "CreativeWork",
            "name": "No licence was chosen",
            "description": "The authors have not said what others may do with this study.",
        }
    return {
        "@id": f"https://spdx.org/licenses/{identifier}",
        "@type": "CreativeWork",
        "name": identifier,
        "description": f"The licence {identifier} of SPDX.",
    }
