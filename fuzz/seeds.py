"""Writes the corpus's first files: frames of the manuals, and cases made by hand, each named by its kind.

`.venv/bin/python fuzz/seeds.py`. What libFuzzer found stands beside them, under the name that it gave. The language of
the streams is described in `src/stream.rs`.
"""

from __future__ import annotations

import re
from pathlib import Path

import tomli

import drivebus
from drivebus.sim import FAULT_KINDS

HERE = Path(__file__).resolve().parent
VECTORS = HERE.parent / "tests/vectors"
PROFILE = HERE / "src/profile"

# Records of a stream: the low half of their first byte. The high half is the time before: 0 none, 8 the silence, 12
# 16 ms, 14 300 ms.
ANYTHING, SEALED, TWO_WORDS, WORDS, MANY, EXCEPTION, RUN, NAMELESS = range(8)
ANSWER, OWN, DAMAGED, ODD, REFUSAL, ONE, LUMPS = 8, 10, 11, 12, 13, 14, 15
SILENT, LATER, LATE = 8 << 4, 12 << 4, 14 << 4


def crc(data: bytes) -> bytes:
    """CRC-16/MODBUS, bit by bit, as it travels."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return register.to_bytes(2, "little")


def sealed(body: bytes) -> bytes:
    """*body* with its CRC."""
    return body + crc(body)


def anything(data: bytes, gap: int = 0) -> bytes:
    """A record of bytes as they are."""
    return bytes([ANYTHING | gap, len(data)]) + data


def exchanges() -> list[tuple[str, bytes, bytes | None]]:
    """Every printed exchange: a name, the request and the answer, whichever there are."""
    found = []
    for path in sorted(VECTORS.glob("*.toml")):
        for number, row in enumerate(tomli.loads(path.read_text("utf-8")).get("exchange", [])):
            sides = [row.get(side, {}) for side in ("request", "answer")]
            request, answer = (bytes.fromhex(side.get("wire") or side.get("printed") or "") for side in sides)
            found.append((f"{path.stem}-{number:02}", request or answer, answer if request else None))
    return found


def streams() -> dict[str, bytes]:
    """Streams that a listener, a framer and a unit hear alike."""
    read = sealed(bytes([1, 3, 0x21, 3, 0, 1]))
    answer = sealed(bytes([1, 3, 2, 1, 0xA0]))
    inner = sealed(bytes([1, 6, 0x20, 0, 0, 1]))
    return {
        "request-and-answer": anything(read) + anything(answer, SILENT),
        "answer-in-lumps": bytes([LUMPS, LATER | 4]) + anything(answer),
        "bytes-one-by-one": bytes([LUMPS, 5 << 4 | 1]) + anything(read) + anything(answer, SILENT),
        "noise-before-and-after": bytes([RUN, 1, 9]) + anything(answer) + bytes([RUN, 0, 9]),
        "cut-short-then-whole": anything(read[:5]) + anything(read, LATER),
        "flipped-bit-then-whole": anything(bytes([1, 3, 2, 1, 0xA1]) + answer[5:]) + anything(answer, SILENT),
        "broadcast": bytes([TWO_WORDS, 0, 1, 0x20, 0, 0, 5]),
        "echo": bytes([TWO_WORDS, 1, 2, 0, 0, 0x12, 0xAB]),
        "other-diagnostic": bytes([TWO_WORDS, 1, 2, 0, 1, 0xFF, 0]),
        "longest-read": bytes([WORDS, 1, 125, 0, 0]) + bytes([WORDS | SILENT, 2, 125, 1, 3]),
        "longest-write": bytes([MANY, 1, 123, 0x20, 0]) + bytes([TWO_WORDS | SILENT, 1, 3, 0x20, 0, 0, 123]),
        "exceptions": b"".join(bytes([EXCEPTION | SILENT, unit, 3, unit]) for unit in range(4)),
        "nameless-by-silence": bytes([NAMELESS, 1, 0, 7, 9]) + bytes([NAMELESS | SILENT, 1, 1, 7, 9]),
        "longest-nameless": bytes([NAMELESS, 1, 0, 7, 252]) + anything(answer, SILENT),
        "frame-inside-the-longest": bytes([SEALED, 254, 1, 0x41]) + inner + bytes(244),
        "frame-inside-a-frame": bytes([SEALED, len(inner) + 6, 1, 3, 12, 0]) + inner + b"\0\0",
        "reserved-address": bytes([SEALED, 4, 250, 3, 1, 1]) + anything(read, SILENT),
        "odd-byte-count": bytes([SEALED, 4, 1, 3, 1, 7]),
        "no-registers": bytes([TWO_WORDS, 1, 0, 0, 0, 0, 0]) + bytes([WORDS | SILENT, 1, 0, 0, 0]),
        "missing-bias": bytes([RUN, 0, 255]) + bytes([RUN, 1, 255]) + anything(read, SILENT),
        "longer-than-is-held": bytes([RUN, 2, 255, RUN, 3, 255]) + anything(read) + bytes([RUN, 0, 99]),
        "nameless-behind-all-that-is-held": bytes([RUN, 1, 255, RUN, 1, 1, NAMELESS, 1, 0, 7, 9]),
        "noise-then-a-frame-inside-a-frame": bytes([ONE, 0xFF, SEALED | 10 << 4, 11, 1, 0x41]) + inner + b"\xff",
        "two-in-one-burst": anything(read + answer) + anything(answer + read, SILENT),
    }


def frames() -> dict[str, bytes]:
    """For `frame`: where to cut, then bytes; a request before the cut is judged against what stands behind it."""
    seeds = {}
    for name, request, answer in exchanges():
        pdu = request[1:-2]
        seeds[f"printed-{name}"] = len(request).to_bytes(2, "big") + request
        if answer:
            seeds[f"pair-{name}"] = len(pdu).to_bytes(2, "big") + pdu + answer[1:-2]
    longest = bytes([3, 250]) + bytes(250)
    return seeds | {
        "empty": b"",
        "longest-answer": b"\0\0" + longest,
        "longer-than-any-answer": b"\0\0" + bytes([3, 254]) + bytes(254),
        "longest-write": b"\0\0" + bytes([16, 0, 0, 0, 123, 246]) + bytes(246),
        "longest-frame": b"\0\0" + sealed(bytes([1]) + longest + bytes(1)),
        "too-long-a-frame": b"\0\0" + sealed(bytes([1]) + longest + bytes(4)),
        "more-words-than-asked": b"\0\5" + bytes([3, 0, 0, 0, 1]) + bytes([3, 4, 0, 1, 0, 2]),
        "fewer-words-than-asked": b"\0\5" + bytes([3, 0, 0, 0, 2]) + bytes([3, 2, 0, 1]),
        "another-value-echoed": b"\0\5" + bytes([6, 0, 1, 0, 2]) + bytes([6, 0, 1, 0, 3]),
        "last-register": b"\0\5" + bytes([3, 0xFF, 0xFF, 0, 1]) + bytes([3, 2, 0, 0]),
        "beyond-the-last-register": b"\0\5" + bytes([3, 0xFF, 0xFF, 0, 2]) + bytes([3, 4, 0, 0, 0, 0]),
    }


def masters() -> dict[str, bytes]:
    """For `master`: the line, then what is asked (kind and time-out, two words) and what happens meanwhile."""
    # 13: 49 ms of patience. Nothing comes (0) before the request goes out and while it does; then records, with a byte
    # before each.
    read, write, echo, many = (bytes([6, kind | 13 << 4, 0, 5, 0, 2]) for kind in (1, 2, 3, 5))
    go = b"\0\0"

    def then(*records: bytes) -> bytes:
        return b"".join(b"\0" + record for record in records)

    answer, refusal = bytes([ANSWER | SILENT, 0, 0x13, 0x88]), bytes([REFUSAL | SILENT, 0, 2])
    late, old = bytes([ANSWER | LATE, 0, 1, 1]), bytes([ANSWER | SILENT, 1, 1, 1])
    asks = {"read": read, "write": write, "echo": echo, "write-many": many}
    seeds = {f"{name}-answered": b"\0" + ask + go + then(answer) for name, ask in asks.items()}
    seeds |= {f"{name}-refused": b"\0" + ask + go + then(refusal) for name, ask in asks.items()}
    adapter = bytes([OWN, 0])
    nameless = bytes([6, 6 | 13 << 4, 0, 5, 0, 2])
    urgent = bytes([5]) + read[1:]
    return seeds | {
        "late-then-echo": b"\0" + read + go + then(late) + read + echo + go + then(answer) + read + go + then(answer),
        "late-then-wrong-echo": b"\0" + read + go + then(late) + echo + go + then(late) + echo + go + then(old, answer),
        "echoing-adapter": b"\1" + write + go + then(adapter, answer) + read + go + then(adapter, answer),
        "only-the-adapter": b"\1" + write + go + then(adapter),
        "gapless": b"\2" + read + go + then(answer) + write + go + then(answer),
        "in-lumps": b"\0" + read + go + then(bytes([LUMPS, LATER | 4]), answer),
        "damaged": b"\0" + read + go + then(bytes([DAMAGED | SILENT, 0, 1, 1, 3, 4])) + echo + go + then(answer),
        "odd": b"\0" + read + go + then(bytes([ODD | SILENT, 0, 1, 1, 1, 0]), bytes([ODD | SILENT, 0, 1, 1, 1, 1])),
        "foreign-then-right": b"\0" + read + go + then(bytes([WORDS | SILENT, 2, 2, 0, 0]), answer),
        "noise-while-sending": b"\0" + read + bytes([0, 7, RUN, 1, 4]) + then(answer),
        "given-up": b"\0" + read + go + b"\xff" + read + b"\xff" + echo + go + then(answer),
        "stop-in-doubt": b"\0" + read + go + then(late) + urgent + go + then(answer) + read,
        "broadcast": b"\0" + bytes([4, 2, 0x20, 0, 0, 5]) + go + bytes([4, 0, 0, 0, 0, 1]),
        "nameless": b"\0" + nameless + go + then(bytes([ANSWER | SILENT, 0, 0, 0])),
        "strays": b"\0" + bytes([2, WORDS, 1, 1, 0, 0]) + bytes([2, RUN | SILENT, 1, 9]) + read + go + then(answer),
        "busy-line": b"\0" + bytes([2, LUMPS, 6 << 4 | 1]) + read + bytes([7, RUN, 1, 200]) + read + go + then(answer),
        "released-and-reopened": b"\0" + read + go + then(late) + b"\0\1" + read + go + then(answer),
    }


def conversations() -> dict[str, bytes]:
    """For `conversation`: the line, what is asked and how, then what is said to it."""
    # 34: 5 s after the line was opened, by an adapter that does not echo. 0: a record is what comes where it listens;
    # 5: nothing comes.
    settled, fresh, others = b"\x22", b"\0", b"\x2a"
    go = b"\5" * 4
    answer, late = b"\0" + bytes([WORDS, 1, 1, 0, 7]), b"\0" + bytes([WORDS | LATE, 1, 1, 0, 7])
    more = b"\0" + bytes([WORDS, 1, 2, 0, 7])
    echo = b"\0" + bytes([ANSWER, 0, 0, 0])
    confirmed, busy = b"\0" + bytes([TWO_WORDS, 1, 1, 0, 9, 0, 5]), b"\0" + bytes([EXCEPTION, 1, 6, 6])
    read, twice, write, surely = b"\0\0", b"\0\x21", b"\3\1", b"\3\x41"
    return {
        "read": settled + read + go + answer + go,
        "read-again": settled + b"\0\2" + go * 3 + late + go + answer + go,
        "verified": settled + twice + go + answer + go + answer + go,
        "write": settled + write + go + confirmed + go,
        "write-in-silence": settled + write + go * 6,
        "write-read-back": settled + surely + go * 3 + echo + go + more + go + confirmed + go,
        "write-busy": settled + surely + go + busy + go + answer + go + confirmed + go,
        "first-contact": fresh + b"\0\0" + go + answer + go + echo + go + answer,
        "stop-at-first-contact": fresh + b"\0\x08" + (go + answer) * 6,
        "beside-others": others + read + (go + answer + more) * 6,
        "cut-before-it-began": settled + b"\3\3" + b"\x0a" + go * 4,
        "out-of-turn": settled + read + b"\x09" + answer[1:] + b"\x08\7\7" + go + b"\x0e\x0d" + go,
        "time-goes-back": settled + read + go + b"\xfe" + go,
        "two-at-once": settled + write + b"\5\5\x0e\x0f" + go + b"\x1f" + go + confirmed,
        "opened-under-a-request": settled + write + go + b"\x0d" + confirmed + go,
        "broadcast": settled + b"\xf3\0" + go,
    }


def buses() -> dict[str, bytes]:
    """For `bus`: how many calls (and whether the adapter may echo), the calls, what comes after each transmission."""
    read, write, echo, custom = (bytes([kind, 0, 0x10, 5, 0, 1]) for kind in (0, 3, 5, 6))
    answer, late, own = bytes([ANSWER | SILENT, 0, 0, 7]), bytes([ANSWER | LATE, 0, 0, 7]), bytes([OWN, 0])
    # The same call with a second look: a read that is verified, a write that is read back.
    sure_read, sure_write = bytes([8]) + read[1:], bytes([11]) + write[1:]
    taken = bytes([ANSWER | SILENT, 0, 0, 1])
    babble = bytes([LUMPS | SILENT, 5 << 4 | 1, RUN, 1, 255])
    one, two, none, lost = b"\1", b"\2", b"\0", b"\xfc"
    return {
        "read": b"\0" + read + (one + answer) * 4,
        "write": b"\0" + write + (one + answer) * 4,
        "calls": b"\3" + read + write + echo + custom + (one + answer) * 12,
        "verified": b"\0" + sure_read + (one + answer) * 6,
        "verified-differently": b"\0" + sure_read + (one + answer + one + taken) * 6,
        "read-back-taken": b"\0" + sure_write + one + answer + none + (one + answer + one + taken) * 2,
        "read-back-other": b"\0" + sure_write + (one + answer + none) * 9,
        "babble-after-reading-back": b"\0" + sure_write + one + answer + none + one + answer + b"\3" + answer + babble,
        "gateway": b"\x11" + read + write + (one + answer) * 8,
        "gateway-overtaken": b"\x12" + read + read + read + one + late + (one + answer) * 12,
        "late": b"\1" + read + read + one + late + (one + answer) * 8,
        "late-and-repeated": b"\1" + read + read + two + late + late + (two + late + answer) * 8,
        "mute": b"\1" + read + write + none * 12 + (one + answer) * 6,
        "echoing-adapter": b"\x0a" + read + write + read + (two + own + answer) * 9,
        "only-the-adapter": b"\x0a" + read + write + read + (one + own) * 9,
        "unplugged": b"\1" + read + read + lost + (one + answer) * 6,
        "unplugged-twice": b"\0" + write + lost + one + answer + lost + (one + answer) * 4,
        "broadcast": b"\1" + bytes([0xF3]) + write[1:] + read + none + (one + answer) * 6,
        "noise": b"\1" + read + write + (two + bytes([RUN | SILENT, 1, 30]) + answer) * 8,
        "damaged": b"\1" + read + write + (one + bytes([DAMAGED | SILENT, 0, 0, 7, 3, 4])) * 4 + (one + answer) * 8,
        "refused": b"\1" + read + write + (one + bytes([REFUSAL | SILENT, 0, 2])) * 8,
        "in-lumps": b"\0" + read + (two + bytes([LUMPS, LATER | 4]) + answer) * 4,
        "foreign-first": b"\0" + read + (two + bytes([WORDS | SILENT, 9, 2, 0, 0]) + answer) * 4,
    }


def guests() -> dict[str, bytes]:
    """For `guest`: whether it is greeted rightly, then messages as `postcard` writes them, each behind its length."""
    calls, listening, overhearing, figures, link, word, reconnects, wills, cancel, halts = range(10)
    second = b"\x80\x94\xeb\xdc\x03"  # nanoseconds, seven bits a byte
    for_ever = b"\xff" * 9 + b"\x01"

    def say(*messages: bytes) -> bytes:
        return b"\1" + b"".join(bytes([len(message)]) + message for message in messages)

    def call(pdu: bytes, unit: int = 1, timeout: bytes = second, priority: int = 2, more: bytes = b"\0" * 5) -> bytes:
        request = bytes([calls, unit, len(pdu)]) + pdu
        return request + b"\0" + timeout + b"\0\0\0" + bytes([priority, 2]) + more

    read, write, echo = bytes([3, 0x21, 3, 0, 1]), bytes([6, 0x80, 11, 0, 5]), bytes([8, 0, 0, 0x12, 0xAB])
    many = bytes([16, 0x80, 11, 0, 2, 4, 0, 1, 0, 2])
    [version] = re.findall(rb'GREETING.*b"drivebus share \\x(..)"', (HERE / "src/guest.rs").read_bytes())
    other = bytes([int(version, 16) - 1])
    hello = b"drivebus share " + bytes.fromhex(version.decode()) + b"\1f\x80\x96\1\x08E\1\0"
    greet = b"\0" + bytes([len(hello)]) + hello
    return {
        "read": say(call(read)),
        "write-then-read": say(call(write, priority=1), call(read)),
        "stop": say(call(bytes([6, 0x20, 0, 0, 5]), priority=0)),
        "write-many": say(call(many, priority=1)),
        "echo": say(call(echo)),
        "read-back": say(call(write, priority=1, more=b"\0\1\x8b\x80\2\0\0\0")),
        "on-a-connection": say(call(write, priority=1, more=b"\0\0\1\0\0\0")),
        "unless-halted": say(bytes([halts, 1]), call(write, priority=1, more=b"\0\0\0\1\0\0")),
        "verified": say(call(read, more=b"\1\0\0\0\0")),
        "says-meanings": say(call(read, more=b"\0\0\0\0\1\2\1\2\6\xff")),
        "nobody": say(call(read, unit=9)),
        "broadcast": say(call(write, unit=0, priority=1)),
        "no-unit": say(call(read, unit=250)),
        "no-priority": say(call(read, priority=9)),
        "for-ever": say(call(read, unit=9, timeout=for_ever)),
        "asks-for-figures": say(*(bytes([kind]) for kind in (figures, word, reconnects)), bytes([link, 1])),
        "listens": say(bytes([listening]) + second),
        "listens-for-ever": say(bytes([listening]) + for_ever),
        "overhears": say(bytes([overhearing]) + second),
        "tells-of-a-will": say(bytes([wills])),
        "cancels": say(bytes([cancel]), bytes([listening]) + second + bytes([cancel])),
        "greets-itself": greet + bytes([1, word]),
        "greets-for-a-stop": b"\0" + bytes([len(hello)]) + hello[:-1] + b"\1" + bytes([1, word]),
        "another-version": b"\0" + bytes([len(hello)]) + hello[:15] + other + hello[16:],
        "other-characters": b"\0" + bytes([len(hello)]) + hello.replace(b"E", b"N"),
        "no-greeting": b"\0" + b"\5hello",
        "too-long": b"\1\xff\4\xff\xff\0\0",
        "cut-short": b"\1\xff\6\x20\0\0\0\0\1",
        "nothing": b"\1",
        "gone-at-once": b"\0",
    }


def profiles() -> dict[str, bytes]:
    """For `profile`: each file of the small profile by itself, and cases that are easily got wrong."""
    names = ["profile.toml", "registers.csv", "parameters.csv", "faults.csv"]
    texts = {number: (PROFILE / name).read_text("utf-8") for number, name in enumerate(names)}

    def instead(number: int, old: str, new: str) -> bytes:
        if old not in texts[number]:
            raise SystemExit(f"seeds: {names[number]} does not hold {old!r}")
        return f"=== {number}\n{texts[number].replace(old, new, 1)}".encode()

    seeds = {f"all-of-{name}": f"=== {number}\n{texts[number]}".encode() for number, name in enumerate(names)}
    seeds |= {f"empty-{name}": f"=== {number}\n".encode() for number, name in enumerate(names)}
    head = texts[1].splitlines()[0]
    return seeds | {
        "nothing-said": b"",
        "not-utf-8": b"=== 3\n" + texts[3].encode() + b"\xff\xfe\n",
        "byte-order-mark": b"=== 1\n\xef\xbb\xbf" + texts[1].encode(),
        "carriage-returns": b"=== 2\n" + texts[2].replace("\n", "\r\n").encode(),
        "open-quote": instead(1, '"a, b"', '"a, b'),
        "nul": instead(1, "made up", "made\0up"),
        "header-only": f"=== 1\n{head}\n".encode(),
        "huge-number": instead(1, "630.00", "1e999999999999999999999"),
        "tiny-number": instead(1, "630.00", "1e-999999999"),
        "many-digits": instead(1, "630.00", "0" * 400 + "1." + "0" * 400),
        "least-word": instead(1, "-20.0,120.0", "-3276.8,3276.7"),
        "one-value": instead(1, "-20.0,120.0", "0x0A,0x0A"),
        "no-bounds": instead(1, "10,yes,,-20.0,120.0", ",no,,,"),
        "last-addresses": instead(1, "3004H", "7FFFH"),
        "hex-default": instead(2, ",50.00,stop", ",0x1388,stop"),
        "choice-twice": instead(2, "0=keypad;2=bus", "0=bus;2=BUS"),
        "choice-out-of-range": instead(2, "0=keypad;2=bus", "0=keypad;65535=bus"),
        "deep-toml": b"=== 0\nx = " + b"[" * 200 + b"\n",
        "dotted-toml": b"=== 0\n" + b".".join([b"a"] * 200) + b" = 1\n",
        "long-name": instead(0, 'registers = ["frequency"', f'registers = ["{"frequency" * 60}"'),
        "bits-overlap": instead(0, "bits = [2, 1]", "bits = [15, 0]"),
        "max-words": instead(0, "max_words = 4", "max_words = 125"),
        "over-a-shipped-one": b'=== 0\nname = "a"\nsource = "b"\n[overlay]\nprofile = "gd350"\n',
        "a-sister": b'=== 0\nname = "a"\nsource = "b"\ndrop = ["P00.03"]\n'
        b'[extends]\nprofile = "gd350"\nassumption = "c"\n',
        "over-itself": b'=== 0\nname = "a"\nsource = "b"\n[overlay]\nprofile = "./"\n',
        "two-words-at-the-end": instead(1, "0x3006", "0xFFFF"),
        "two-words-overlap": instead(1, "0x3006", "0x30FF").replace(b"0x7001", b"0x3100"),
        "wide-and-signed": instead(1, "1,no,2", "1000,yes,2"),
        "rectifier": instead(0, 'title = "Small drive"', 'title = "Small drive"\nkind = "rectifier"'),
        "state-by-nothing": instead(0, "fields = { ready = 0 }", "fields = {}"),
        "no-such-field": instead(0, "fields = { ready = 0 }", "fields = { x = 0 }"),
        "variant-out-of-range": instead(0, "high = 600.0", "high = 6e9"),
        "variant-not-there": instead(1, "speed_unit", "sped_unit"),
        "memory-low-bit": instead(0, "bit = 15", "bit = 8"),
    }


def drives() -> dict[str, bytes]:
    """What a drive is told, and what becomes of the answers. A lie's number is that of its shape in `drive.py`."""
    run, reverse, jog, stop, coast, reset, jog_stop, write, read, status = (1, 2, 3, 5, 6, 7, 8, 9, 10, 11)
    wait, trip = 0, 12
    first_lie = 8 * len(FAULT_KINDS)
    first_lie += -first_lie % 8

    def call(what: int, argument: int = 20, *answers: tuple[int, bytes]) -> bytes:
        return bytes([what, argument, len(answers)]) + b"".join(bytes([gap]) + how for gap, how in answers)

    def fault(kind: str, gap: int = 0) -> tuple[int, bytes]:
        return gap, bytes([FAULT_KINDS.index(kind)])

    def lie(shape: int, data: bytes, gap: int = 0) -> tuple[int, bytes]:
        return gap, bytes([first_lie + shape]) + data

    said_stopped, said_forward = lie(2, b"\0\3", 1), lie(2, b"\0\1", 1)
    cases = {
        "a-job": call(run) + call(wait, 32) + call(status) + call(stop) + call(wait, 64) + call(coast),
        "stop-lost": call(run) + call(stop, 0, fault("deaf"), fault("deaf", 1)),
        "stop-unheard": call(run) + call(stop, 0, fault("silence"), fault("silence", 1)),
        "stop-said-to-stand": call(run) + call(stop, 0, fault("deaf"), said_stopped, said_stopped),
        "coast-unheard": call(run) + call(coast, 0, fault("silence")),
        "coast-lost": call(run) + call(coast, 0, fault("deaf")),
        "run-lost": call(run, 20, fault("deaf", 3)) + call(run, 30, fault("deaf"), fault("deaf", 1)),
        "run-unheard": call(run, 20, *(fault("silence", 1) for _ in range(6))),
        "run-said-to-turn": call(run, 20, *(said_forward for _ in range(8))),
        "run-late": call(run, 20, *(fault("late", 1) for _ in range(6))) + call(stop),
        "run-overtaken": call(run, 20, *(fault("overtaken", 1) for _ in range(6))) + call(stop) + call(run),
        "stops-overtaken": call(run) + call(stop, 0, fault("overtaken")) + call(run) + call(stop, 0, fault("deaf")),
        "reversed": call(run) + call(wait, 8) + call(reverse) + call(wait, 40) + call(stop),
        "jogged": call(jog) + call(jog_stop, 0, fault("silence")) + call(jog, 0, fault("flip_bit", 2)),
        "tripped": call(run) + call(trip) + call(stop) + call(reset, 0, fault("silence", 1)) + call(run),
        "written-twice": call(write, 50, fault("silence")) + call(write, 60, fault("deaf")) + call(read),
        "read-overtaken": call(read, 0, fault("overtaken")) + call(write, 70) + call(read) * 3,
        "in-pieces": call(run, 20, *(fault("split") for _ in range(8)))
        + call(stop, 0, fault("split"), fault("foreign", 1)),
        "unplugged": call(run, 20, fault("unplug", 3)) + call(stop) + call(status) + call(stop),
        "anything": call(
            run, 20, lie(0, b"\6\1\3\2\0\3\0"), lie(1, b"\3\x83\1\0"), lie(6, b"\3\6"), lie(7, b"\0\1\0\3")
        ),
        "confirmed-by-anybody": call(run, 20, *(lie(5, b"") for _ in range(5)))
        + call(stop, 0, lie(4, b"\5"), lie(4, b"\5")),
    }
    return {name: b"\4\1" + data for name, data in cases.items()} | {
        "echoing-adapter": b"\x14\1" + cases["a-job"] + cases["stop-lost"]
    }


