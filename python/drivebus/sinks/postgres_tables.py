"""The tables of a PostgreSQL database: a wide one for each family, events, the view over all, and which samples are in.

What is there is left as it is, so that a user without the right to make tables can deliver into those that an owner
made. Whatever is missing is made, and nothing is ever removed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import psycopg
from psycopg import sql

from drivebus.errors import NotAllowed
from drivebus.sinks.postgres_rows import FIXED, clean
from drivebus.spool import Layout

__all__ = ["Tables", "identifier"]

_LONGEST = 63
"""Bytes of an identifier: PostgreSQL cuts what is longer, and two could become one."""
_NO_TABLES = frozenset({"reached", "narrow", "event", "events", ""})
"""What no family's table is called."""
_NO_COLUMNS = frozenset({*FIXED, "", "tableoid", "xmin", "cmin", "xmax", "cmax", "ctid"})
"""What no value's column is called: those of each table, and PostgreSQL's own."""
_REACHED = """CREATE TABLE {} (gateway text, epoch text, first bigint, last bigint NOT NULL CHECK (last >= first),
    PRIMARY KEY (gateway, epoch, first))"""
_EVENT = """CREATE TABLE {} (gateway text NOT NULL, epoch text NOT NULL, seq bigint NOT NULL, time timestamptz NOT NULL,
    subject text NOT NULL, kind text NOT NULL, text text NOT NULL, PRIMARY KEY (gateway, epoch, seq))"""
_NARROW = """SELECT sample.time, sample.gateway, sample.drive, each.name, each.value FROM {} sample
    CROSS JOIN LATERAL (VALUES {}) each (name, value) WHERE each.value IS NOT NULL"""
_BY_TIME = "CREATE INDEX ON {} USING brin (time)"
"""Small, and enough: samples and events come in the order of their times."""
_EMPTY = sql.SQL(
    "SELECT NULL::timestamptz AS time, NULL::text AS gateway, NULL::text AS drive, NULL::text AS name,"
    " NULL::double precision AS value WHERE false"
)


def identifier(name: str, taken: frozenset[str]) -> str:
    """*name* as PostgreSQL can have it and nobody else has: itself, or cut and marked where it cannot be that."""
    plain = clean(name)
    if plain == name and name not in taken and len(name.encode()) <= _LONGEST:
        return name
    mark = f"~{hashlib.sha256(name.encode()).hexdigest()[:8]}"
    return plain.encode()[: _LONGEST - len(mark)].decode(errors="ignore") + mark


