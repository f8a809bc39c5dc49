"""Public names that are fetched when they are first asked for: a program pays for what it uses.

A package gives `later` what stands where, as its `__getattr__`. Type checkers read the plain imports beside it, under
`TYPE_CHECKING`, and do not see the function: they would take any name for one of ours. Tests compare the two.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from types import ModuleType

__all__ = ["later"]


def later(package: str, homes: Mapping[str, Sequence[str]], modules: Sequence[str] = ()) -> Callable[[str], object]:
    """The `__getattr__` of *package*.

    Args:
        package: Its name.
        homes: The names that each of its modules has.
        modules: Modules that are public themselves.
    """

    def fetch(name: str) -> object:
        if name in modules:
            return _loaded(f"{package}.{name}")
        home = next((home for home, names in homes.items() if name in names), None)
        if home is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        from drivebus.plain_annotations import plain_annotations

        found: object = plain_annotations(getattr(_loaded(f"{package}.{home}"), name))
        setattr(sys.modules[package], name, found)
        return found

    return fetch


def _loaded(module: str) -> ModuleType:
    """The module of that name; where the compiled core cannot be loaded, the error says what to do."""
    try:
        return import_module(module)
    except ImportError as error:
        if "_native" not in str(error):
            raise
        import sysconfig

        this = f"{sys.implementation.name} {sys.version.split()[0]} on {sysconfig.get_platform()}"
        raise ImportError(
            f"drivebus has no compiled part for this {this}: install the wheel that is for it, with "
            f"`{sys.executable} -m pip install --force-reinstall drivebus` ({error})"
        ) from None
