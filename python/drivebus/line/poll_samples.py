"""What every face of a poll has: the checks of what is asked for, and samples, batches and arrays of what came.

The asking is the compiled core's. How one waits for samples is the business of `drivebus.poll` and `drivebus.aio.poll`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, cast, overload

from drivebus import _native, checks
from drivebus.attribute_mapping import Named
from drivebus.errors import BadAnswer, BadArgument, DrivebusError, Refused
from drivebus.line.addresses import Addresses
from drivebus.line.units import units_of
from drivebus.profile import Profile
from drivebus.profile.plan import ReadPlan
from drivebus.values import Value

if TYPE_CHECKING:
    import numpy.typing
    import pandas
    import polars
    from typing_extensions import TypeVar

    # Whoever writes `Poll` or `Batch` alone means one of anything.
    Key = TypeVar("Key", default=Any)
else:
    from typing import TypeVar

    Key = TypeVar("Key")

__all__ = [
    "MOST_SAMPLES",
    "Batch",
    "Key",
    "Names",
    "Polling",
    "Reads",
    "Sample",
    "how_many",
    "poller_of",
    "seconds",
]

Names = str | Iterable[str] | None
"""What is asked of a drive: names of registers or parameters; None for its monitor registers."""

Reads = Iterable[Sequence[int]]
"""What is asked of a unit that no profile is known of: pairs of an address and how many words."""

MOST_SAMPLES = 1_000_000
"""More are never kept."""

_LONGEST_INTERVAL = 86_400.0


class PolledDrive(Protocol):
    """What a poll needs to know of a drive, whether its calls block or are awaited."""

    @property
    def bus(self) -> object:
        """The line that it is on."""

    @property
    def unit(self) -> int:
        """Its address, 1..247."""

    @property
    def profile(self) -> object:
        """What its words mean."""

    def readable(self, *names: str) -> list[str]:
        """*names*, or those that it reads when it is asked for nothing else, if they may be read."""


class Target(NamedTuple):
    """What is asked in each cycle of one drive, or of one unit that no profile is known of."""

    key: Any
    unit: int
    drive: PolledDrive | None
    profile: Profile | None
    plan: ReadPlan | None
    names: tuple[str | int, ...]
    asked: _native.Plan | list[tuple[int, int]]

    def columns(self) -> list[str]:
        """The names as text: an address as `0x3000`."""
        return [name if isinstance(name, str) else f"{name:#06x}" for name in self.names]

    def units(self) -> dict[str, str]:
        """The unit of each name that has one."""
        if self.profile is None:
            return {}
        units = {name: self.profile.describe(name).unit for name in self.columns()}
        return {name: unit for name, unit in units.items() if unit}


class Sample(Named[str | int, Value], Generic[Key]):
    """The values of one drive in one cycle: a mapping of names (without a profile: of addresses) to values.

    Names are attributes, too: `sample["output_current"]` is `sample.output_current`. A missing sample is empty, and so
    it is false.

    Attributes:
        key: What was given to the poll: the drive, or where a unit was polled by its address, that.
        unit: Its address, 1..247.
        drive: The drive as it was given, or None where a unit was polled by its address.
        time: Unix time in seconds at which the first request left; of a missing sample, at which it was given up if it
            was not sent.
        answered: Unix time in seconds at which the last answer was complete, or was given up.
        late: How many samples were due between the one before and this one, and were not taken, because the line was
            busy. Each sample of a cycle has the same number.
        missing: The error that there was instead of an answer, or None. It is not raised.
    """

    __slots__ = ("answered", "drive", "key", "late", "missing", "time", "unit")

    key: Key
    unit: int
    drive: Key | None
    time: float
    answered: float
    late: int
    missing: DrivebusError | None

    def __init__(
        self,
        target: Target,
        time: float,
        answered: float,
        late: int,
        values: list[Value] | None,
        missing: DrivebusError | None,
    ) -> None:
        super().__init__({} if values is None else dict(zip(target.names, values, strict=True)))
        self.key = target.key
        self.unit = target.unit
        self.drive = None if target.drive is None else target.key
        self.time = time
        self.answered = answered
        self.late = late
        self.missing = missing

    def __getitem__(self, name: str | int) -> Value:
        try:
            return super().__getitem__(name)
        except KeyError:
            if self.missing is not None:
                raise KeyError(f"{name!r}: this sample is missing: {self.missing}") from None
            raise

    def _lacks(self, name: str) -> str:
        if self.missing is None:
            return super()._lacks(name)
        return f"this sample is missing, and has no {name}: {self.missing}"

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value}" for name, value in self.items())
        return f"<Sample of unit {self.unit} at {self.time:.3f}: {self.missing or shown}>"


class Batch(Sequence[Sample[Key]], Generic[Key]):
    """Samples in the order in which they were taken by the bus. They are decoded when they are first looked at."""

    def __init__(self, native: _native.Batch, targets: Sequence[Target]) -> None:
        self._native = native
        self._targets = targets
        self._samples: list[Sample[Key]] | None = None

    def __len__(self) -> int:
        return len(self._native)

    @overload
    def __getitem__(self, index: int) -> Sample[Key]: ...
    @overload
    def __getitem__(self, index: slice) -> list[Sample[Key]]: ...
    def __getitem__(self, index: int | slice) -> Sample[Key] | list[Sample[Key]]:
        return self._decoded()[index]

    def __iter__(self) -> Iterator[Sample[Key]]:
        return iter(self._decoded())

    def __repr__(self) -> str:
        return f"<Batch of {len(self)} samples>"

    def to_numpy(self) -> dict[Key, numpy.typing.NDArray[numpy.void]]:
        """One structured array for each drive (or unit) that was polled, with a row for each of its samples.

        Its fields are `time` and `answered`, as in `Sample`, and one for each name (of a unit without a profile, each
        address such as `"0x3000"`): all float64, NaN where the sample is missing.

        Raises:
            ImportError: numpy is not installed.
        """
        try:
            import numpy
        except ImportError:
            raise ImportError("to_numpy() needs numpy: pip install 'drivebus[numpy]'") from None
        arrays: dict[Key, numpy.typing.NDArray[numpy.void]] = {}
        for index, target in enumerate(self._targets):
            fields = [(name, "f8") for name in ("time", "answered", *target.columns())]
            arrays[target.key] = numpy.frombuffer(self._native.rows(index), dtype=fields)
        return arrays

    def to_pandas(self) -> dict[Key, pandas.DataFrame]:
        """One DataFrame for each drive (or unit) that was polled, with a row for each of its samples.

        The index is `Sample.time` as a moment in UTC. There is a column for each name (of a unit without a profile,
        each address such as `"0x3000"`): all float64, NaN where the sample is missing. `frame.attrs["units"]` has the
        units by column, of those that have one: `{"output_current": "A"}`.

        Raises:
            ImportError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise ImportError("to_pandas() needs pandas: pip install 'drivebus[pandas]'") from None
        frames: dict[Key, pandas.DataFrame] = {}
        for target, (key, array) in zip(self._targets, self.to_numpy().items(), strict=True):
            moments = pandas.DatetimeIndex(pandas.to_datetime(array["time"], unit="s", utc=True), name="time")
            frame = pandas.DataFrame({name: array[name] for name in target.columns()}, index=moments)
            frame.attrs["units"] = target.units()
            frames[key] = frame
        return frames

    def to_polars(self) -> dict[Key, polars.DataFrame]:
        """One DataFrame for each drive (or unit) that was polled, with a row for each of its samples.

        The column `time` is `Sample.time` as a moment in UTC. There is one for each name (of a unit without a profile,
        each address such as `"0x3000"`): all Float64, null where the sample is missing.

        Raises:
            ImportError: polars or numpy is not installed.
        """
        try:
            import polars
        except ImportError:
            raise ImportError("to_polars() needs polars: pip install 'drivebus[polars]'") from None
        frames: dict[Key, polars.DataFrame] = {}
        for target, (key, array) in zip(self._targets, self.to_numpy().items(), strict=True):
            moments = polars.Series("time", array["time"] * 1e6).cast(polars.Datetime("us", "UTC"))
            values = [polars.Series(name, array[name], nan_to_null=True) for name in target.columns()]
            frames[key] = polars.DataFrame([moments, *values])
        return frames

    def _decoded(self) -> list[Sample[Key]]:
        if self._samples is None:
            self._samples = [self._sample(*row) for row in self._native.samples()]
        return self._samples

    def _sample(
        self,
        index: int,
        time: float,
        answered: float,
        late: int,
        came: list[Value | None] | None,
        missing: Exception | None,
    ) -> Sample[Key]:
        target = self._targets[index]
        error = missing if isinstance(missing, DrivebusError) else None
        if came is not None and target.plan is not None:
            try:
                target.plan.named(came, unit=target.unit)
            except BadAnswer as absent:
                came, error = None, absent
        if isinstance(error, Refused) and target.profile is not None:
            error.name, error.meaning = target.profile.exception(error.code)
        # None of them is None here.
        return Sample(target, time, answered, late, cast("list[Value] | None", came), error)


