"""What is wrong in what a site says, beyond its form: registers and commands, by the families of the drives.

Nothing is opened, and nothing is sent.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from importlib.util import find_spec
from typing import Any

from drivebus import checks
from drivebus.errors import BadArgument, NotAllowed
from drivebus.operations import network_rights
from drivebus.operations.last_will import WAYS
from drivebus.profile import Profile
from drivebus.profile.evidence import Evidence
from drivebus.service.page_mistakes import of_page
from drivebus.sinks import Mqtt, MqttSettings, Postgres, PostgresSettings, Sparkplug, SparkplugSettings
from drivebus.site import (
    Site,
    SiteAllow,
    SiteBroker,
    SiteDrive,
    SiteGateway,
    SiteMqtt,
    SitePoll,
    SitePostgres,
    SiteSparkplug,
)

__all__ = ["check", "evidence_of", "hours_of", "mqtt_settings_of", "settings_of", "sparkplug_settings_of"]

_BYTES, _BYTES_A_VALUE = 34, 4
"""Of a sample in the spool, as it was measured."""
_TELLING = 2
"""Values beside those that are named: state and fault."""
_SIGNS = 4
"""Signs of life that a broker is asked for in the time of the dead man."""


def check(site: Site) -> None:
    """Looks through what *site* says of clients, of polls and of where they go.

    Raises:
        NotAllowed: Something cannot be; each mistake is named with its line.
    """
    wrong = {mistake for gateway in site.share.gateways for mistake in _of_gateway(gateway)}
    wrong |= {mistake for poll in site.polls for mistake in _of_poll(poll)}
    if site.prometheus is not None and find_spec("prometheus_client") is None:
        wrong.add((site.prometheus.at, "this needs prometheus-client: pip install 'drivebus[prometheus]'"))
    wrong |= set(_of_postgres(site))
    wrong |= set(_of_mqtt(site.mqtt)) if site.mqtt is not None else set()
    wrong |= set(_of_sparkplug(site.sparkplug)) if site.sparkplug is not None else set()
    wrong |= set(of_page(site))
    if wrong:
        count = "one mistake" if len(wrong) == 1 else f"{len(wrong)} mistakes"
        told = [f"{site.path}:{line}: {reason}" for line, reason in sorted(wrong)]
        raise BadArgument("\n".join([f"{site.path} has {count}; nothing was opened:", *told]))


def _of_postgres(site: Site) -> Iterator[tuple[int, str]]:
    if site.postgres is None:
        return
    try:
        Postgres.check(settings_of(site.postgres))
    except NotAllowed as error:
        yield site.postgres.at, str(error)


def settings_of(told: SitePostgres) -> PostgresSettings:
    """Where samples go, as the sink takes it."""
    return PostgresSettings(told.conninfo, told.gateway, told.schema, told.password_file)


def mqtt_settings_of(told: SiteMqtt) -> MqttSettings:
    """Where the broker is, as the sink takes it."""
    beat = told.dead_man / _SIGNS if isinstance(told.dead_man, float) else math.inf
    return _at(told.broker, told.gateway, prefix=told.topic, home_assistant=told.home_assistant, beat=beat)


def sparkplug_settings_of(told: SiteSparkplug) -> SparkplugSettings:
    """Which node this is, and where, as the sink takes it."""
    return SparkplugSettings(_at(told.broker, told.node), told.group, told.node, told.primary_host)


def _at(broker: SiteBroker, name: str, **more: Any) -> MqttSettings:
    """Where the *broker* is, for whom it knows by that *name*."""
    return MqttSettings(
        broker.host,
        broker.port,
        name,
        tls=broker.tls,
        username=broker.username,
        password_file=broker.password_file,
        ca_file=broker.ca_file,
        **more,
    )


def hours_of(site: Site) -> float | None:
    """How many hours of samples the spool holds, if each is kept; None where nothing is polled."""
    if not site.polls or site.spool is None:
        return None
    each_second = 0.0
    for poll in site.polls:
        for drive in poll.drives:
            values = (len(poll.registers) or len(_profile_of(drive).monitor_names())) + _TELLING
            each_second += (_BYTES + _BYTES_A_VALUE * values) / poll.interval
    return site.spool.size / each_second / 3600 if each_second else None


def _of_gateway(gateway: SiteGateway) -> Iterator[tuple[int, str]]:
    moved: list[str] = []
    for allow in gateway.allow:
        yield from _of_rule(allow, moved)
    if moved and gateway.dead_man is None:
        yield gateway.at, _without_dead_man(moved)


def _without_dead_man(moved: list[str]) -> str:
    return (
        f"clients may move {moved[0]}, and nothing says what becomes of it when they are gone: say dead_man, "
        'seconds after which it is halted, or "off" if it shall run on'
    )


def _of_sparkplug(told: SiteSparkplug) -> Iterator[tuple[int, str]]:
    try:
        Sparkplug.check(sparkplug_settings_of(told))
    except NotAllowed as error:
        yield told.at, str(error)


def _of_mqtt(told: SiteMqtt) -> Iterator[tuple[int, str]]:
    try:
        Mqtt.check(mqtt_settings_of(told))
    except NotAllowed as error:
        yield told.at, str(error)
    moved: list[str] = []
    for allow in told.allow:
        for drive in allow.drives:
            yield from _of_drive(drive, [("commands", name) for name in allow.commands], allow.lines, moved)
    if moved and told.dead_man is None:
        yield told.at, _without_dead_man(moved)


def _of_rule(allow: SiteAllow, moved: list[str]) -> Iterator[tuple[int, str]]:
    """What is wrong in one rule; drives that it lets clients move are *moved*."""
    at = allow.lines[""]
    if (allow.write or allow.commands) and not (allow.drives or allow.units):
        yield at, "what may be written is said of drives that are named: say drives"
    if allow.functions and set(allow.functions) & set(network_rights.WRITES) and not (allow.write or allow.commands):
        yield allow.lines["functions"], "functions that write need what may be written, and nothing is named"
    if allow.commands and allow.units:
        yield allow.lines["units"], "a unit that is no drive knows no commands: name a drive"
    for unit in allow.units:
        try:
            network_rights.of_unit(unit, allow.write)
        except NotAllowed as error:
            yield allow.lines["write"], str(error)
    for drive in allow.drives:
        if allow.write or allow.commands:
            named = [*(("write", name) for name in allow.write), *(("commands", name) for name in allow.commands)]
            yield from _of_drive(drive, named, allow.lines, moved)


def _of_poll(poll: SitePoll) -> Iterator[tuple[int, str]]:
    at = poll.lines.get("drives", poll.lines[""])
    for drive in poll.drives:
        evidence = _known(drive, "a poll")
        if isinstance(evidence, str):
            yield at, evidence
            continue
        try:
            evidence.require_readable(poll.registers)
        except NotAllowed as error:
            yield poll.lines["registers"], f'"{drive.name}": {error}'
        else:
            asked = poll.registers or evidence.profile.monitor_names()
            for name in poll.band:
                if name not in asked:
                    hint = checks.closest(name, asked)
                    yield poll.lines["band"], f'"{drive.name}" is not asked for {name}, which has a band{hint}'


def evidence_of(drive: SiteDrive) -> Evidence:
    """What is known of the family of *drive*, as the file trusts it.

    Raises:
        NotAllowed: There is no such family, or no such variant of it.
    """
    return Evidence(_profile_of(drive), drive.unit, drive.unverified)


def _profile_of(drive: SiteDrive) -> Profile:
    profile = Profile.find(drive.profile or "")
    return profile.with_variants(drive.variants) if drive.variants else profile


def _known(drive: SiteDrive, who: str) -> Evidence | str:
    """What is known of the family of *drive*, which *who* needs, or what is wrong with it."""
    if drive.profile is None:
        return f'"{drive.name}" has no profile, and {who} needs one: say it in [drives.{drive.name}]'
    try:
        return evidence_of(drive)
    except NotAllowed as error:
        return f'"{drive.name}": {error}'


def _of_drive(
    drive: SiteDrive, named: Iterable[tuple[str, str | int]], lines: Mapping[str, int], moved: list[str]
) -> Iterator[tuple[int, str]]:
    """What is wrong in letting somebody write to *drive* what is *named* under keys that stand in *lines*."""
    at = lines["drives"]
    evidence = _known(drive, "who writes to it")
    if isinstance(evidence, str):
        yield at, evidence
        return
    if drive.read_only:
        yield at, f'"{drive.name}" is read_only'
        return
    moves = False
    for key, name in named:
        try:
            writes = network_rights.of_drive(evidence, *(([name], []) if key == "write" else ([], [name])))
        except NotAllowed as error:
            yield lines[key], str(error)
        else:
            moves = moves or network_rights.moves(writes)
    if moves:
        moved.append(f'"{drive.name}"')
        if all(evidence.unusable(way) is not None for way in WAYS):
            yield at, f'nothing is known that halts "{drive.name}", so clients may not move it'
