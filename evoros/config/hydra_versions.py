"""What evoros asks of Hydra 1.3 with OmegaConf 2.3, and of Hydra 1.4 with OmegaConf 2.4."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hydra import utils
from omegaconf import OmegaConf

IS_LATER = hasattr(utils, "execution_whitelist")
"""Whether this is 1.4 or later."""
VERSION_BASE: Mapping[str, Any] = {} if IS_LATER else {"version_base": "1.3"}
"""The version whose defaults evoros relies on; later versions have no others."""


def allow(targets: Sequence[str]) -> Mapping[str, Any]:
    """Return the argument of ``instantiate`` by which Hydra calls nothing but these classes.

    Hydra 1.3 has none.
    """
    return {"_execution_whitelist_": tuple(targets)} if IS_LATER else {}


def register_resolver(name: str, resolver: Callable[..., Any]) -> None:
    """Register a resolver; OmegaConf 2.4 has given the function the name of an older one."""
    method = "register_resolver" if IS_LATER else "register_new_resolver"
    getattr(OmegaConf, method)(name, resolver, replace=True)