class Polling(Generic[Key]):
    """What every face of a poll has, whether its calls block or are awaited.

    Attributes:
        interval: Seconds from one cycle's beginning to the next one's; None: one right after the other.
        size: How many samples are kept.
        shortest: Seconds that one cycle takes at least on this line; 0.0 where the line sets no such limit.
    """

    interval: float | None
    size: int
    shortest: float

    def __init__(self, bus: object, native: _native.Bus, targets: object, interval: float | None, size: int) -> None:
        if interval is not None:
            interval = checks.number("interval", interval, 0.0, _LONGEST_INTERVAL, above=True)
        self.size = checks.whole("size", size, 1, MOST_SAMPLES)
        self.interval = interval
        self._targets = _targets(bus, units_of(native).addresses, targets)
        asked = [(target.unit, target.asked) for target in self._targets]
        self._native = _native.Poller(native, asked, interval, self.size)
        self.shortest = self._native.shortest

    @property
    def closed(self) -> bool:
        """Whether nothing is asked any more. Samples may still be there to be taken."""
        return self._native.over

    @property
    def cycles(self) -> int:
        """Cycles that are over: in each, every drive was asked once."""
        return self._native.counts()["cycles"]

    @property
    def missing(self) -> int:
        """Samples that have no values, taken or not."""
        return self._native.counts()["missing"]

    @property
    def late(self) -> int:
        """Starts of cycles that passed before the line was free. They are not made up for."""
        return self._native.counts()["late"]

    @property
    def dropped(self) -> int:
        """Samples that gave way to newer ones before somebody took them."""
        return self._native.counts()["dropped"]

    def take(self, max: int | None = None) -> Batch[Key]:  # noqa: A002
        """The oldest samples that are there, *max* at most, without waiting. Empty where there are none."""
        limit = self.size if max is None else checks.whole("max", max, 0, MOST_SAMPLES)
        return Batch(self._native.take(limit), self._targets)

    def __repr__(self) -> str:
        how = "as fast as the wire" if self.interval is None else f"every {self.interval:g} s"
        units = ", ".join(str(target.unit) for target in self._targets)
        return f"<{type(self).__name__} of unit {units} {how}{', closed' if self.closed else ''}>"


