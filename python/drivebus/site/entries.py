"""The lines that one owns, and the drives on them, as a file names them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from drivebus import checks
from drivebus.line.addresses import Addresses

if TYPE_CHECKING:
    from drivebus.site.reading import Key, Reading

__all__ = ["SiteDrive", "SiteLine", "drives_named"]


@dataclass(frozen=True)
class SiteLine:
    """A line with its settings; what is None is as usual.

    Attributes:
        name: What it is called.
        port: What to open.
        baud: Bits per second.
        format: Data bits, parity and stop bits, such as `"8E1"`.
        rs485: Who switches the direction: `"kernel"`, `"rts"` or `"auto"`.
        reserved: Whether it has units that the specification reserves, as `drivebus.Bus` takes it.
    """

    name: str
    port: str
    baud: int | None = None
    format: str | None = None
    rs485: str | None = None
    reserved: bool = False

    @property
    def addresses(self) -> Addresses:
        """Which units it may have."""
        return Addresses.of(self.port, reserved=self.reserved)


@dataclass(frozen=True)
class SiteDrive:
    """A drive on one of the lines.

    Attributes:
        name: What it is called.
        line: The line it hangs on.
        unit: Its address, 1..247, or another that its line has.
        profile: Its family, or the folder of a profile; None asks the drive.
        variants: What parameters of the drive decide, by name.
        unverified: Whether what no document of its family proves may be used.
        read_only: Whether nothing may be written to it.
    """

    name: str
    line: SiteLine
    unit: int
    profile: str | None = None
    variants: Mapping[str, str] = field(default_factory=dict)
    unverified: bool = False
    read_only: bool = False


def drives_named(
    names: Iterable[str],
    drives: Mapping[str, SiteDrive],
    groups: Mapping[str, tuple[SiteDrive, ...]],
    file: Reading,
    where: Key,
) -> tuple[SiteDrive, ...]:
    """The drives that *names* of drives and groups mean, each once; of what is neither, *file* complains at *where*."""
    chosen: dict[str, SiteDrive] = {}
    for name in names:
        members = groups.get(name, (drives[name],) if name in drives else ())
        if not members and name not in groups:
            hint = checks.closest(name, [*drives, *groups])
            file.complain(where, f'there is no drive or group "{name}"{hint}')
        chosen |= {drive.name: drive for drive in members if drive.name not in chosen}
    return tuple(chosen.values())
