"""The same hostile line for drivebus and for other Modbus libraries, and a neutral slave that judges them.

`wire` and `slave` are the judge: plain Python, nothing of drivebus in them. `libraries` holds one adapter for each
library, `worker` runs one of them in a process of its own, `child` is that process seen from here. `rows` says what
the slave does and what is asked, `faults` puts the simulator's fault layer on the line, `run` runs all of it and
`report` writes it down. `gateways` puts gateways before the same lines.

    python -m tests.conformance.run --out docs/developers/conformance.md
"""
