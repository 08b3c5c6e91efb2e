"""The views of a results database as pandas tables. What they mean: results/README.md."""

import contextlib
import pathlib
import sqlite3

DEFAULT_DATABASE = "results/dreamsearch.db"  # as of `runner` and `results`


def _connect(db):
    path = pathlib.Path(db)
    if not path.is_file():
        raise FileNotFoundError(f"no results database {path.absolute()}")
    # Not by its name alone: that would make a file, and could write to this one.
    return contextlib.closing(sqlite3.connect(path.absolute().as_uri() + "?mode=ro", uri=True))


def views(db=DEFAULT_DATABASE):
    """The names of the views, which are a public contract; tables are not."""
    with _connect(db) as connection:
        rows = connection.execute("SELECT name FROM sqlite_schema WHERE type = 'view'")
        return sorted(name for (name,) in rows)


def read(view, db=DEFAULT_DATABASE):
    """A view as a table, such as read("v_final")."""
    known = views(db)
    if view not in known:
        raise KeyError(f"no view {view!r} in {db}. Known: {', '.join(known)}")
    return query(f'SELECT * FROM "{view}"', db)


def query(sql, db=DEFAULT_DATABASE, parameters=()):
    """What a query selects, as a table; it cannot change the file."""
    import pandas

    with _connect(db) as connection:
        return pandas.read_sql_query(sql, connection, params=parameters)
