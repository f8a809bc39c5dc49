"""Invariant: whatever a unit answers, no command but a halt goes out twice, and no call says what is not so.

A call that returns has done what it says, one that says that nothing was sent has sent nothing, and whatever fails is
an error of ours. A whole `Drive` on a simulated line in process and in virtual time: the input says which calls are
made, and what becomes of each answer meanwhile: the faults of the line, or bytes instead of it. The oracle is the
drive's own log and what was on the wire. As long as the line only loses, cuts, damages, delays and lets answers
overtake each other, a call returns only if the drive did it. Once a whole frame has lied in the drive's name, only if
something answered that very call.

The input: two bytes for the bus, then records: a call, its argument, and for some of the answers to come how many come
before them, and what happens to them (`_answer`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from drivebus import Bus, Drive, DrivebusError, Refused, Unconfirmed
from drivebus.errors import PortError
from drivebus.sim import FAULT_KINDS, SimulatedDrive, Simulator

READ, WRITE, WRITE_MANY = 0x03, 0x06, 0x10
UNIT, COMMAND = 1, 0x2000
RUN, RUN_REVERSE, JOG, STOP, COAST, RESET, JOG_STOP = 1, 2, 3, 5, 6, 7, 8
HALTS = (STOP, COAST, JOG_STOP)
AT_REST = ("stopped", "fault")
RAMP = 0x000B  # P00.11, in tenths of a second
TIMEOUTS = (0.02, 0.05, 0.1, 0.5)
MOST_CALLS = 12
SHORTEST, LONGEST = 5, 40  # bytes of an answer: none has more than 16 words


@dataclass
class Input:
    """Bytes that are read from their beginning, and zeros behind their end."""

    data: bytes
    place: int = 0

    def byte(self) -> int:
        """The next one."""
        self.place += 1
        return self.data[self.place - 1] if self.place <= len(self.data) else 0

    def take(self, count: int) -> bytes:
        """So many."""
        return bytes(self.byte() for _ in range(count))

    def __bool__(self) -> bool:
        return self.place < len(self.data)


def crc(data: bytes) -> int:
    """CRC-16/MODBUS, bit by bit; 0 of a whole frame with its own."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return register


def sealed(body: bytes) -> bytes:
    """*body* with its CRC."""
    return body + crc(body).to_bytes(2, "little")


def holds_frame(data: bytes) -> bool:
    """Whether a receiver could find a frame of the unit in *data*, wherever it begins."""
    begins = (place for place, byte in enumerate(data) if byte == UNIT)
    ends = range(SHORTEST, LONGEST + 1)
    return any(
        crc(data[begin : begin + length]) == 0 for begin in begins for length in ends if begin + length <= len(data)
    )


def _answer(data: Input) -> str | bytes:
    """What happens to one answer: a kind of fault, or the bytes that come instead."""
    what = data.byte()
    kinds = len(FAULT_KINDS)
    if what < 8 * kinds:
        return FAULT_KINDS[what % kinds]
    lies: tuple[Callable[[], bytes], ...] = (
        lambda: data.take(data.byte() % 32),
        lambda: sealed(bytes([UNIT]) + data.take(data.byte() % 32)),
        lambda: sealed(bytes([UNIT, READ, 2]) + data.take(2)),
        lambda: sealed(bytes([UNIT, READ, 4]) + data.take(4)),
        lambda: sealed(bytes([UNIT, WRITE, 0x20, 0x00, 0, data.byte() % 9])),
        lambda: sealed(bytes([UNIT, WRITE_MANY, 0x20, 0x00, 0, 2])),
        lambda: sealed(bytes([UNIT, 0x80 | data.byte(), data.byte()])),
        lambda: sealed(bytes([UNIT, READ, 2]) + data.take(2)) + sealed(bytes([UNIT, READ, 2]) + data.take(2)),
    )
    return lies[what % len(lies)]()