def clients() -> dict[str, bytes]:
    """For `gateway`: the length of the pieces less one, then what a client of Modbus TCP sends."""

    def asked(number: int, unit: int, pdu: bytes) -> bytes:
        return number.to_bytes(2, "big") + bytes([0, 0, 0, 1 + len(pdu), unit]) + pdu

    read, write = bytes([3, 0x21, 3, 0, 1]), bytes([6, 0x20, 0, 0, 1])
    return {
        "one": b"\xff" + asked(1, 1, read),
        "by-the-byte": b"\0" + asked(1, 1, read) + asked(2, 2, write),
        "longest": b"\x40" + asked(0xFFFF, 255, bytes([0x10]) + bytes(252)) + asked(1, 1, read),
        "half": b"\xff" + asked(1, 1, read)[:-1],
        "no-body": b"\xff" + bytes([0, 1, 0, 0, 0, 1, 1]),
        "too-long": b"\xff" + bytes([0, 1, 0, 0, 0, 255]) + bytes(255),
        "http": b"\xff" + b"GET / HTTP/1.1\r\n\r\n",
        "tls-behind-one": b"\x0b" + asked(1, 1, read) + bytes.fromhex("16030102000100"),
        "rtu": b"\x05" + sealed(b"\x01" + read) + sealed(b"\x02\x41\x07") + sealed(b"\x02" + write)[:-1] + b"\0",
        "rtu-longest": b"\xff" + sealed(b"\x01\x10\0\0\0\x7b\xf6" + bytes(246)) + sealed(b"\x01" + read)[:-1],
    }


