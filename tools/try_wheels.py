"""Installs the wheels of dist/wheels/ into systems that are not this one, and uses them there.

    python -m tools.try_wheels [NAME …]

    NAME      a system of the table by a part of its name, as `debian-13`; all without one

Each is unpacked into target/roots/ from Debian's packages, without touching this system and without being root, and
entered by a user namespace. Where a system has no CPython of 3.10 or newer, one is built there from the sources that
Debian 12 has; the first time takes some minutes. In each, pip installs the wheel, and `drivebus demo` must end well.

This needs Debian 12 on x86_64, as `make wheels` does. The exit code is 1 when a wheel did not work somewhere.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from tools.settle_wheel import ROOT

ROOTS = ROOT / "target" / "roots"
WHEELS = ROOT / "dist" / "wheels"
# Whose signatures hold: of Debian's packages, and of the servers that pip asks.
KEYRING = "/usr/share/keyrings/debian-archive-keyring.gpg"
CERTIFICATES = Path("/etc/ssl/certs/ca-certificates.crt")
# Where a CPython is put that is built in a system, and what it takes beside the C library.
BUILT = "/opt/python"
COMPILED = ("?essential", "gcc", "make")
# The Python, and the newest tag that its pip takes, which names the C library.
FACTS = """
import platform, pip._vendor.packaging.tags as tags
print(f"CPython {platform.python_version()}, {next(tags.sys_tags()).platform}")
"""


@dataclass(frozen=True)
class System:
    """One system: what it is, and what it takes to use a wheel there."""

    name: str
    suite: str
    packages: tuple[str, ...]
    tag: str
    # What its CPython is built with, where it has none that is new enough.
    compiler: str = ""
    # What its own pip says to the wheel, where its own Python is too old.
    refusal: str = ""
    # Whether nothing is left of it but its C library and a Python.
    is_bare: bool = False


SYSTEMS = (
    System(
        "debian-11",
        "bullseye",
        (*COMPILED, "libc6-dev", "libffi-dev", "libssl-dev", "python3", "python3-pip"),
        "manylinux_2_17_x86_64",
        compiler="gcc",
        refusal="is not a supported wheel on this platform",
    ),
    System("debian-13", "trixie", ("?essential", "python3", "python3-venv"), "manylinux_2_17_x86_64"),
    # Without the headers of glibc, so that nothing of it gets in.
    System("musl", "bookworm", (*COMPILED, "musl-tools"), "musllinux_1_2_x86_64", compiler="musl-gcc", is_bare=True),
)


def mirror() -> str:
    """Where this system takes Debian's packages from."""
    lacking = "try_wheels: this needs Debian 12 on x86_64, with a mirror of it in apt's sources"
    if not shutil.which("apt-get") or platform.machine() != "x86_64":
        raise SystemExit(lacking)
    wanted = ["Created-By: Packages", "Origin: Debian", "Label: Debian", "Release: bookworm"]
    targets = ["apt-get", "indextargets", "--format", "$(REPO_URI)", *wanted]
    found = subprocess.run(targets, check=True, capture_output=True, text=True).stdout.split()
    if not found:
        raise SystemExit(lacking)
    return found[0]