@dataclass
class Run:
    """One input: a drive, and what is known of it."""

    simulator: Simulator
    drive: Drive
    lied: bool = False
    commands: list[int] = field(default_factory=list)  # that the drive has taken, ever

    @property
    def unit(self) -> SimulatedDrive:
        """The drive's own side."""
        return self.simulator.drive(UNIT)

    def script(self, data: Input) -> None:
        """Sets what becomes of the answers to come."""
        script: list[tuple[int, str | bytes]] = []
        number = 0
        for _ in range(data.byte() % 16):
            number += data.byte() % 4
            what = _answer(data)
            self.lied |= isinstance(what, bytes) and holds_frame(what)
            script.append((number + 1, what))
        self.simulator.line.script(script)

    def call(self, kind: int, argument: int) -> None:
        """One call, and whether it told the truth."""
        calls: dict[int, Callable[[], object]] = {
            RUN: lambda: self.drive.run(hz=argument % 51),
            RUN_REVERSE: lambda: self.drive.run(hz=argument % 51, reverse=True),
            JOG: self.drive.jog,
            STOP: self.drive.stop,
            COAST: self.drive.coast,
            RESET: self.drive.reset_fault,
            JOG_STOP: self.drive.jog_stop,
            9: lambda: self.drive.write("P00.11", argument / 10),
            10: lambda: self.drive.read("P00.11"),
            11: self.drive.status,
        }
        began, before, was = self.simulator.now(), self.unit.register(RAMP), self.unit.state
        self.unit.take_writes()
        failure: DrivebusError | None = None
        result: object = None
        try:
            result = calls[kind]()
        except DrivebusError as error:
            failure = error
        taken = [value for _, address, value in self.unit.take_writes() if address == COMMAND]
        self.commands += taken
        wire = [(who, frame) for moment, who, frame in self.simulator.line.trace() if moment >= began]
        sent = [code for who, frame in wire if who == "master" and (code := commanded(frame)) is not None]
        told = f"call {kind} ({argument}): {failure!r} {result!r}; sent {sent}, taken {taken}, {self.unit.state}"
        assert set(sent + taken) <= {kind}, f"another command went out; {told}"
        assert kind in HALTS or max(len(sent), len(taken)) <= 1, f"a command went out twice; {told}"
        if failure is None:
            self._judge(kind, argument, before, was, result, taken, wire, told)
        elif not isinstance(failure, Unconfirmed | Refused):
            assert not taken, f"it says that it sent no command; {told}"
            # A port that was lost may have taken the frame with it.
            assert not sent or isinstance(failure, PortError), f"it says that it sent no command; {told}"
        elif isinstance(failure, Refused) and not self.lied:
            assert not taken, f"it was refused; {told}"

    def _judge(
        self,
        kind: int,
        argument: int,
        before: int,
        was: str,
        result: object,
        taken: list[int],
        wire: list[tuple[str, bytes]],
        told: str,
    ) -> None:
        """Of a call that returned: whether what it says is so."""
        state = self.unit.state
        if self.lied:
            said = b"".join(frame for who, frame in wire if who == "unit")
            assert kind > JOG_STOP or holds_frame(said) or self._is_reset(kind), f"nobody answered; {told}"
        elif kind in (RUN, RUN_REVERSE, JOG):
            assert taken == [kind], f"it was not started; {told}"
            # What turned the other way slows down first, and what was started may trip at once.
            ways = ("reverse" if kind == RUN_REVERSE else "forward",) if was == "stopped" else ("forward", "reverse")
            assert state in (*ways, "fault"), f"it does not run so; {told}"
        elif kind in HALTS:
            halted = bool(self.commands) and self.commands[-1] in HALTS
            assert state in AT_REST or (halted and kind != COAST), f"it was not halted; {told}"
        elif kind == RESET:
            # A motor that speeds up may trip when it has just said that there is no fault.
            assert self.unit.fault == 0 or was not in AT_REST, f"the fault is there; {told}"
        elif kind == 9:
            assert self.unit.register(RAMP) == argument, f"{before} was there, {self.unit.register(RAMP)} is; {told}"
        elif kind == 10:
            assert round(float(str(result)) * 10) == before, f"{before} was there; {told}"

    def _is_reset(self, kind: int) -> bool:
        return kind == RESET and not self.unit.fault


def commanded(frame: bytes) -> int | None:
    """The command that a master's *frame* is, if it is one."""
    if len(frame) > 5 and frame[:4] == bytes([UNIT, WRITE, *COMMAND.to_bytes(2, "big")]):
        return frame[5]
    if len(frame) > 8 and frame[:4] == bytes([UNIT, WRITE_MANY, *COMMAND.to_bytes(2, "big")]):
        return frame[8]
    return None


@contextlib.contextmanager
def on_a_line(how: int, seed: int) -> Iterator[Run]:
    """A drive that obeys the bus, on a line that is still good."""
    timeout = TIMEOUTS[how & 3]
    echo = bool(how & 16)
    simulator = Simulator({UNIT: "gd350"}, baudrate=115200, seed=seed, transport="process", clock="virtual", echo=echo)
    with simulator, Bus(simulator, baudrate=115200, timeout=timeout, retries=how >> 2 & 3) as bus:
        simulator.line.set_times(
            delay=timeout / 2, late=1.1 * timeout, overtaken=(1.1 * timeout, 4 * timeout), replug=2 * timeout
        )
        drive = bus.drive(UNIT, profile="gd350")
        drive.prepare_control()
        drive.write({"P00.11": 1.0, "P00.12": 1.0})
        yield Run(simulator, drive)


def drive(data: bytes) -> None:
    """See the file's first lines."""
    given = Input(data)
    with on_a_line(given.byte(), given.byte()) as run:
        for _ in range(MOST_CALLS):
            if not given:
                return
            what, argument = given.byte(), given.byte()
            run.script(given)
            if what & 0xF == 0:
                with contextlib.suppress(DrivebusError):
                    run.simulator.advance(argument / 16)
            elif what & 0xF == 12:
                run.unit.trip(1 + argument % 9)
            elif what & 0xF in (RUN, RUN_REVERSE, JOG, *HALTS, RESET, 9, 10, 11):
                run.call(what & 0xF, argument)
