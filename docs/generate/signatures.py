"""Signatures, fields and methods of public names, as their source has them."""

import ast
from collections.abc import Iterator

from generate import markdown
from generate.source import Definition, Module, find_definition, list_public, list_targets

SHOWN = {"property", "cached_property"}
"""Decorators of methods that are read as fields are."""
KEPT = {"classmethod", "staticmethod", "contextmanager", "dataclass"}
"""Decorators that a caller has to know."""
Member = tuple[Module, list[ast.stmt], int]
"""A statement in the body of a class of a module."""


def describe_function(module: Module, node: ast.FunctionDef) -> Iterator[str]:
    """Yield the signature of a function and its docstring."""
    yield markdown.python(write_signature(module, node))
    yield markdown.docstring(ast.get_docstring(node) or "")


def write_signature(module: Module, node: ast.FunctionDef, name: str = "") -> str:
    """Return the signature of a function: on one line if it fits, else a line an argument."""
    arguments = list_arguments(module, node)
    returns = f" -> {module.segment(node.returns)}" if node.returns is not None else ""
    head = "".join(f"@{text}\n" for text in _list_decorators(module, node))
    return head + wrap(name or node.name, arguments, returns)


def wrap(name: str, arguments: list[str], end: str = "") -> str:
    """Return a call of so many arguments, on one line if it fits."""
    line = f"{name}({', '.join(arguments)}){end}"
    if len(line) <= markdown.WIDTH:
        return line
    return "\n".join([f"{name}(", *(f"    {argument}," for argument in arguments), f"){end}"])


def list_arguments(module: Module, node: ast.FunctionDef) -> list[str]:
    """List the arguments of a function with types and defaults, without those of a method."""
    given = node.args
    positional = [*given.posonlyargs, *given.args]
    defaults = [None] * (len(positional) - len(given.defaults)) + list(given.defaults)
    listed = [_argument(module, *pair) for pair in zip(positional, defaults, strict=True)]
    if positional and positional[0].arg in ("self", "cls") and positional[0].annotation is None:
        listed = listed[1:]
    if given.vararg:
        listed.append("*" + _argument(module, given.vararg, None))
    elif given.kwonlyargs:
        listed.append("*")
    pairs = zip(given.kwonlyargs, given.kw_defaults, strict=True)
    listed += [_argument(module, *pair) for pair in pairs]
    return [*listed, *(["**" + _argument(module, given.kwarg, None)] if given.kwarg else [])]


def _argument(module: Module, argument: ast.arg, default: ast.expr | None) -> str:
    text = argument.arg
    if argument.annotation is not None:
        text += f": {module.segment(argument.annotation)}"
    if default is None:
        return text
    equals = " = " if argument.annotation is not None else "="
    return f"{text}{equals}{module.segment(default)}"


def _list_decorators(module: Module, node: ast.FunctionDef | ast.ClassDef) -> list[str]:
    texts = [module.segment(decorator) for decorator in node.decorator_list]
    return [text for text in texts if text.partition("(")[0] in KEPT]


def describe_class(definition: Definition, name: str, level: str) -> Iterator[str]:
    """Yield the head of a class, its docstring, its fields and properties, and its methods."""
    module, node = definition.module, definition.node
    assert isinstance(node, ast.ClassDef)
    inherited = _list_members(module, node)  # a later member replaces one of the same name
    members = list({_name(member[1][member[2]]): member for member in inherited}.values())
    yield markdown.python(_write_head(module, node, name))
    yield markdown.docstring(ast.get_docstring(node) or "")
    yield "\n".join(line for member in members for line in _describe_field(*member))
    for home, body, index in members:
        method = body[index]
        if isinstance(method, ast.FunctionDef) and not _is_listed(home, method):
            yield f"{level} `{name}.{method.name}`"
            yield from describe_function(home, method)


