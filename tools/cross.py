"""The compiler for other systems, which tools/cross_parts.sh brings, and what it is to be told."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from tools.settle_wheel import ROOT, cargo_home

PARTS = ROOT / ".tools" / "cross"
SYSTEM = PARTS / "root" / "usr"
# The sources of the standard library, where the compiler names them.
LIBRARY = SYSTEM / "lib" / "rustlib" / "src" / "rust"
MINGW = "x86_64-w64-mingw32-gcc-win32"


def environment(folder: Path, *, from_source: bool) -> dict[str, str]:
    """The variables with which programs find this compiler, and build into `folder`.

    `from_source` builds the standard library too: Debian has it built for few systems. Cargo does so only where it is
    allowed what is not stable yet; of the crates here none asks for more than stable Rust has.
    """
    others = ("CARGO", "RUST", "PYO3", "MATURIN")
    own = {name: value for name, value in os.environ.items() if not name.startswith(others)}
    if "CARGO_HOME" in os.environ:
        own["CARGO_HOME"] = os.environ["CARGO_HOME"]
    own |= {
        "PATH": os.pathsep.join([str(SYSTEM / "bin"), str(ROOT / ".venv-wheels" / "bin"), os.environ["PATH"]]),
        "LD_LIBRARY_PATH": str(SYSTEM / "lib" / "x86_64-linux-gnu"),
        "CARGO_TARGET_DIR": str(folder),
        "CARGO_INCREMENTAL": "0",
        "CARGO_BUILD_JOBS": os.environ.get("CARGO_BUILD_JOBS", "2"),
        "CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER": MINGW,
    }
    if from_source:
        own |= {"RUSTC_BOOTSTRAP": "1", "CARGO_UNSTABLE_BUILD_STD": "std,panic_unwind"}
    return own


def without_paths() -> str:
    """The flags for `CARGO_ENCODED_RUSTFLAGS` that leave the folders of who builds out of what is built.

    The crates must have been downloaded.
    """
    names = {ROOT: "/drivebus", **dict.fromkeys(sorted((cargo_home() / "registry" / "src").iterdir()), "/crates")}
    names[LIBRARY] = "/rust"  # behind the folder that it is in: the last one counts
    return "\x1f".join(f"--remap-path-prefix={folder}={name}" for folder, name in names.items())


def fetch() -> None:
    """Brings the parts and the crates."""
    subprocess.run(["sh", "tools/cross_parts.sh"], cwd=ROOT, check=True)
    environ = environment(ROOT / "target", from_source=False)
    subprocess.run([str(SYSTEM / "bin" / "cargo"), "fetch", "--locked", "--quiet"], cwd=ROOT, env=environ, check=True)
