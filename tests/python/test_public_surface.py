"""The public surface, frozen: names, signatures, defaults, and that each has a docstring.

`public_surface.txt` is what users of drivebus rely on, one line a name. Where a line changes, a program somewhere
breaks: who means it writes the new lines with `python -m tests.python.test_public_surface` and says so in CHANGELOG.md.
"""

from __future__ import annotations

import asyncio
import enum
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest

import drivebus
import drivebus.aio
from drivebus import doctor, record, rtu, sim
from drivebus.cli import cli

FROZEN = Path(__file__).with_name("public_surface.txt")

NOT_MEANT = {
    "drivebus.Bus.around",
    *(
        f"drivebus.aio.Drive.{name}"
        for name in ("over", "trusting", "output_frequency", "end_jog", "has_jog_stop", "ask_setpoint")
    ),
}
"""Names that were to be seen by accident, and are promised to nobody."""


def surface() -> Iterator[str]:
    """Each public name with its signature."""
    instances = _instances()
    for module in (drivebus, drivebus.aio, doctor, record, rtu, sim):
        for name in module.__all__:
            yield from _of(f"{module.__name__}.{name}", getattr(module, name), instances)
    yield from _commands("drivebus", cli)


def _of(path: str, what: object, instances: dict[type, object]) -> Iterator[str]:
    if inspect.isclass(what):
        yield f"{path}{'' if issubclass(what, enum.Enum) else _signature(what)}{_undocumented(what)}"
        if issubclass(what, enum.Enum):
            yield from (f"{path}.{member.name} = {member.value!r}" for member in what)
        yield from _members(path, what)
        yield from (f"{path}().{name}" for name in sorted(_attributes(instances.get(what))) if not hasattr(what, name))
    elif callable(what):
        yield _function(path, what)
    elif inspect.ismodule(what):
        yield f"{path}: module"
    else:
        yield f"{path}: {type(what).__name__}"


def _members(path: str, kind: type) -> Iterator[str]:
    for name in sorted(dir(kind)):
        if (name.startswith("_") and name not in ("__enter__", "__aenter__", "__await__", "__iter__", "__aiter__")) or (
            f"{path}.{name}" in NOT_MEANT
        ):
            continue
        owner = next((owner for owner in kind.__mro__ if name in vars(owner)), type)
        if not owner.__module__.startswith("drivebus") or issubclass(kind, enum.Enum):
            continue
        raw = inspect.getattr_static(kind, name)
        if callable(raw) or isinstance(raw, (classmethod, staticmethod)):
            yield _function(
                f"{path}.{name}", getattr(kind, name), bound=not isinstance(raw, (classmethod, staticmethod))
            )
        else:
            is_property = isinstance(raw, property)
            settable = raw.fset is not None if is_property else hasattr(type(raw), "__set__")
            yield f"{path}.{name}: {'attribute' if settable else 'value'}{_undocumented(raw) if is_property else ''}"


def _function(path: str, what: Any, *, bound: bool = False) -> str:
    is_async = inspect.iscoroutinefunction(what) or inspect.isasyncgenfunction(what)
    return f"{'async ' * is_async}{path}{_signature(what, bound=bound)}{_undocumented(what)}"


def _signature(what: Any, *, bound: bool = False) -> str:
    """Parameters and defaults; of a method (*bound*) without the object itself, whatever it is called inside."""
    try:
        signature = inspect.signature(what)
    except (TypeError, ValueError):
        return "(…)"
    bare = [one.replace(annotation=inspect.Parameter.empty) for one in signature.parameters.values()]
    return str(signature.replace(parameters=bare[bound:], return_annotation=inspect.Signature.empty))


def _undocumented(what: object) -> str:
    return "" if (inspect.getdoc(what) or "").strip() else "  # no docstring"


def _attributes(instance: object) -> set[str]:
    return {name for name in dir(instance) if not name.startswith("_")}


def _instances() -> dict[type, object]:
    """One of each class whose attributes are made with it."""
    made: dict[type, object] = {}
    with drivebus.Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        with drivebus.Bus(simulator) as bus:
            drive = bus.drive(1)
            with bus.poll({drive: ["output_current"]}) as poll:
                made |= {type(each): each for each in (simulator, bus, drive, drive.profile, poll, bus.stats())}
            made[drivebus.Backup] = drive.backup()

        async def awaited() -> None:
            async with drivebus.aio.Bus(simulator) as bus:
                drive = await bus.drive(1)
                async with bus.poll({drive: ["output_current"]}) as poll:
                    made.update({type(each): each for each in (bus, drive, poll)})

        asyncio.run(awaited())
    return made


def _commands(path: str, command: click.Command) -> Iterator[str]:
    yield f"$ {path}{_undocumented(command.callback)}"
    for option in command.params:
        names = " ".join([*option.opts, *option.secondary_opts])
        told = [f"{type(option).__name__.lower()} {names}"]
        told += [f"default {option.default!r}"] * isinstance(option.default, (bool, int, float, str))
        told += [f"nargs {option.nargs}"] * (option.nargs != 1)
        told += ["required"] * option.required + ["flag"] * bool(getattr(option, "is_flag", False))
        told += ["many"] * option.multiple + [f"${option.envvar}"] * (option.envvar is not None)
        if isinstance(option.type, click.Choice):
            told.append(f"one of {', '.join(option.type.choices)}")
        told += ["no help"] * (isinstance(option, click.Option) and not option.help)
        yield f"$ {path}: {'; '.join(told)}"
    if isinstance(command, click.Group):
        for name, each in sorted(command.commands.items()):
            yield from _commands(f"{path} {name}", each)


def test_the_public_surface_is_as_it_was() -> None:
    now, then = list(surface()), FROZEN.read_text(encoding="utf-8").splitlines()
    assert [line for line in then if line not in now] == [], "gone"
    assert [line for line in now if line not in then] == [], "new"


@pytest.mark.parametrize(
    ("blocking", "awaited"), [(drivebus.Bus, drivebus.aio.Bus), (drivebus.Drive, drivebus.aio.Drive)]
)
def test_both_faces_are_asked_in_the_same_way(blocking: type, awaited: type) -> None:
    # A poll of an event loop is read by it, and calls nobody back.
    names = {name for name in dir(blocking) if not name.startswith("_") and hasattr(awaited, name)} - {"poll"}
    asked = {name for name in names if callable(getattr(blocking, name))}
    assert len(asked) > 10
    for name in asked:
        signatures = {_signature(getattr(face, name), bound=True).replace(", /", "") for face in (blocking, awaited)}
        assert len(signatures) == 1, f"{name}: {signatures}"
    assert _signature(blocking) == _signature(awaited)


def test_a_change_of_the_surface_shows() -> None:
    assert _function("f", _commands) == "f(path, command)  # no docstring"
    assert _function("f", lambda path, *, command=1: (path, command)) == "f(path, *, command=1)  # no docstring"
    assert _function("f", surface) == "f()"


if __name__ == "__main__":
    FROZEN.write_text("\n".join(surface()) + "\n", encoding="utf-8")


def test_signatures_are_shown_without_quotes() -> None:
    """As `help` and a notebook show them."""
    both = [getattr(face, name) for face in (drivebus, drivebus.aio) for name in ("Bus", "Drive", "Poll")]
    functions: list[Any] = [member for face in both for member in vars(face).values() if inspect.isfunction(member)]
    functions += [inspect.unwrap(drivebus.Bus.read), drivebus.Recorder.wait, drivebus.search]
    shown = [repr(each) for function in functions for each in function.__annotations__.values()]
    assert len(shown) > 100
    assert [each for each in shown if each.startswith(("'", '"'))] == []