def _write_head(module: Module, node: ast.ClassDef, name: str) -> str:
    """Return the line that begins a class, or how one is made if it has a constructor."""
    decorators = "".join(f"@{text}\n" for text in _list_decorators(module, node))
    bases = [module.segment(base) for base in node.bases]
    head = f"{decorators}class {name}({', '.join(bases)})" if bases else f"{decorators}class {name}"
    for item in node.body:
        if isinstance(item, ast.FunctionDef) and item.name == "__init__":
            return f"{head}\n\n{wrap(name, list_arguments(module, item))}"
    return head


def _list_members(module: Module, node: ast.ClassDef) -> Iterator[Member]:
    """Yield the public members of a class, after those of bases that are not public."""
    for base in node.bases:
        name = base.id if isinstance(base, ast.Name) else ""
        if name in module.definitions or name in module.imports:
            inherited = find_definition(module, name)
            if isinstance(inherited, Definition) and inherited.node not in list_public():
                assert isinstance(inherited.node, ast.ClassDef)
                yield from _list_members(inherited.module, inherited.node)
    for index, item in enumerate(node.body):
        if not _name(item).startswith("_"):
            yield module, node.body, index


def _name(member: ast.stmt) -> str:
    """Return the name of a member; ``_`` for what is none, such as a docstring."""
    return next(list_targets(member), "_")


def _is_listed(module: Module, node: ast.FunctionDef) -> bool:
    """Whether a method is described in one line: a property, or a test, which nobody calls."""
    decorators = map(module.segment, node.decorator_list)
    return node.name.startswith("test_") or any(text in SHOWN for text in decorators)


def _describe_field(module: Module, body: list[ast.stmt], index: int) -> Iterator[str]:
    """Yield the line of a field, a property or a test."""
    node = body[index]
    if isinstance(node, ast.AnnAssign):
        about = module.describe(body, index)
        text = f"{module.segment(node.target)}: {_unwrap(module, node.annotation)}"
        default = _find_default(module, node.value)
        yield _item(f"{text} = {default}" if default else text, about)
    elif isinstance(node, ast.FunctionDef) and _is_listed(module, node):
        returns = module.segment(node.returns) if node.returns is not None else "Any"
        text = node.name if node.name.startswith("test_") else f"{node.name}: {returns}"
        yield _item(text, ast.get_docstring(node) or "")


def _item(text: str, about: str) -> str:
    meaning = markdown.prose(" ".join(about.split()))
    return f"- `{text}`: {meaning}" if meaning else f"- `{text}`"


def _unwrap(module: Module, annotation: ast.expr) -> str:
    """Return a type without the rules that it is annotated with."""
    inner = annotation.slice if isinstance(annotation, ast.Subscript) else None
    if isinstance(inner, ast.Tuple) and module.segment(annotation).startswith("Annotated["):
        return module.segment(inner.elts[0])
    return module.segment(annotation)


def _find_default(module: Module, value: ast.expr | None) -> str:
    """Return the default of a field; of a factory, its call."""
    if value is None:
        return ""
    if isinstance(value, ast.Name):
        return _find_constant(module, value.id)
    if not isinstance(value, ast.Call) or module.segment(value.func) != "field":
        return module.segment(value)
    keywords = {item.arg: item.value for item in value.keywords}
    if "default_factory" in keywords:
        return f"{module.segment(keywords['default_factory'])}()".replace("dict()", "{}")
    return module.segment(keywords["default"]) if "default" in keywords else ""


def _find_constant(module: Module, name: str) -> str:
    """Return the value that a name stands for, or the name if that is not a plain value."""
    definition = find_definition(module, name)
    node = definition.node if isinstance(definition, Definition) else None
    if not isinstance(definition, Definition) or not isinstance(node, ast.Assign):
        return name
    values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]
    value = dict(zip(list_targets(node), values, strict=False)).get(definition.name)
    return definition.module.segment(value) if isinstance(value, ast.Constant) else name
