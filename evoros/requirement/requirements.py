"""The requirements of an evaluation, by name."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

from evoros.base.checks import NAME, list_rules, mapping_of
from evoros.base.errors import InputError
from evoros.requirement.claim import Claim
from evoros.requirement.quantity import require_column
from evoros.requirement.survival import Survival
from evoros.worst_cases.worst_cases import WorstCases

A_CLAIM = "requirements (evoros.requirement.requirements.collect)"
Requirement = Claim | Survival
REQUIREMENTS = mapping_of(Requirement, A_CLAIM)


def collect(**requirements: Mapping[str, Any]) -> dict[str, Requirement]:
    """Make requirements of their fields, by name.

    Raises:
        InputError: a field is unknown or out of range, or two requirements contradict each other.
    """
    made = {name: _make(name, fields) for name, fields in requirements.items()}
    claims = {name: claim for name, claim in made.items() if isinstance(claim, Claim)}
    for (first, one), (second, other) in combinations(claims.items(), 2):
        if _contradict(one, other):
            raise InputError(
                f"requirements.{first} and requirements.{second}: cannot both be met "
                f"({one.text}; {other.text}); correct one of the two"
            )
    return made


def _make(name: str, fields: Any) -> Requirement:
    key = f"requirements.{name}"
    if not NAME.holds(name):
        raise InputError(f"{key}: must be {NAME.text}; rename it")
    if not isinstance(fields, Mapping):
        raise InputError(
            f"{key}: must be a mapping, as in {{of: completed, at_least: 0.9}}, not {fields!r}; "
            f"correct it"
        )
    kind, first = (Survival, "survives") if "survives" in fields else (Claim, "of")
    known = [rule_of for rule_of, _, _ in list_rules(kind)]
    unknown = [field for field in fields if field not in known]
    if unknown or first not in fields:
        raise InputError(
            f"{key}: must have the key {first}, and no others than {', '.join(known)}, not "
            f"{', '.join(map(str, unknown or fields))}; correct it"
        )
    try:
        return kind(**fields)
    except InputError as error:
        raise InputError(f"{key}: {error}") from None


def check_requirements(
    requirements: Mapping[str, Requirement],
    worlds: Sequence[str],
    agents: Sequence[str],
    worst_cases: WorstCases | None,
) -> None:
    """Require that missions have what requirements are about.

    Raises:
        InputError: a requirement names a column or a world that missions do not have, or needs a
            search that does not look far enough.
    """
    for name, claim in requirements.items():
        if isinstance(claim, Survival):
            most = 0 if worst_cases is None else worst_cases.most
            if claim.survives > most:
                raise InputError(
                    f"requirements.{name}.survives: needs a search of the cases of so many "
                    f"sensors, not of {most}; add worst_cases=search worst_cases.most="
                    f"{claim.survives}"
                )
            continue
        if isinstance(claim.of, str):
            require_column(f"requirements.{name}.of", claim.of, agents)
        if claim.world is not None and claim.world not in worlds:
            raise InputError(
                f"requirements.{name}.world: must be one of {', '.join(worlds)}, not "
                f"{claim.world!r}; choose one of these"
            )


def _contradict(one: Claim, other: Claim) -> bool:
    """Whether no missions can meet both."""
    if one.of != other.of or one.world != other.world:
        return False
    for lower, upper in ((one, other), (other, one)):
        if lower.at_least is None or upper.at_most is None or lower.at_least <= upper.at_most:
            continue
        shares = (lower.share, upper.share)
        if shares == (None, None) or (None not in shares and sum(map(float, shares)) > 1):  # type: ignore[arg-type]
            return True
    return False
