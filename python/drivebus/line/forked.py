"""A forked child gives up what its parent has open: the lock of a port, its door, and the connections behind it.

It is told so by Python, whoever forks: `os.fork`, `multiprocessing`, a daemon. Otherwise the lock of a program that
was killed would live on in its child, and so would the connections at whose other ends others wait for it. A program
that the child runs inherits none of them anyhow.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress

from drivebus import _native

__all__: list[str] = []


def _give_up() -> None:
    """Puts nothing in the place of each. Closing is all that is done to the parent's."""
    nothing, descriptors = _native.inherited()
    for descriptor in descriptors:
        # Whoever closed them all before is done already.
        with suppress(OSError):
            os.dup2(nothing, descriptor, inheritable=False)


if sys.platform != "win32":
    os.register_at_fork(after_in_child=_give_up)