def operations() -> dict[str, bytes]:
    """For `operation`: who the unit is named as, the operation, its times, and what comes of each wish."""
    # What comes of a request: silence, damaged, refused, lost; any word, a code, a small one, what it said before.
    silence, damaged, refused, lost, word, code, small, same = 0, 1, 2, 4, 8, 10, 11, 12
    soon = 2 << 4
    identify, check, stop, coast = 0, 1, 3, 4
    run, run_at, jog_back, reset = 0x48, 0x4C, 0x4B, 0x4F
    families = range(len(drivebus.profiles()))
    return {
        "nothing": b"",
        **{f"stop-{family}": bytes([family, stop, 40, 20]) + bytes([soon | same]) * 200 for family in families},
        **{f"coast-{family}": bytes([family, coast, 40, 20]) + bytes([soon | small, 3] * 100) for family in families},
        "identify-code": bytes([0, identify, 0, 0, soon | code, 3]) + bytes([soon | same]) * 40,
        "identify-refusals": bytes([0, identify, 0, 0]) + bytes([soon | refused, 2]) * 60,
        "check-lost": bytes([1, check, 0, 0]) + bytes([soon | lost, soon | word, 1, 0xA0]) * 10,
        "stop-busy": bytes([2, stop, 200, 40]) + bytes([soon | refused, 6]) * 80,
        "stop-damaged": bytes([0, stop, 200, 40]) + bytes([soon | damaged, 3, 1, 3, 2]) * 40,
        "stop-silent": bytes([0, stop, 100, 100, silence]),
        **{f"run-{family}": bytes([family, run, 0, 40]) + bytes([soon | same, 0] * 100) for family in families},
        **{
            f"run-at-{family}": bytes([family, run_at, 0, 40, 10]) + bytes([soon | small, 3] * 90)
            for family in families
        },
        **{f"reset-{family}": bytes([family, reset, 0, 40]) + bytes([soon | small, 4] * 90) for family in families},
        "jog-halted": bytes([14, jog_back, 0, 40]) + bytes([soon | small, 3] * 9) + b"\xff" * 20,
        "run-lost": bytes([14, run, 0, 40]) + bytes([soon | same, 0] * 9) + bytes([lost, soon | small, 2] * 30),
        "stop-another": bytes([0, stop, 100, 100]) + bytes([soon | code, 9, soon | small, 1]) * 60,
    }