class Apt:
    """apt for one release of Debian, with lists of its own."""

    def __init__(self, suite: str) -> None:
        place = self.place = ROOTS / f"apt-{suite}"
        for folder in ("lists/partial", "cache/archives/partial", "files"):
            (place / folder).mkdir(parents=True, exist_ok=True)
        (place / "status").touch()
        source = f"[signed-by={KEYRING}] {mirror()} {suite} main\n"
        (place / "sources.list").write_text(f"deb {source}deb-src {source}")
        own = {
            "APT::Sandbox::User": "root",
            "Acquire::Languages": "none",
            "Acquire::Retries": "5",
            "Dir::Cache": str(place / "cache"),
            "Dir::Etc::sourcelist": str(place / "sources.list"),
            "Dir::Etc::sourceparts": "/dev/null",
            "Dir::State": str(place),
            "Dir::State::lists": str(place / "lists"),
            "Dir::State::status": str(place / "status"),
        }
        self.options = [word for name, value in own.items() for word in ("-o", f"{name}={value}")]
        self("update")

    def __call__(self, *command: str) -> str:
        """What apt-get says to a command."""
        whole = ["apt-get", "-qq", *self.options, *command]
        done = subprocess.run(whole, cwd=self.place / "files", capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"try_wheels: apt-get {' '.join(command)} failed:\n{done.stderr}")
        return done.stdout

    def unpack(self, packages: tuple[str, ...], root: Path) -> None:
        """Unpacks packages and what they need. None is set up: that would take the rights of root."""
        plan = self("--simulate", "--no-install-recommends", "install", *packages)
        names = [line.split()[1] for line in plan.splitlines() if line.startswith("Inst ")]
        self("download", *names)
        for folder in ("bin", "lib", "lib64", "sbin"):
            (root / "usr" / folder).mkdir(parents=True)
            (root / folder).symlink_to(f"usr/{folder}")
        for deb in (self.place / "files").glob("*.deb"):
            # As `dpkg -x`, which would lay a folder over the links.
            files = subprocess.run(["dpkg-deb", "--fsys-tarfile", str(deb)], check=True, capture_output=True).stdout
            tar = ["tar", "--extract", "--no-same-owner", "--keep-directory-symlink", "--directory", str(root)]
            subprocess.run(tar, input=files, check=True)
            deb.unlink()

    def source(self, package: str, folder: Path) -> None:
        """Unpacks the sources of a package, as its authors wrote them, to `folder`."""
        self("source", "--download-only", package)
        files = self.place / "files"
        (archive,) = files.glob("*.orig.tar.*[z2]")
        folder.mkdir()
        tar = ["tar", "--extract", "--strip-components=1", "--no-same-owner", "--directory", str(folder)]
        subprocess.run([*tar, "--file", str(archive)], check=True)
        for file in files.iterdir():
            file.unlink()


