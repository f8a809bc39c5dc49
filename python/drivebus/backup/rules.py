"""Which parameters are read, compared and given back, and why the others are not. Nothing here asks a drive."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from drivebus import checks
from drivebus.advice import Text, argument
from drivebus.backup.unread import Unread
from drivebus.errors import BadArgument, NotAllowed
from drivebus.operations.kept import store_register
from drivebus.profile import Profile
from drivebus.values import group_of

__all__ = ["Rules"]


class Rules:
    """What the profile says about keeping the parameters of its family."""

    def __init__(self, profile: Profile) -> None:
        self.profile = profile
        self._serial = frozenset(profile.serial_parameters())
        self._motor = frozenset(profile.motor_parameters())
        self._acts = frozenset((*profile.acts(), *filter(None, [store_register(profile)])))
        self._faults = frozenset((*profile.fault_history, *profile.fault_values))

    def codes(self) -> list[str]:
        """Every parameter that the profile knows, in code order."""
        known = (self.profile.describe(name) for name in self.profile.names())
        return sorted(
            {each.code for each in known if each.code is not None and each.kind == "parameter"}, key=self.place
        )

    def place(self, code: str) -> tuple[int, str]:
        """Where *code* stands in a file: in the order of addresses, which is that of groups."""
        try:
            address = self.profile.describe(code).address
        except NotAllowed:
            address = None
        return (1 << 16 if address is None else address, code)

    def unread(self, code: str, unverified: bool) -> Unread | None:
        """Why *code* is not read; None if it is."""
        reason = self._left_out(code, unverified)
        return None if reason is None else Unread(reason, "not asked")

    def _left_out(self, code: str, unverified: bool) -> str | None:
        known = self.profile.describe(code)
        if known.address is None:
            return "its address is not known"
        if known.access == "wo":
            return "it can only be written"
        if "password" in known.label.lower():
            return "a password has no place in a file"
        if known.evidence == "assumed" and not unverified:
            return f"it is only assumed that this family has it: {known.reason}"
        return None

    def uncompared(self, code: str) -> str | None:
        """Why *code* tells nothing about how the drive is set; None if it does."""
        known = self.profile.describe(code)
        if code in self._faults:
            return "it belongs to the fault history"
        if known.access == "ro":
            return "it can only be read"
        if code in self._acts:
            return "writing it triggers an action, and it may read differently from what was written"
        return None

    def unasked(self, code: str, *, serial: bool, motor: bool, raw: Collection[str] = ()) -> str | None:
        """Why *code* is not given back unless that is asked for; None if it is."""
        if self.profile.describe(code).words > 1:
            return "it has two words, which a restore does not write: write it by its name"
        if code not in raw and self.is_raw(code):
            return Text("what it means is not known: restored only by its name, with ", argument("raw", written="[…]"))
        if not serial and self.is_serial(code):
            return Text("serial setting: restored only with ", argument("serial", True))
        if not motor and _among(code, self._motor):
            return Text("motor data: restored only with ", argument("motor", True))
        return None

    def is_raw(self, code: str) -> bool:
        """Whether nothing is known of *code* but that a drive has it: it has neither a name nor a scale."""
        known = self.profile.describe(code)
        return known.evidence == "unverified" and known.unit == "raw" and known.name == known.code

    def is_serial(self, code: str) -> bool:
        """Whether *code* is a setting of the serial line."""
        return _among(code, self._serial)

    def selected(self, codes: Iterable[str], groups: Sequence[str] | None) -> list[str]:
        """Those of *codes* that are in *groups* (groups such as `"P00"`, or single codes); all for None.

        Raises:
            NotAllowed: One of *groups* is none; the message has the closest.
        """
        codes = list(codes)
        if groups is None:
            return codes
        if isinstance(groups, str) or not all(isinstance(group, str) for group in groups):
            raise BadArgument(
                f'groups is {checks.shown(groups)}, not a list of groups; give one such as ["P00", "P09"]'
            )
        every = self.codes()
        known = {group_of(code) for code in every} | set(every)
        for group in groups:
            if group not in known:
                near = checks.closest(group, known)
                raise BadArgument(f"{self.profile.name} has no group {checks.shown(group)}{near}")
        return [code for code in codes if _among(code, frozenset(groups))]

    def last(self) -> list[str]:
        """What is written last, in this order: where the drive takes its commands and its setpoints from."""
        sources = [item.code for item in self.profile.control()]
        for name in self.profile.setpoint_names():
            sources += [item.code for item in self.profile.needs(name)]
        wanted = list(self.profile.last_parameters())
        # What decides who is in command comes after what decides where the setpoint comes from.
        return [*reversed([code for code in dict.fromkeys(sources) if code not in wanted]), *wanted]

    def bounds(self) -> list[tuple[str, str]]:
        """Pairs of parameters of which the first is never above the second."""
        pairs = []
        for code in self.codes():
            known = self.profile.describe(code)
            if known.low_from is not None:
                pairs.append((self._code(known.low_from), code))
            if known.high_from is not None:
                pairs.append((code, self._code(known.high_from)))
        return list(dict.fromkeys(pairs))

    def _code(self, name: str) -> str:
        return self.profile.describe(name).code or name


def _among(code: str, listed: frozenset[str]) -> bool:
    """Whether *listed* has *code* or its whole group."""
    return code in listed or group_of(code) in listed
