"""A SCADA of somebody else's making, mqtt-spb-wrapper's: prints each message as it takes it, a line of JSON each.

usage: python sparkplug_scada.py PORT GROUP

It ends with its input, of which each line is a node that shall be born anew.
"""

import json
import sys
from typing import Any

from mqtt_spb_wrapper import MqttSpbEntityScada  # type: ignore[import-not-found]

port, group = int(sys.argv[1]), sys.argv[2]


def tell(topic: Any, payload: dict[str, Any]) -> None:
    """Prints the message, and who lives now by what the SCADA has worked out of all."""
    nodes = scada.entities_eon
    lives = {name: node.is_alive() for name, node in nodes.items()}
    devices = {
        f"{name}/{each}": it.is_alive() for name, node in nodes.items() for each, it in node.entities_eond.items()
    }
    told = {"kind": topic.message_type, "device": topic.eon_device_name, "payload": payload, "lives": lives | devices}
    print(json.dumps(told), flush=True)


scada = MqttSpbEntityScada(group, "scada", callback_birth=tell, callback_data=tell, callback_death=tell)
assert scada.connect("127.0.0.1", port)
print("connected", flush=True)
for line in sys.stdin:
    scada.send_command("Node Control/Rebirth", True, line.strip())
