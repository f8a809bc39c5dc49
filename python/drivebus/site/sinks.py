"""Where a site sends what its drives say, as `drivebus serve` does it.

    [prometheus]
    address = "127.0.0.1:9464"

Here it is read.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivebus.site.reading import Reading, address

__all__ = ["SitePrometheus", "prometheus_of"]


@dataclass(frozen=True)
class SitePrometheus:
    """Where Prometheus finds how the plant is.

    Attributes:
        address: `host:port`.
        at: In which line of the file its table begins.
    """

    address: str
    at: int = 1


def prometheus_of(file: Reading) -> SitePrometheus | None:
    """What *file* says of Prometheus; what is wrong in it is complained of."""
    table = file.data.get("prometheus")
    if table is None:
        return None
    where = ("prometheus",)
    if not isinstance(table, dict):
        file.complain(where, "prometheus is a table: [prometheus]")
        return None
    file.check_keys(table, ("address",), where)
    given = file.value(where, table, "address", address, needed=True)
    return None if given is None else SitePrometheus(given, file.line_of(where))
