"""Definitions of public names, read from the source: nothing is imported, nothing is guessed."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

ROOT = Path(__file__).parents[2]
PUBLIC = ("evoros", "evoros.parts", "evoros.testing", "evoros.analysis")
"""The public modules; every name of their ``__all__`` is in one of them alone."""


@dataclass(frozen=True)
class Module:
    """A module of evoros by its source."""

    name: str
    path: Path

    @cached_property
    def text(self) -> str:
        """The source."""
        return self.path.read_text()

    @cached_property
    def lines(self) -> list[str]:
        """The lines of the source."""
        return self.text.splitlines()

    @cached_property
    def tree(self) -> ast.Module:
        """The syntax tree of the source."""
        return ast.parse(self.text)

    @cached_property
    def public(self) -> dict[str, list[str]]:
        """The names of ``__all__`` by the comments above them; without comments, the key is empty.

        A comment that stands alone on a line begins a group.
        """
        node = self.definitions["__all__"]
        groups: dict[str, list[str]] = {"": []}
        title = ""
        for line in self.lines[node.lineno : node.end_lineno]:
            if comment := re.fullmatch(r"\s*# (.*?)\.?", line):
                title = comment[1]
                groups[title] = []
            groups[title] += re.findall(r'"(\w+)"', line)
        return {name: names for name, names in groups.items() if names}

    @cached_property
    def definitions(self) -> dict[str, ast.stmt]:
        """The statements at the top that define a name."""
        return {name: node for node in self.tree.body for name in list_targets(node)}

    @cached_property
    def imports(self) -> dict[str, tuple[str, str]]:
        """The module and the name there of each name that is imported, also for types alone."""
        return {
            alias.asname or alias.name: (self._resolve(node), alias.name)
            for node in ast.walk(self.tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }

    def _resolve(self, node: ast.ImportFrom) -> str:
        package = self.name.split(".")
        if self.path.name != "__init__.py":
            package.pop()
        base = package[: len(package) - node.level + 1] if node.level else []
        return ".".join([*base, *filter(None, [node.module])])

    def segment(self, node: ast.AST) -> str:
        """Return the source of an expression on one line."""
        return " ".join((ast.get_source_segment(self.text, node) or "").split())

    def describe(self, body: list[ast.stmt], index: int) -> str:
        """Return the text on a statement: comments above and beside it, and the string below."""
        node = body[index]
        above: list[str] = []
        start = node.lineno - 2
        while re.match(r"\s*# (?!fmt:)", self.lines[start]):
            above.insert(0, self.lines[start].strip().removeprefix("# "))
            start -= 1
        lines = self.lines[node.lineno - 1 : node.end_lineno]
        beside = [match[1] for line in lines if (match := re.search(r"\s# (?!noqa)(.*)$", line))]
        following = body[index + 1] if index + 1 < len(body) else None
        below = string_of(following) if following is not None else ""
        return " ".join([*above, *beside, " ".join(below.split())]).strip()


@dataclass(frozen=True)
class Definition:
    """The statement that defines a public name, in its module."""

    module: Module
    name: str  # there
    node: ast.stmt

    @property
    def docstring(self) -> str:
        """The docstring of a class or function, or the text on an assignment."""
        if isinstance(self.node, ast.ClassDef | ast.FunctionDef):
            return ast.get_docstring(self.node) or ""
        body = self.module.tree.body
        return self.module.describe(body, body.index(self.node))


@cache
def find_module(name: str) -> Module | None:
    """Find a module of evoros by its name; None if there is none."""
    path = ROOT.joinpath(*name.split("."))
    for file in (path / "__init__.py", path.with_suffix(".py")):
        if file.is_file():
            return Module(name, file)
    return None


def find_definition(module: Module, name: str) -> Definition | Module | str:
    """Find what a name in a module stands for: a definition, a module, or a name elsewhere."""
    if name in module.definitions:
        return Definition(module, name, module.definitions[name])
    home, original = module.imports[name]
    source = find_module(home) if home.startswith("evoros") else None
    if source is None:
        return f"{home}.{original}"
    return find_module(f"{home}.{original}") or find_definition(source, original)


@cache
def list_public() -> frozenset[ast.stmt]:
    """List the statements that define a public name."""
    modules = filter(None, map(find_module, PUBLIC))
    definitions = (
        find_definition(module, name)
        for module in modules
        for names in module.public.values()
        for name in names
    )
    return frozenset(item.node for item in definitions if isinstance(item, Definition))


def list_targets(node: ast.stmt) -> Iterator[str]:
    """Yield the names that a statement defines."""
    if isinstance(node, ast.ClassDef | ast.FunctionDef):
        yield node.name
    targets = node.targets if isinstance(node, ast.Assign) else []
    if isinstance(node, ast.AnnAssign):
        targets = [node.target]
    for target in targets:
        for item in target.elts if isinstance(target, ast.Tuple) else [target]:
            if isinstance(item, ast.Name):
                yield item.id


def string_of(node: ast.stmt) -> str:
    """Return the text of a statement that is a string alone, as a docstring is."""
    value = node.value if isinstance(node, ast.Expr) else None
    text = value.value if isinstance(value, ast.Constant) else None
    return text if isinstance(text, str) else ""
