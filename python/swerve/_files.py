"""The scenarios that come with the package."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any, TypeAlias, Union

from . import _swerve

#: A file, the name of one that comes with the package, or the content of such a file.
FileOrDict: TypeAlias = Union[str, "os.PathLike[str]", dict[str, Any]]


def checked_file(name: str, value: object) -> None:
    """Raises TypeError if an argument is neither a file or name nor a dictionary."""
    if not isinstance(value, (str, os.PathLike, dict)):
        raise TypeError(f"{name}: expected a file, a name or a dictionary, found {value!r}")


def checked_names(name: str, value: Iterable[str] | None) -> list[str] | None:
    """Names of a list; raises TypeError for one text in place of a list, and for other values than texts."""
    if isinstance(value, (str, bytes)):
        raise TypeError(f"{name}: expected a list of names, found the text {value!r}")
    names = None if value is None else list(value)
    for each in names or ():
        if not isinstance(each, str):
            raise TypeError(f"{name}: expected names, found {each!r}")
    return names


def checked_threads(threads: int) -> int:
    """A number of threads; raises ValueError for less than one."""
    if not isinstance(threads, int) or isinstance(threads, bool) or threads < 1:
        raise ValueError(f"threads: expected a whole number from 1 on, found {threads!r}")
    return threads


def scenarios() -> dict[str, str]:
    """The scenarios that come with the package: their names, with what is in their files (TOML)."""
    return dict(_swerve.scenarios())
