"""Where samples go: databases and programs of others, each at a pace of its own. None of them can hold a line up.

`delivery` is the loop of every sink that takes what waits in a spool, `lanes` says what is next, `intervals` what is in
already. `picture` is how a plant is now, for those who come and ask. Each sink has files of its own beside them.
"""

from typing import TYPE_CHECKING

from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.sinks.mqtt import Answer, Commander, Mqtt
    from drivebus.sinks.mqtt_commands import Command
    from drivebus.sinks.mqtt_drives import MqttDrive, MqttValue
    from drivebus.sinks.mqtt_settings import MqttSettings
    from drivebus.sinks.picture import DrivePicture, GatewayPicture, LinePicture, Picture
    from drivebus.sinks.postgres import Postgres, PostgresSettings
    from drivebus.sinks.prometheus import Prometheus
    from drivebus.sinks.sparkplug import Sparkplug
    from drivebus.sinks.sparkplug_settings import SparkplugSettings

__all__ = [
    "Answer",
    "Command",
    "Commander",
    "DrivePicture",
    "GatewayPicture",
    "LinePicture",
    "Mqtt",
    "MqttDrive",
    "MqttSettings",
    "MqttValue",
    "Picture",
    "Postgres",
    "PostgresSettings",
    "Prometheus",
    "Sparkplug",
    "SparkplugSettings",
]

if not TYPE_CHECKING:
    __getattr__ = later(
        __name__,
        {
            "mqtt": ("Answer", "Commander", "Mqtt"),
            "mqtt_commands": ("Command",),
            "mqtt_drives": ("MqttDrive", "MqttValue"),
            "mqtt_settings": ("MqttSettings",),
            "sparkplug": ("Sparkplug",),
            "sparkplug_settings": ("SparkplugSettings",),
            "picture": ("DrivePicture", "GatewayPicture", "LinePicture", "Picture"),
            "postgres": ("Postgres", "PostgresSettings"),
            "prometheus": ("Prometheus",),
        },
    )