class Tables:
    """The tables in one schema, as they were found over one connection.

    Args:
        connection: Without a transaction that begins by itself.
        schema: Its name.
        begin: What begins a transaction.
    """

    def __init__(self, connection: psycopg.Connection[Any], schema: str, begin: sql.SQL) -> None:
        self._connection = connection
        self._schema = identifier(schema, frozenset({""}))
        self._begin = begin
        self._columns: dict[str, set[str]] = {}
        self._is_known: set[Layout] = set()

    @property
    def reached(self) -> sql.Identifier:
        """The table that says which samples are in."""
        return self._named("reached")

    @property
    def event(self) -> sql.Identifier:
        """The table of events."""
        return self._named("event")

    def of_family(self, family: str) -> sql.Identifier:
        """The table of a family; of drives without a profile, too."""
        return self._named(_table(family))

    def columns(self, names: Iterable[str]) -> sql.Composed:
        """The columns of samples whose values have *names*, as a list."""
        return sql.SQL(", ").join(sql.Identifier(each) for each in (*FIXED, *map(_column, names)))

    def prepare(self) -> None:
        """Makes what there is for any family."""
        if not ({"reached", "event", "narrow"} <= self._relations()):
            self._make(())

    def take_in(self, layouts: Iterable[Layout]) -> None:
        """Makes what samples of *layouts* need."""
        new = [layout for layout in layouts if layout not in self._is_known]
        if any(self._lacking(layout) for layout in new):
            self._make(new)
        self._is_known.update(new)

    def _lacking(self, layout: Layout) -> list[str]:
        """The columns that the table of *layout* lacks; all of them where there is none."""
        table = _table(layout.family)
        if not self._columns.get(table):
            self._columns[table] = self._columns_of(table)
        found = self._columns[table]
        if found and not FIXED.keys() <= found:
            raise NotAllowed(f'the table "{table}" in the schema "{self._schema}" is something else: rename it')
        wanted = dict.fromkeys([*FIXED, *map(_column, layout.names)])
        return [name for name in wanted if name not in found]

    def _make(self, layouts: Iterable[Layout]) -> None:
        connection = self._connection
        connection.execute(self._begin)
        # One gateway at a time: two that make the same table would be in each other's way.
        connection.execute("SELECT pg_advisory_xact_lock(hashtext(%s))", (f"drivebus {self._schema}",))
        if not connection.execute("SELECT 1 FROM pg_namespace WHERE nspname = %s", (self._schema,)).fetchone():
            connection.execute(sql.SQL("CREATE SCHEMA {}").format(sql.Identifier(self._schema)))
        if "reached" not in self._relations():
            connection.execute(sql.SQL(_REACHED).format(self.reached))
        if "event" not in self._relations():
            connection.execute(sql.SQL(_EVENT).format(self.event))
            connection.execute(sql.SQL(_BY_TIME).format(self.event))
        self._columns.clear()
        for layout in layouts:
            self._make_columns(layout)
        self._make_narrow()
        connection.execute("COMMIT")
        self._columns.clear()

    def _make_columns(self, layout: Layout) -> None:
        lacking, table = self._lacking(layout), self.of_family(layout.family)
        if not lacking:
            return
        if not self._columns[_table(layout.family)]:
            fixed = sql.SQL(", ".join(f"{name} {kind}" for name, kind in FIXED.items()))
            self._connection.execute(
                sql.SQL("CREATE TABLE {} ({}, PRIMARY KEY (gateway, epoch, seq))").format(table, fixed)
            )
            self._connection.execute(sql.SQL(_BY_TIME).format(table))
        added = [name for name in lacking if name not in FIXED]
        if added:
            parts = (sql.SQL("ADD COLUMN IF NOT EXISTS {} double precision").format(sql.Identifier(n)) for n in added)
            self._connection.execute(sql.SQL("ALTER TABLE {} {}").format(table, sql.SQL(", ").join(parts)))
        for name, unit in zip(layout.names, layout.units, strict=True):
            column = _column(name)
            comment = unit if column == name else " in ".join(filter(None, (name, unit)))
            if column in added and comment:
                self._connection.execute(
                    sql.SQL("COMMENT ON COLUMN {}.{} IS {}").format(
                        table, sql.Identifier(column), sql.Literal(clean(comment))
                    )
                )
        self._columns.pop(_table(layout.family))

    def _make_narrow(self) -> None:
        """The view over all tables of samples that the schema has, also those that others made."""
        parts: list[sql.Composable] = []
        for table in sorted(self._relations()):
            columns = self._columns_of(table, "double precision")
            if not FIXED.keys() <= self._columns_of(table) or not columns - FIXED.keys():
                continue
            values = (
                sql.SQL("({}::text, sample.{})").format(sql.Literal(name), sql.Identifier(name))
                for name in sorted(columns - FIXED.keys())
            )
            parts.append(sql.SQL(_NARROW).format(self._named(table), sql.SQL(", ").join(values)))
        self._connection.execute(
            sql.SQL("CREATE OR REPLACE VIEW {} AS {}").format(
                self._named("narrow"), sql.SQL(" UNION ALL ").join(parts or [_EMPTY])
            )
        )

    def _relations(self) -> set[str]:
        """All tables and views of the schema."""
        found = self._connection.execute(
            "SELECT relname FROM pg_class JOIN pg_namespace ON pg_namespace.oid = relnamespace"
            " WHERE nspname = %s AND relkind IN ('r', 'p', 'v', 'm', 'f') AND NOT relispartition",
            (self._schema,),
        )
        return {name for (name,) in found.fetchall()}

    def _columns_of(self, table: str, kind: str | None = None) -> set[str]:
        """The columns of a table, or those of one type; none where it is not there."""
        found = self._connection.execute(
            "SELECT attname FROM pg_attribute JOIN pg_class ON pg_class.oid = attrelid"
            " JOIN pg_namespace ON pg_namespace.oid = relnamespace WHERE nspname = %s AND relname = %s"
            " AND attnum > 0 AND NOT attisdropped AND (%s::text IS NULL OR format_type(atttypid, NULL) = %s)",
            (self._schema, table, kind, kind),
        )
        return {name for (name,) in found.fetchall()}

    def _named(self, table: str) -> sql.Identifier:
        return sql.Identifier(self._schema, table)


def _table(family: str) -> str:
    return identifier(family, _NO_TABLES) if family else "unknown"


def _column(name: str) -> str:
    return identifier(name, _NO_COLUMNS)