def main() -> None:
    """The command."""
    listened = streams()
    framer = {name: bytes([0, 1, 2, 3]) + stream for name, stream in listened.items()}
    framer["held-noise-then-a-frame"] = bytes([0, 1, 2, 3, RUN, 3, 255, SEALED | 10 << 4, 2, 1, 0x41])
    hunts = {"words": 1, "write": 2, "echo": 3, "nameless": 4, "nameless-of-7": 5 | 6 << 3}
    answer, noise = anything(sealed(bytes([1, 3, 2, 1, 0xA0]))), bytes([RUN, 1, 9])
    framer |= {f"hunt-{name}": bytes([hunt, 1, 2, 3]) + noise + answer + noise for name, hunt in hunts.items()}
    framer |= {
        f"lumps-of-{size}": bytes([6 | 31 << 3, 0, 0, 0, 1, 2]) + bytes([LATER | size]) * 90 for size in (1, 4, 9)
    }
    corpus = {
        "bus": buses(),
        "conversation": conversations(),
        "drive": drives(),
        "frame": frames(),
        "framer": framer,
        "gateway": clients(),
        "guest": guests(),
        "listener": listened,
        "master": masters(),
        "operation": operations(),
        "profile": profiles(),
        "sniffer": listened,
        "slave": {name: b"\0" + stream for name, stream in listened.items()},
    }
    for target, seeds in corpus.items():
        folder = HERE / "corpus" / target
        folder.mkdir(parents=True, exist_ok=True)
        for name, data in seeds.items():
            (folder / name).write_bytes(data)
        print(f"{target}: {len(seeds)} seeds")


if __name__ == "__main__":
    main()
