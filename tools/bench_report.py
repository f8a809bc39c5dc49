"""Runs the benchmarks of both languages, side by side with their peers, and writes benches/RESULTS.md."""

from __future__ import annotations

import datetime
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections import defaultdict
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benches/RESULTS.md"
CRITERION = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "criterion"
PEERS = ["pymodbus", "minimalmodbus", "fastcrc", "pyserial"]


def nanoseconds(value: float) -> str:
    """A time for people."""
    for factor, unit in ((1e9, "s"), (1e6, "ms"), (1e3, "µs")):
        if value >= factor:
            return f"{value / factor:.3g} {unit}"
    return f"{value:.3g} ns"


def by_number(name: str) -> list[tuple[int, str]]:
    """Sorts `crc/8` before `crc/11`."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in name.split("/")]


def run(*command: str) -> None:
    """Runs *command* in the repository, and fails with it."""
    print("$", " ".join(command), flush=True)
    subprocess.run(command, cwd=ROOT, check=True)


def machine() -> str:
    """What it ran on."""
    name = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        models = [
            line.partition(":")[2].strip() for line in information.read_text().splitlines() if "model name" in line
        ]
        name = models[0] if models else name
    rustc = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True).stdout.strip()
    peers = ", ".join(f"{peer} {metadata.version(peer)}" for peer in PEERS)
    return (
        f"{name}, {os.cpu_count()} cores, {platform.system()} {platform.release()}; "
        f"CPython {platform.python_version()}; {rustc}; {peers}"
    )


def rust() -> str:
    """Criterion's medians."""
    run("cargo", "bench", "--locked", "--quiet", "-p", "drivebus-benches")
    medians = {}
    for path in CRITERION.glob("**/new/benchmark.json"):
        name = json.loads(path.read_text())["full_id"]
        medians[name] = json.loads((path.parent / "estimates.json").read_text())["median"]["point_estimate"]
    rows = [f"| {name} | {nanoseconds(medians[name])} |" for name in sorted(medians, key=by_number)]
    return "\n".join(["| benchmark | median |", "| --- | ---: |", *rows])


def python(folder: Path) -> str:
    """pytest-benchmark's medians, each beside the others of its group."""
    file = folder / "python.json"
    run(
        *(sys.executable, "-m", "pytest", "benches/python", "-o", "python_files=bench_*.py", "-p", "no:cacheprovider"),
        *("--quiet", "--benchmark-disable-gc", "--benchmark-warmup=on", f"--benchmark-json={file}"),
    )
    groups: dict[str, dict[str, float]] = defaultdict(dict)
    for each in json.loads(file.read_text())["benchmarks"]:
        groups[each["group"]][each["params"]["engine"]] = each["stats"]["median"] * 1e9
    rows = ["| what | engine | median | drivebus is faster by |", "| --- | --- | ---: | ---: |"]
    for group, engines in groups.items():
        for engine, median in sorted(engines.items(), key=lambda item: item[1]):
            ratio = "" if engine == "drivebus" else f"{median / engines['drivebus']:.2f} x"
            rows.append(f"| {group} | {engine} | {nanoseconds(median)} | {ratio} |")
    return "\n".join(rows)


def cycle() -> str:
    """The share of the shortest possible cycle."""
    done = subprocess.run(
        [sys.executable, "-m", "benches.python.cycle"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return done.stdout.strip()


def main() -> None:
    """Measures, then writes."""
    with tempfile.TemporaryDirectory() as folder:
        parts = {
            "Rust (criterion)": rust(),
            "Python, beside other packages (pytest-benchmark)": python(Path(folder)),
            "Share of the shortest possible cycle, one unit, paced pseudo-terminal": cycle(),
        }
    text = f"# Results of `make bench`\n\n{datetime.date.today().isoformat()}. {machine()}\n"
    for title, table in parts.items():
        text += f"\n## {title}\n\n{table}\n"
    RESULTS.write_text(text, encoding="utf-8")
    print(f"wrote {RESULTS.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
