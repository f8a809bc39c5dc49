"""Lines with simulated drives, for every test that wants one.

`line` is every kind of line in turn: the same tests hold on each. `virtual` is the in-process line in virtual time, for
tests about time and about what the line carries.
"""

from __future__ import annotations

import asyncio
import functools
import gc
import importlib.util
import itertools
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Coroutine, Generator, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

import drivebus

from .ends import dispositions_as_usual

# A busy machine takes its time: nothing here is judged by the clock on the wall.
settings.register_profile("drivebus", deadline=None)
settings.load_profile("drivebus")

dispositions_as_usual()

# Their slaves, screens and signals are those of POSIX.
OF_POSIX = """
cli_monitor cli_reserved_units cli_several closing_servers end_of_program errors huanyang_asked page postgres
postgres_refused postgres_settings read_only_forms record reserved_units search_huanyang serve_mqtt
serve_mqtt_commands serve_postgres serve_sparkplug settings_changed seven_bits shared_bounds shared_port sniff_end
sparkplug system_calls tables web_routes web_settings web_strangers what_came wrong_inside
"""
collect_ignore = [f"test_{name}.py" for name in OF_POSIX.split()] if sys.platform == "win32" else []

NO_PTY = pytest.mark.skipif(os.name == "nt", reason="no pty")
TRANSPORTS = ["process", pytest.param("pty", marks=NO_PTY), "tcp"]
# And a pseudo-terminal that another bus has: whoever opens it now uses it through that one.
LINES = [*TRANSPORTS, pytest.param("shared", marks=NO_PTY)]
# Seconds for an answer. Behind a port a thread of the simulator has to run for it; on a busy machine that takes long.
IN_PROCESS, BEHIND_A_PORT = 0.25, 0.5
_NUMBERS = itertools.count()
_ROOM = 1 << 30
RAMP = 1.0  # seconds to 50 Hz; short, because two of three lines run in real time


LONGEST = [
    "test_conformance",
    "test_halts_of_other_families",
    "test_cli",
    "test_halts_awaited",
    "test_cli_screens",
    "test_ends",
    "test_behaviour",
    "test_panel_stops",
    "test_ends_beside_others",
    "test_huanyang_asked",
    "test_seven_bits",
    "test_ends_refused",
    "test_shared_bounds",
    "test_search_huanyang",
    "test_end_of_program",
    "test_wrong_profile",
    "test_unit_exchanged",
    "test_others_at_a_server",
    "test_discovery",
    "test_settings_changed",
    "test_shared_port",
    "test_threads_at_exit",
    "test_what_came",
    "test_record",
    "test_panel",
    "test_page",
    "test_last_will",
    "test_forked_owner",
    "test_spoilt_line",
]
"""The files that take longest, the longest first: measured on a quiet machine, 141 to 27 s with what they wait for."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected stays to the end: nobody looks for garbage in it, neither now nor while tests run."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes long begins first, so that nobody waits for it in the end."""
    places = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path.stem, len(places)))


