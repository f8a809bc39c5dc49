"""The page: a plant in a browser. It is given what it shows and what it may order, and opens nothing but its address.

`serving` listens, `guard` looks at each request before anything else does, `app` has the routes. What decides something
is a value that is given time: `sessions`, `attempts`, `presence`, `tickets`.
"""

from typing import TYPE_CHECKING

from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.web.passwords import LEAST, hashed, is_hash
    from drivebus.web.presence import Presence
    from drivebus.web.serving import Web
    from drivebus.web.shown import Happened, Person, Shown, ShownDrive, Told
    from drivebus.web.tls import web_context

__all__ = [
    "LEAST",
    "Happened",
    "Person",
    "Presence",
    "Shown",
    "ShownDrive",
    "Told",
    "Web",
    "hashed",
    "is_hash",
    "web_context",
]

if not TYPE_CHECKING:
    __getattr__ = later(
        __name__,
        {
            "passwords": ("LEAST", "hashed", "is_hash"),
            "presence": ("Presence",),
            "serving": ("Web",),
            "shown": ("Happened", "Person", "Shown", "ShownDrive", "Told"),
            "tls": ("web_context",),
        },
    )
