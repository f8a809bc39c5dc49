"""What one owns: lines and drives by name in `drivebus.toml`, and the families that units once surely were."""

from typing import TYPE_CHECKING

from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.site.broker import SiteBroker
    from drivebus.site.config import FILE, Site
    from drivebus.site.entries import SiteDrive, SiteLine
    from drivebus.site.known_families import families_on, forget, known_family, remember
    from drivebus.site.mqtt import SiteMqtt, SiteMqttAllow
    from drivebus.site.polls import SitePoll, SiteSpool
    from drivebus.site.share import SiteAllow, SiteGateway, SiteShare
    from drivebus.site.sinks import SitePostgres, SitePrometheus
    from drivebus.site.sparkplug import SiteSparkplug
    from drivebus.site.state_folder import state_file
    from drivebus.site.web import SitePerson, SiteWeb

__all__ = [
    "FILE",
    "Site",
    "SiteAllow",
    "SiteBroker",
    "SiteDrive",
    "SiteGateway",
    "SiteLine",
    "SiteMqtt",
    "SiteMqttAllow",
    "SitePerson",
    "SitePoll",
    "SitePostgres",
    "SitePrometheus",
    "SiteShare",
    "SiteSparkplug",
    "SiteSpool",
    "SiteWeb",
    "families_on",
    "forget",
    "known_family",
    "remember",
    "state_file",
]

if not TYPE_CHECKING:
    __getattr__ = later(
        __name__,
        {
            "config": ("FILE", "Site"),
            "entries": ("SiteDrive", "SiteLine"),
            "known_families": ("families_on", "forget", "known_family", "remember"),
            "broker": ("SiteBroker",),
            "mqtt": ("SiteMqtt", "SiteMqttAllow"),
            "sparkplug": ("SiteSparkplug",),
            "polls": ("SitePoll", "SiteSpool"),
            "share": ("SiteAllow", "SiteShare", "SiteGateway"),
            "sinks": ("SitePostgres", "SitePrometheus"),
            "state_folder": ("state_file",),
            "web": ("SitePerson", "SiteWeb"),
        },
    )
