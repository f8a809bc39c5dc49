"""The adapter: what the system tells of it, what it can be told, and what its driver made of the settings."""

from __future__ import annotations

import os
from collections.abc import Iterator

from drivebus.bus import Bus
from drivebus.doctor.findings import Finding, Severity
from drivebus.doctor.search import describe
from drivebus.errors import PortError
from drivebus.line import ports

__all__ = ["adapter_findings", "port_finding"]


def port_finding(error: PortError) -> Finding:
    """The port does not open; *error* names who has it, or what to do."""
    return Finding("adapter", "port", Severity.FAULT, str(error), error=PortError)


def adapter_findings(bus: Bus, port: object) -> Iterator[Finding]:
    """About the adapter of *port*, which is open as *bus*."""
    facts = _facts(port)
    what = [text for text in (facts and facts.adapter, facts and facts.driver and f"driver {facts.driver}") if text]
    described = f" ({', '.join(what)})" if what else ""
    yield Finding(
        "adapter",
        "port",
        Severity.OK,
        f"{bus.port}{described} opened at {describe(bus)}",
        values={} if facts is None else {"driver": facts.driver, "adapter": facts.adapter},
    )
    rule = None if facts is None else facts.latency_rule
    if facts is not None and facts.latency_timer_ms is not None:
        timer = facts.latency_timer_ms
        values = {"latency_timer": timer / 1000}
        if rule is None:
            yield Finding("adapter", "latency_timer", Severity.OK, f"its latency timer is {timer} ms", values=values)
        else:
            yield Finding(
                "adapter",
                "latency_timer",
                Severity.WARNING,
                f"the adapter keeps what it receives for up to {timer} ms, so every answer comes up to that much later",
                f"allow 1 ms for good: write {rule} into /etc/udev/rules.d/99-low-latency.rules and plug it in again",
                values=values,
                error=PortError,
            )
    for note in bus.stats()["notes"]:
        if rule is None or rule not in note:
            yield Finding("adapter", "setting", Severity.NOTE, note)


def _facts(port: object) -> ports.PortFacts | None:
    """What the system tells of *port*, if it is one that the system knows: a path."""
    if isinstance(port, os.PathLike):
        port = os.fspath(port)
    return ports.facts(port) if isinstance(port, str) and "://" not in port else None