def inside(root: Path, *command: str, check: bool = True) -> subprocess.CompletedProcess[str]:
    """Runs a command in `root`."""
    enter = 'for part in dev proc; do mount --rbind "/$part" "$0/$part" || exit 1; done; exec chroot "$0" "$@"'
    unshare = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", enter, str(root)]
    own = ("PIP_", "PYTHON", "CARGO", "RUST", "LD_")
    environ = {name: value for name, value in os.environ.items() if not name.startswith(own)}
    environ |= {
        "HOME": "/root",
        "LC_ALL": "C.UTF-8",
        "PATH": "/usr/bin:/bin:/usr/sbin:/sbin",
        "PIP_CERT": str(CERTIFICATES),
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
        "PIP_ROOT_USER_ACTION": "ignore",
        "TMPDIR": "/tmp",
    }
    whole = [*unshare, *command]
    done = subprocess.run(whole, env=environ, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if check and done.returncode:
        raise SystemExit(f"try_wheels: {root.name}: {' '.join(command)} ended {done.returncode}:\n{done.stdout}")
    return done


def lay(root: Path) -> None:
    """Lays what every system has, and no package holds."""
    for folder in ("dev", "etc/ssl/certs", "proc", "root", "tmp", "opt"):
        (root / folder).mkdir(parents=True, exist_ok=True)
    for file in (CERTIFICATES, Path("/etc/resolv.conf"), Path("/etc/hosts")):
        shutil.copyfile(file, root / file.relative_to("/"))
    # Links that a package lays when it is set up.
    for link, to in (("awk", "mawk"), ("sh", "dash")):
        if not (root / "usr" / "bin" / link).exists() and (root / "usr" / "bin" / to).exists():
            (root / "usr" / "bin" / link).symlink_to(to)


def build_python(root: Path, compiler: str) -> None:
    """Builds CPython in `root`, from the sources of Debian 12."""
    apt = Apt("bookworm")
    apt.source("zlib", root / "opt" / "zlib")
    apt.source("python3.11", root / "opt" / "cpython")
    jobs = os.environ.get("CARGO_BUILD_JOBS", "2")
    script = f"""
        set -eu
        export CC={compiler} CFLAGS=-fPIC
        cd /opt/zlib
        ./configure --static --prefix={BUILT}
        make -j{jobs} libz.a
        make install
        cd /opt/cpython
        # The compiler for musl says that it is the one for glibc, which configure does not believe.
        sed -i 's/MULTIARCH=.*print-multiarch.*/MULTIARCH=/' configure
        ./configure --prefix={BUILT} --disable-test-modules OPT=-O1 CPPFLAGS=-I{BUILT}/include LDFLAGS=-L{BUILT}/lib
        make -j{jobs}
        make install
    """
    inside(root, "/bin/sh", "-c", script)


def without_glibc(root: Path, bare: Path) -> None:
    """Makes a system that has a Python and the C library musl, and nothing else."""
    shutil.copytree(root / BUILT.lstrip("/"), bare / BUILT.lstrip("/"), symlinks=True)
    loader = Path("lib", "ld-musl-x86_64.so.1")
    (bare / "lib").mkdir()
    shutil.copyfile(root / loader, bare / loader)
    (bare / loader).chmod(0o755)
    lay(bare)


def prepare(system: System) -> Path:
    """The folder of a system, made where it is not there yet."""
    root = ROOTS / system.name
    if root.exists():
        return root
    made = ROOTS / f"{system.name}.new"
    shutil.rmtree(made, ignore_errors=True)
    made.mkdir(parents=True)
    Apt(system.suite).unpack(system.packages, made)
    lay(made)
    if system.compiler:
        build_python(made, system.compiler)
    if system.is_bare:
        bare = ROOTS / "bare"
        shutil.rmtree(bare, ignore_errors=True)
        without_glibc(made, bare)
        shutil.rmtree(made)
        made = bare
    return made.rename(root)


def installed(system: System, root: Path, wheel: Path) -> list[str]:
    """What pip is called with, so that it takes the wheel and what this needs."""
    place = root / "opt" / "wheels"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    shutil.copy(wheel, place)
    name = f"/opt/wheels/{wheel.name}"
    if not system.is_bare:
        return [name]
    # Its Python has no TLS: that would be one more library to build.
    asked = ["--platform", system.tag, "--python-version", "3.11", "--implementation", "cp", "--only-binary=:all:"]
    pip = [sys.executable, "-m", "pip", "download", "--quiet", "--dest", str(place), *asked, str(wheel)]
    subprocess.run(pip, check=True)
    return ["--no-index", "--find-links", "/opt/wheels", name]


def use(system: System, root: Path, wheel: Path) -> str:
    """Installs a wheel in `root` and uses it: with what it was done."""
    python = f"{BUILT}/bin/python3.11" if system.compiler else "/usr/bin/python3"
    asked = installed(system, root, wheel)
    if system.refusal:
        said = inside(root, "/usr/bin/python3", "-m", "pip", "install", *asked, check=False)
        if not said.returncode or system.refusal not in said.stdout:
            raise SystemExit(f"try_wheels: {system.name}: its own Python should have refused the wheel:\n{said.stdout}")
    inside(root, python, "-m", "venv", "--clear", "/opt/venv")
    own = "/opt/venv/bin"
    inside(root, f"{own}/python", "-m", "pip", "install", "--only-binary=:all:", *asked)
    version = inside(root, f"{own}/drivebus", "--version").stdout.strip()
    inside(root, f"{own}/drivebus", "demo")
    return f"{version} on {inside(root, f'{own}/python', '-c', FACTS).stdout.strip()}"


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    given = parser.parse_args()
    systems = [system for system in SYSTEMS if not given.names or any(name in system.name for name in given.names)]
    if not systems:
        parser.error(f"no system of that name; there are {', '.join(system.name for system in SYSTEMS)}")
    for system in systems:
        wheels = sorted(WHEELS.glob(f"drivebus-*{system.tag}.whl"))
        if len(wheels) != 1:
            raise SystemExit(f"try_wheels: {len(wheels)} wheels for {system.tag} in dist/wheels/: run `make wheels`")
        start = time.monotonic()
        root = prepare(system)
        said = use(system, root, wheels[0])
        print(f"try_wheels: {system.name}: {said}, {time.monotonic() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main()