def poller_of(polling: Polling[Any]) -> _native.Poller:
    """What asks, in the core."""
    return polling._native


def how_many(polling: Polling[Any], count: int | None) -> int:
    """How many samples are waited for: *count*, or one for None."""
    return 1 if count is None else checks.whole("count", count, 1, polling.size)


def seconds(timeout: float | None) -> float | None:
    """How long is waited; None: for as long as it takes."""
    return None if timeout is None else checks.number("timeout", timeout, 0.0)


def _targets(bus: object, addresses: Addresses, wanted: object) -> tuple[Target, ...]:
    if not isinstance(wanted, Mapping):
        raise BadArgument(f"poll() takes {{drive: names, …}}, such as {{drive: None}}, and not {checks.shown(wanted)}")
    if not wanted:
        raise BadArgument("nothing to poll: give {drive: names, …}, such as {drive: None}")
    targets = tuple(_target(bus, addresses, key, names) for key, names in wanted.items())
    units = [target.unit for target in targets]
    twice = next((unit for unit in units if units.count(unit) > 1), None)
    if twice is not None:
        raise BadArgument(f"unit {twice} is there twice; name all that is wanted of it in one place", unit=twice)
    return targets


def _target(bus: object, addresses: Addresses, key: Any, names: object) -> Target:
    if not all(hasattr(key, name) for name in ("bus", "unit", "profile")):
        return _raw_target(addresses.unit(key), names)
    drive: PolledDrive = key
    unit, profile = drive.unit, drive.profile
    if drive.bus is not bus:
        raise BadArgument(f"unit {unit} is a drive of another bus; poll it there", unit=unit)
    if not isinstance(profile, Profile):
        raise BadArgument(f"the profile of unit {unit} is not of this package; poll the unit by addresses", unit=unit)
    if names is None:
        names = drive.readable()
    elif isinstance(names, str):
        names = [names]
    elif not isinstance(names, Iterable):
        raise BadArgument(
            f"{checks.shown(names)} is not a list of names; give one, or None for the monitor registers", unit=unit
        )
    wanted = list(names)
    unfit = next((name for name in wanted if not isinstance(name, str)), None)
    if unfit is not None:
        raise BadArgument(f"a name is a text, and {checks.shown(unfit)} of unit {unit} is not", unit=unit)
    asked = list(dict.fromkeys(wanted))
    plan = profile.compile(drive.readable(*asked) if asked else asked)
    if not plan.names:
        raise BadArgument(f"nothing is asked of unit {unit}; give names, or None for its monitor registers", unit=unit)
    return Target(key, unit, drive, profile, plan, plan.names, plan.native)


def _raw_target(unit: int, reads: object) -> Target:
    usage = f"unit {unit} has no profile here: give [(address, count), …] for it, or use bus.drive({unit})"
    if isinstance(reads, (str, bytes)) or not isinstance(reads, Iterable):
        raise BadArgument(usage)
    asked = []
    for read in reads:
        if not isinstance(read, Sequence) or isinstance(read, (str, bytes)) or len(read) != 2:
            raise BadArgument(usage)
        asked.append((checks.address(read[0]), checks.whole("count", read[1], 1, 125)))
    names = tuple(address + offset for address, count in asked for offset in range(count))
    if len(set(names)) < len(names):
        raise BadArgument(f"of unit {unit} one address is asked for twice")
    return Target(unit, unit, None, None, None, names, asked)
