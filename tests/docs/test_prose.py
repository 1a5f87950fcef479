"""The prose of code, configuration and documents keeps the rules of ``tests/prose.py``."""

import pytest
from prose import RULES, Passage, list_breaches, list_passages


@pytest.fixture(scope="module")
def passages() -> list[Passage]:
    return list(list_passages())


@pytest.mark.parametrize("name", RULES)
def test_prose_keeps_the_rule(name: str, passages: list[Passage]) -> None:
    breaches = list_breaches(RULES[name], passages)
    assert not breaches, f"{name}:\n" + "\n".join(breaches)


@pytest.mark.parametrize(
    ("name", "kind", "text"),
    [
        ("a summary is an imperative or a noun phrase", "summary", "Whether the run is finished."),
        ("a comment does not begin with a preposition", "comment", "of each generation"),
        ("minimum or maximum", "docstring", "the least of the ranges"),
        ("the number of", "message", "how many trials it takes"),
        ("a noun in place of that of, those of", "page", "longer than that of the first"),
        ("its own", "summary", "A robot with a home of its own."),
        ("plain adverbs", "page", "written anew"),
        ("next to", "page", "beside the course"),
        ("not found", "message", "must be a folder, and is none"),
    ],
)
def test_each_rule_finds_what_it_is_made_for(name: str, kind: str, text: str) -> None:
    assert list_breaches(RULES[name], [Passage(kind, "here:1", text)])
    fine = "Return True if at least one run has at most 3 trials; the number of runs is 2."
    assert not list_breaches(RULES[name], [Passage(kind, "here:1", fine)])
