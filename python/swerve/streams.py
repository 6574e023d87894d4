"""The messages of one stream of a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _swerve, messages

if TYPE_CHECKING:
    import pandas as pd


def arrays(columns: Mapping[str, tuple[str, Any]]) -> dict[str, NDArray[Any]]:
    """Columns as the extension gives them, as arrays."""
    return {
        name: np.array(values, dtype=object) if kind == "O" else np.frombuffer(values, kind)
        for name, (kind, values) in columns.items()
    }


class Table(dict[str, NDArray[Any]]):
    """Columns of equal length, by name."""

    def to_pandas(self) -> pd.DataFrame:
        """The columns as a table."""
        import pandas as pd

        return pd.DataFrame(dict(self))


def message_class(type_name: str) -> type[messages.Message]:
    """The dataclass of a Rust type, by the last part of its name."""
    found = getattr(messages, type_name.rsplit("::", 1)[-1], None)
    if not (isinstance(found, type) and issubclass(found, messages.Message)):
        raise TypeError(f"messages of the type {type_name} are not known in Python")
    return found


class Stream:
    """The messages of one stream, in the order of their publication.

    Columns are made once, when the first is asked for: `stream["pose.x_m"]`. Messages are made one by one as dataclasses:
    `stream[0]`, `stream[2:5]`, `for message in stream`. It can be pickled.
    """

    def __init__(self, data: _swerve.StreamData) -> None:
        self._data = data
        self._columns: dict[str, NDArray[Any]] | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {"_data": self._data, "_columns": None}

    @property
    def name(self) -> str:
        """Its name."""
        return self._data.name

    @property
    def operator(self) -> str:
        """The operator that publishes it."""
        return self._data.operator

    @property
    def message_type(self) -> type[messages.Message]:
        """The dataclass of its messages."""
        return message_class(self._data.type_name)

    @property
    def stamps(self) -> NDArray[np.int64]:
        """The instants that the messages describe, nanoseconds."""
        return np.frombuffer(self._data.stamps(), np.int64)

    @property
    def visible_at(self) -> NDArray[np.int64]:
        """The instants at which they were published, nanoseconds."""
        return np.frombuffer(self._data.visible_at(), np.int64)

    @property
    def origins(self) -> NDArray[np.int64]:
        """The stamps of the sensor frames that they derive from, nanoseconds; the least integer where there is none."""
        return np.frombuffer(self._data.origins(), np.int64)

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """All numbers, truth values and texts by dotted name; of a list its length, `name.count`."""
        if self._columns is None:
            self._columns = arrays(self._data.columns())
        return self._columns

    def plain(self, index: int) -> dict[str, Any]:
        """A message as a dictionary by field name."""
        plain: dict[str, Any] = self._data.plain(range(len(self))[index])
        return plain

    @property
    def lists(self) -> list[str]:
        """Dotted names of the lists in its messages: `tracks` of a list of tracks."""
        return [name.removesuffix(".count") for name in self.columns if name.endswith(".count")]

    def entries(self, list: str) -> Table:
        """The entries of a list of all messages as columns: `stamp` and `message` (index) of their messages, then fields.

        Raises KeyError if the messages have no such list.
        """
        if list not in self.lists:
            raise KeyError(f"{self.name} has no list `{list}`, only {', '.join(self.lists) or 'none'}")
        of, columns = self._data.entries(list)
        message = np.frombuffer(of, np.int64)
        return Table(stamp=self.stamps[message], message=message, **arrays(columns))

    def to_pandas(self, list: str | None = None) -> pd.DataFrame:
        """The columns as a table, over the stamps in seconds; a row a message, or a row an entry of a list.

        `to_pandas("tracks")` has a row for each track of each message. Raises KeyError as `entries`.
        """
        import pandas as pd

        if list is not None:
            entries = self.entries(list)
            table = pd.DataFrame({name: values for name, values in entries.items() if name != "stamp"})
            table.index = pd.Index(entries["stamp"] * 1e-9, name="stamp_s")
            return table
        table = pd.DataFrame({k: v for k, v in self.columns.items() if k != "stamp"})
        table.insert(0, "visible_at_s", self.visible_at * 1e-9)
        table.index = pd.Index(self.stamps * 1e-9, name="stamp_s")
        return table

    def __len__(self) -> int:
        return len(self._data)

    def __getitem__(self, key: int | str | slice) -> Any:
        if isinstance(key, slice):
            return [self[index] for index in range(*key.indices(len(self)))]
        if isinstance(key, str):
            if key not in self.columns:
                raise KeyError(f"{self.name} has no column `{key}`, only {', '.join(self.columns)}")
            return self.columns[key]
        if not isinstance(key, (int, np.integer)):
            raise TypeError(f"{self.name}: expected the name of a column, an index or a slice, found {key!r}")
        return self.message_type.from_plain(self.plain(int(key)))

    def __iter__(self) -> Iterator[Any]:
        return (self[index] for index in range(len(self)))

    def __repr__(self) -> str:
        return f"Stream({self.name!r}, {len(self)} x {self._data.type_name.rsplit('::', 1)[-1]})"


def streams_of(data: Mapping[str, _swerve.StreamData]) -> dict[str, Stream]:
    """Streams by name."""
    return {name: Stream(stream) for name, stream in data.items()}