@pytest.fixture(autouse=True)
def nothing_known(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """No test knows what another one, or whoever runs the tests, has found out about a line of the same name."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path_factory.getbasetemp() / f"state-{next(_NUMBERS)}"))


@contextmanager
def meeting_in_a_folder_of_its_own() -> Iterator[Path]:
    """Programs meet where no others do, and where the name of a socket is not too long (107 bytes)."""
    with tempfile.TemporaryDirectory(prefix="drivebus-") as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("DRIVEBUS_RUNTIME_DIR", folder)
        # Nor does a service of this machine have to do with it.
        patch.setenv("DRIVEBUS_MACHINE_DIR", f"{folder}/machine")
        yield Path(folder) / "drivebus"


@pytest.fixture(autouse=True, scope="session")
def apart() -> Iterator[Path]:
    """Where tests meet no programs of whoever runs them, nor those of tests that run beside them."""
    with meeting_in_a_folder_of_its_own() as folder:
        yield folder


@pytest.fixture(autouse=True)
def nothing_is_left_to_do(apart: Path) -> Iterator[None]:
    """No test finds what a program that an earlier one killed left to be done: pseudo-terminals have its name again."""
    yield
    for will in apart.glob("*.will"):
        will.unlink(missing_ok=True)


@pytest.fixture
def folder() -> Iterator[Path]:
    """Where the programs of one test meet."""
    with meeting_in_a_folder_of_its_own() as folder:
        yield folder


@pytest.fixture
def quick_folder(tmp_path: Path) -> Iterator[Path]:
    """A folder of one test: in memory where there is room, for what writes a thousand times through to the disk."""
    memory = Path("/dev/shm")
    if not memory.is_dir() or shutil.disk_usage(memory).free < _ROOM:
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(prefix="drivebus-", dir=memory) as folder:
        yield Path(folder)


@pytest.fixture(params=LINES)
def simulator(request: pytest.FixtureRequest) -> Iterator[drivebus.Simulator]:
    clock = "virtual" if request.param == "process" else "real"
    is_shared = request.param == "shared"
    transport = "pty" if is_shared else request.param
    with (
        drivebus.Simulator({1: "gd350", 2: "gd350"}, transport=transport, clock=clock) as simulator,
        drivebus.Bus(simulator) if is_shared else nullcontext(),
    ):
        yield simulator


@pytest.fixture
def timeout(simulator: drivebus.Simulator) -> float:
    """What `bus` waits for an answer."""
    return IN_PROCESS if simulator.transport == "process" else BEHIND_A_PORT


@pytest.fixture
def bus(simulator: drivebus.Simulator, timeout: float) -> Iterator[drivebus.Bus]:
    with drivebus.Bus(simulator, timeout=timeout) as bus:
        yield bus


@pytest.fixture
def drive(bus: drivebus.Bus) -> drivebus.Drive:
    """A drive that does not obey the bus yet."""
    return bus.drive(1)


@pytest.fixture
def obedient(drive: drivebus.Drive) -> drivebus.Drive:
    """A drive that obeys the bus and is quick."""
    drive.prepare_control()
    drive.write({"P00.11": RAMP, "P00.12": RAMP})
    return drive


class Unwatching(asyncio.SelectorEventLoop):
    """Tells of no descriptor that is readable, as the proactor of Windows."""

    def add_reader(self, *_: object) -> None:
        """Not here."""
        raise NotImplementedError


def new_uvloop() -> asyncio.AbstractEventLoop:
    import uvloop

    loop: asyncio.AbstractEventLoop = uvloop.new_event_loop()
    return loop


NO_UVLOOP = pytest.mark.skipif(importlib.util.find_spec("uvloop") is None, reason="uvloop is not installed")


async def end_the_rest() -> None:
    rest = asyncio.all_tasks() - {asyncio.current_task()}
    for task in rest:
        task.cancel()
    await asyncio.gather(*rest, return_exceptions=True)


@pytest.fixture(
    params=[
        pytest.param(asyncio.new_event_loop, id="asyncio"),
        pytest.param(Unwatching, id="unwatching"),
        pytest.param(new_uvloop, id="uvloop", marks=NO_UVLOOP),
    ]
)
def run(request: pytest.FixtureRequest) -> Callable[[Coroutine[Any, Any, Any]], Any]:
    """Runs a coroutine in an event loop of its own, of each kind in turn, and ends that as `asyncio.run` does."""

    def run_until_complete(work: Coroutine[Any, Any, Any]) -> Any:
        loop = request.param()
        try:
            return loop.run_until_complete(work)
        finally:
            loop.run_until_complete(end_the_rest())
            loop.run_until_complete(loop.shutdown_asyncgens())
            loop.close()

    return run_until_complete


@pytest.fixture
def virtual() -> Iterator[drivebus.Simulator]:
    with drivebus.Simulator({1: "gd350", 2: "gd350"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def virtual_bus(virtual: drivebus.Simulator) -> Iterator[drivebus.Bus]:
    with drivebus.Bus(virtual, timeout=0.25) as bus:
        yield bus


@pytest.fixture
def virtual_drive(virtual_bus: drivebus.Bus) -> drivebus.Drive:
    """A drive that obeys the bus, in virtual time."""
    drive = virtual_bus.drive(1)
    drive.prepare_control()
    return drive


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Makes a drive that has nothing at an address."""
    read = drivebus.Bus.read

    def refuse(address: int) -> None:
        def refusing(bus: drivebus.Bus, unit: int, first: int, count: int = 1, /, **how: Any) -> list[int]:
            # 6300H is nowhere: the drive itself refuses.
            return read(bus, unit, 0x6300 if first <= address < first + count else first, count, **how)

        monkeypatch.setattr(drivebus.Bus, "read", refusing)

    return refuse


@pytest.fixture
def store() -> Callable[[drivebus.Drive, Mapping[str, object]], None]:
    """Stores parameters in EEPROM, whatever is known of them: the drive is the judge."""

    def put(drive: drivebus.Drive, values: Mapping[str, object]) -> None:
        for code, value in values.items():
            drive.bus.write(drive.unit, drive.profile.address(code, store=True), drive.profile.encode(code, value))

    return put


class Killed(BaseException):
    """Ends everything, as kill -9 does: nothing that is written in Python may hold it up."""


@pytest.fixture
def dies_at(monkeypatch: pytest.MonkeyPatch) -> Callable[[int, bool], AbstractContextManager[None]]:
    """A block that ends at its n-th request, if it comes to that: when its answer comes if sent, or before it is."""

    @contextmanager
    def block(moment: int, sent: bool) -> Iterator[None]:
        left = [moment]

        def deadly(request: Callable[..., object], *args: object, **how: object) -> object:
            left[0] -= 1
            if left[0] == 0 and not sent:
                raise Killed
            answer = request(*args, **how)
            if left[0] == 0:
                raise Killed
            return answer

        with monkeypatch.context() as patch, suppress(Killed):
            for name in ("read", "write"):
                patch.setattr(drivebus.Bus, name, functools.partialmethod(_bound, deadly, getattr(drivebus.Bus, name)))
            yield

    return block


def _bound(bus: drivebus.Bus, deadly: Callable[..., object], request: object, *args: object, **how: object) -> object:
    return deadly(request, bus, *args, **how)
