"""How soon a stop is on a line that was just opened, to a unit that the line has not identified.

Each family is named rightly. What is looked at first costs some 15 ms a question at 19200; none of it waits for a
second, whatever the drive makes of the loop-back (08H).
"""

from __future__ import annotations

import pytest

import drivebus
from drivebus import Bus, Profile, Simulator

QUESTIONS = {
    **dict.fromkeys(("vfd500", "wj200", "x200", "h100"), (0, 4)),
    **dict.fromkeys(("gd350", "gd35", "gd35-h1", "gd300", "gd10", "gd20", "gd100", "gd200a"), (4, 75)),
    # These do not say what they are, and others have a parameter where they have their state.
    **dict.fromkeys(("gd600", "gd3000"), (6, 107)),
    # An MD500 and a Sunfar have parameters up to FFFFH.
    "vf-s15": (6, 103),
    **dict.fromkeys(("eds300", "sunfar-e300", "fc202"), (5, 90)),
    # One of these is also asked for 200BH, which a YL620 has: it would turn at ten times the speed.
    # And for 091BH, by which a GS2 runs, and for 2108H or 2105H: a VFD-B has both.
    **dict.fromkeys(("ms300", "vfd-e", "vfd-b"), (8, 142)),
    # And this one for 3F5BH, which an FC 202 has.
    "fc51": (6, 108),
    "yl620": (4, 75),
    # Where this one is commanded, a CHF100A or a VFD500 may have a parameter.
    # Both are asked for a parameter that the other has not.
    "e510": (6, 109),
    "f510": (6, 109),
    "gs2": (6, 108),
    "gs4": (6, 108),
    "md500": (5, 90),
    # These are also asked for 080EH, which a FRENIC has: it answers 0 to what it does not use.
    "fr-d700": (6, 112),
    "a1000": (8, 140),
    "j1000": (9, 158),
    # And these, and for 7000H and 2520H: an MD500 has its setpoint, an F510 a parameter where they take their commands.
    # And for 1028H, which an X200 has.
    **dict.fromkeys(("chf100a", "saj8000m"), (12, 205)),
    # An Altivar 600 is asked for CHCF, too: in its I/O profile 07H runs it. By the other two names nobody would ask it,
    # so one more word tells that they are none.
    **dict.fromkeys(("atv312", "atv12", "atv320", "atv600", "atv71"), (7, 120)),
    # And this one for 0502H, the output frequency of a Nowforever, which may have parameters where this has its fault.
    "cfw500": (9, 158),
    # Where it is commanded, most others have a parameter, and a Yaskawa stores what it has.
    "nowforever": (17, 290),
    # And for its own 0013H and 001AH; register 1 is a parameter of Goodrives and others.
    "smd": (10, 172),
    # At 0005H many another drive has a parameter. What has 04H answers by it elsewhere.
    "starvert": (5, 90),
    "frenic": (9, 158),
    "v20": (9, 158),
    # A WJ200 and an X200 have their direction where this one stops.
    "sj200": (7, 125),
    # It is commanded where Goodrives and others have parameters, some of them without a code.
    "optidrive-e3": (9, 158),
    # The same, and an Optidrive E3 has its other words.
    "dc1": (9, 158),
    # And the fault of a Vacon 10, which has parameters at 006FH and 0005H.
    "optidrive-p2": (10, 175),
    # An ACS355 and others have parameters where this one is commanded.
    "vacon10": (9, 155),
    # An ACS355 is also asked for 16A8H, which an ACS580 has: 20000 counts are another frequency there; and for 0030H,
    # which a CFW500 has.
    # And for 2649H, its 9802, which a Vacon 10 has not.
    "acs355": (13, 221),
    "acs580": (9, 155),
    # Nothing is asked: what halts it says nothing to a drive of Modbus. The line is silent for 50 ms before.
    "huanyang-hy": (0, 55),
}
"""Requests before the first frame that halts, and milliseconds of the line's time until it goes out, at most."""


@pytest.mark.parametrize("family", sorted(QUESTIONS))
def test_a_stop_of_a_family_on_a_line_just_opened(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        bus.drive(1, family, unverified=True).stop()
        sent = [(time, frame) for time, who, frame in simulator.line.trace() if who == "master"]
    profile = Profile.builtin(family)
    halts = {profile.command("stop"), profile.command_first("stop")}
    places = {place & 0xFFFF for place, _ in filter(None, halts)}
    is_halt = [
        frame[1] in (5, 6, 16) and int.from_bytes(frame[2:4], "big") in places
        if profile.requests().protocol == "modbus"
        else frame[1:4] == bytes((3, 1, 8))
        for _, frame in sent
    ]
    before = is_halt.index(True)
    requests, milliseconds = QUESTIONS[family]
    assert before <= requests
    assert sent[before][0] * 1e3 <= milliseconds


def test_the_table_has_every_family_that_halts() -> None:
    assert set(QUESTIONS) == {name for name in drivebus.profiles() if "stop" in Profile.builtin(name).commands()}
