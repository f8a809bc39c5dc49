"""What a refusal says: that there is no such thing, that it is closed now, or nothing, as it was no decision."""

from __future__ import annotations

from drivebus.profile.profile import Profile

__all__ = ["means"]

_BY_NAME = {
    "illegal_address": "no_such",
    "password_error": "not_now",
    "password_protected": "not_now",
    "locked_while_running": "not_now",
    "read_refused": "not_now",
    "frame_error": "ask_again",
}
"""By what profiles call an exception: its code means another thing in the next family."""

_BY_CODE = {0x02: "no_such", 0x05: "taken", 0x06: "ask_again", 0x0A: "ask_again", 0x0B: "ask_again"}
"""Of a family that does not say what a code means. Modbus V1.1b3, section 7: busy, acknowledged, a gateway's own."""


def means(profile: Profile, code: int) -> str:
    """What the exception *code* says in the family of *profile*.

    `"no_such"`: there is no such address. `"not_now"`: it is there, and closed. `"ask_again"`: the unit was busy or out
    of reach, or the request came damaged. `"taken"`: the request was taken, and the unit is still at it. Empty: the
    unit refused for another reason.
    """
    if code in profile.exceptions():
        name, _ = profile.exception(code)
        return _BY_NAME.get(name, "")
    return _BY_CODE.get(code, "")
