"""The pages of the Python interface: every public name with its signature and docstring."""

import ast
from collections.abc import Iterator

from generate import markdown
from generate.signatures import describe_class, describe_function, list_arguments
from generate.source import PUBLIC, Definition, Module, find_definition, find_module, list_targets


def write_pages() -> Iterator[tuple[str, str]]:
    """Yield the name and the text of the page of each public module that there is."""
    for module in filter(None, map(find_module, PUBLIC)):
        yield f"{module.name.replace('evoros', 'api').replace('.', '_')}.md", _write_page(module)


def _write_page(module: Module) -> str:
    about = markdown.docstring(ast.get_docstring(module.tree) or "")
    parts = [f"# Module `{module.name}`", about]
    for title, names in module.public.items():
        parts += [f"## {title}"] if title else []
        level = "###" if title else "##"
        parts += [_describe(entry, level) for entry in _group(module, names)]
    return markdown.page(parts)


Entry = list[tuple[str, Definition | Module | str]]
"""Public names that one statement defines, and their definitions."""


def _group(module: Module, names: list[str]) -> list[Entry]:
    """Group the names that the same statement defines, each with its definition."""
    groups: dict[object, Entry] = {}
    for name in names:
        definition = find_definition(module, name)
        key = id(definition.node) if isinstance(definition, Definition) else name
        groups.setdefault(key, []).append((name, definition))
    return list(groups.values())


def _describe(entry: Entry, level: str) -> str:
    heading = f"{level} {', '.join(f'`{name}`' for name, _ in entry)}"
    name, definition = entry[0]
    if isinstance(definition, str):
        return markdown.join([heading, f"`{definition}`, as its library documents it."])
    if isinstance(definition, Module):
        return markdown.join([heading, *_list_functions(definition)])
    if isinstance(definition.node, ast.ClassDef):
        return markdown.join([heading, *describe_class(definition, name, f"{level}#")])
    if isinstance(definition.node, ast.FunctionDef):
        return markdown.join([heading, *describe_function(definition.module, definition.node)])
    return markdown.join([heading, *_describe_value(entry, definition)])


def _list_functions(module: Module) -> Iterator[str]:
    """Describe a module that is a public name: its docstring, and its functions in a line each."""
    yield markdown.docstring(ast.get_docstring(module.tree) or "")
    lines = []
    for name in (name for names in module.public.values() for name in names):
        definition = find_definition(module, name)
        if isinstance(definition, Definition) and isinstance(definition.node, ast.FunctionDef):
            arguments = ", ".join(list_arguments(definition.module, definition.node))
            lines.append(f"- `{name}({arguments})`: {markdown.prose(definition.docstring)}")
    yield "\n".join(lines)


def _describe_value(entry: Entry, definition: Definition) -> Iterator[str]:
    """Describe values by their source, with the names under which they are public."""
    module, node = definition.module, definition.node
    public = {d.name: name for name, d in entry if isinstance(d, Definition)}
    left = ", ".join(public.get(name, name) for name in list_targets(node))
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple):
        names = [item.id for item in node.targets[0].elts if isinstance(item, ast.Name)]
        left = ", ".join(public.get(name, name) for name in names)
    value = node.value if isinstance(node, ast.Assign | ast.AnnAssign) else None
    yield markdown.python(f"{left} = {module.segment(value) if value is not None else '...'}")
    yield markdown.prose(definition.docstring)
