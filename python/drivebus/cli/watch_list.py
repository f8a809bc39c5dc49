"""What is watched of a drive: which registers are asked for, and what is known of them before the first answer.

`monitor` and the panel watch the same, and call it the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import drivebus
from drivebus.cli import names
from drivebus.cli.present.screen import Watched
from drivebus.cli.session import Session

__all__ = ["asked", "told_by", "watched"]


def watched(session: Session, drive: drivebus.Drive, wanted: Sequence[str] = (), tell_state: bool = True) -> Watched:
    """What is shown of *drive*: the *wanted* registers, or else its monitor registers.

    Args:
        session: The options that name the drive.
        drive: The drive.
        wanted: Names, codes or addresses.
        tell_state: Whether state and fault are asked for as well.

    Raises:
        NotAllowed: A name is wrong, or may not be read. Or no register of the family may be read.
    """
    profile = drive.profile
    # What the drive is does not change while one looks.
    usual = [name for name in drive.readable() if not name.startswith("identification")]
    known = [names.named(profile, text) for text in wanted] or usual
    if not known:
        raise drivebus.Unverified(
            f"no register of {profile.title} may be watched without --unverified; name the registers you want to see"
        )
    rows = {name: drive.describe(name) for name in known}
    hint = ""
    if not wanted and profile.role("frequency") not in rows:
        hint = "No proved register of this family has the frequency; --unverified shows more."
    where = f"{session.name}: " if session.name else ""
    told = {role: told_by(drive, role) if tell_state else None for role in ("state", "fault")}
    return Watched(
        session.called,
        f"{where}{profile.title} on {session.port}, unit {session.unit}",
        profile,
        rows,
        told["state"],
        told["fault"],
        {name: doubt for name, row in rows.items() if (doubt := names.evidence(profile, row)) != "verified"},
        hint,
    )


def told_by(drive: drivebus.Drive, role: str) -> str | None:
    """The register that has *role*, such as `"state"`, if it may be read."""
    name = drive.profile.role(role)
    try:
        return name and drive.readable(name)[0]
    except drivebus.NotAllowed:
        return None


def asked(drive: Watched) -> list[str]:
    """What has to be asked of *drive* so that all of it can be shown."""
    told = [name for name in (drive.state, drive.fault) if name is not None]
    return list(dict.fromkeys([*drive.rows, *told]))
