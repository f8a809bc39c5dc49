"""The adapter: what the system tells of it, what it can be told, and what its driver made of the settings."""

from __future__ import annotations

import os
from collections.abc import Iterator

from drivebus.bus import Bus
from drivebus.doctor.findings import Finding, Severity
from drivebus.errors import PortError
from drivebus.line import port_facts
from drivebus.line_search.settings import Settings

__all__ = ["adapter_findings", "port_finding"]


def port_finding(error: PortError) -> Finding:
    """The finding that the port does not open; *error* names who has it, or what to do."""
    return Finding("adapter", "port", Severity.FAULT, str(error), error=PortError)


def adapter_findings(bus: Bus, port: object) -> Iterator[Finding]:
    """What is found about the adapter of *port*, which is open as *bus*."""
    facts = _facts(port)
    yield _opened(bus, facts)
    if facts is not None and facts.latency_timer_ms is not None:
        yield _latency_timer(facts.latency_timer_ms, facts.latency_rule)
    rule = None if facts is None else facts.latency_rule
    for note in bus.stats()["notes"]:
        # What the timer costs was said already.
        if rule is None or rule not in note:
            yield Finding("adapter", "setting", Severity.NOTE, note)


def _opened(bus: Bus, facts: port_facts.PortFacts | None) -> Finding:
    what = [text for text in (facts and facts.adapter, facts and facts.driver and f"driver {facts.driver}") if text]
    described = f" ({', '.join(what)})" if what else ""
    return Finding(
        "adapter",
        "port",
        Severity.OK,
        f"{bus.port}{described} opened at {Settings.of(bus)}",
        values={} if facts is None else {"driver": facts.driver, "adapter": facts.adapter},
    )


def _latency_timer(timer: int, rule: str | None) -> Finding:
    """What a latency *timer* of so many milliseconds costs, and the *rule* that shortens it, if it can be shorter."""
    values = {"latency_timer": timer / 1000}
    if rule is None:
        return Finding("adapter", "latency_timer", Severity.OK, f"its latency timer is {timer} ms", values=values)
    return Finding(
        "adapter",
        "latency_timer",
        Severity.WARNING,
        f"the adapter holds received characters back for up to {timer} ms, so each answer comes up to that much later",
        f"allow 1 ms for good: write {rule} into /etc/udev/rules.d/99-low-latency.rules and plug it in again",
        values=values,
        error=PortError,
    )


def _facts(port: object) -> port_facts.PortFacts | None:
    """What the system tells of *port*, if it is one that the system knows: a path."""
    if isinstance(port, os.PathLike):
        port = os.fspath(port)
    return port_facts.facts(port) if isinstance(port, str) and "://" not in port else None
