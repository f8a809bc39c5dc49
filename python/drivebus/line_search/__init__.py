"""A search for drives on a line of which nothing is known: neither speed nor format nor address. Only reads.

    for located in drivebus.search("/dev/ttyUSB0"):
        print(located)

The room is not called `search`, because the function is: a module of that name would take its place in the package.
"""

from drivebus.line_search.finder import Search, search
from drivebus.line_search.located import Located, Progress
from drivebus.line_search.settings import Settings

__all__ = ["Located", "Progress", "Search", "Settings", "search"]
