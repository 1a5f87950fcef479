"""Packages that are not installed with evoros itself, but with one of its extras."""

from collections.abc import Iterator
from contextlib import contextmanager

from evoros.base.errors import InputError


@contextmanager
def require_extra(extra: str, need: str, failure: type[InputError] = InputError) -> Iterator[None]:
    """Raise a ``failure`` if a package that is imported inside is not installed.

    ``need`` names the choice or the command that needs the package.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        raise failure(
            f"{need}: needs the package {package}, which is not installed; type: pip install "
            f"'evoros[{extra}]'"
        ) from None
