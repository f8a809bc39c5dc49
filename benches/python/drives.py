"""10 000 simulated drives in virtual time on one core: runs benches/rust/drives.rs, which says what is simulated.

usage: python -m benches.python.drives [--seconds 2] [--json]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess

from benches.python.figures import markdown, show
from benches.python.programs import ROOT

HEAD = ["drives", "lines", "looks at each shaft a second", "times real time", "requests", "processor time of each"]


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--seconds", type=float, default=2.0, help="for each layout")
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    given = options.parse_args()
    cargo = os.environ.get("CARGO", "cargo")
    command = [cargo, "run", "--locked", "--quiet", "--release", "-p", "drivebus-benches", "--example", "drives"]
    done = subprocess.run([*command, "--", str(given.seconds)], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    layouts = json.loads(done.stdout)
    rows = [
        [
            str(each["drives"]),
            str(each["lines"]),
            "100" if each["looks"] else "none",
            f"{each['times_real_time']:.1f}",
            str(each["requests"]),
            f"{each['nanoseconds_each'] / 1e3:.2f} µs",
        ]
        for each in layouts
    ]
    show(given.json, layouts, markdown(HEAD, rows))


if __name__ == "__main__":
    main()
