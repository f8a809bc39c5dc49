"""What a refusal says: that there is no such thing, that it is closed now, or nothing, as it was no decision."""

from __future__ import annotations

from drivebus.profile.profile import Profile

__all__ = ["means"]

_CLOSED = ("password_error", "password_protected", "locked_while_running", "read_refused")
"""What profiles call an exception by which a drive keeps closed what it has."""

_ILLEGAL_ADDRESS = 0x02
"""In the Modbus specification, and under this name in the profiles that list their exceptions."""

_UNREACHED = (0x0A, 0x0B)
"""A gateway's own: the unit behind it is out of reach. Modbus V1.1b3, section 7."""


def means(profile: Profile, code: int) -> str:
    """What the exception *code*, as the answer to one read or write, says in the family of *profile*.

    `"no_such"`: there is no such address. `"not_now"`: it is there, and closed. `"ask_again"`: the unit was busy or out
    of reach, or the request came damaged. `"taken"`: the request was taken, and the unit is still at it. Empty: the
    unit refused for another reason.
    """
    told, (name, _) = profile.exception_means(code), profile.exception(code)
    if told in ("ask_again", "taken"):
        return told
    if code not in profile.exceptions():
        return {_ILLEGAL_ADDRESS: "no_such"}.get(code, "ask_again" if code in _UNREACHED else "")
    if name == "illegal_address":
        return "no_such"
    return "not_now" if name in _CLOSED else ""
