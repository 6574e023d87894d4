"""The scenarios that come with the package."""

from __future__ import annotations

import os
from typing import Any, TypeAlias, Union

from . import _swerve

#: A file, the name of one that comes with the package, or the content of such a file.
FileOrDict: TypeAlias = Union[str, "os.PathLike[str]", dict[str, Any]]


def scenarios() -> dict[str, str]:
    """The scenarios that come with the package: their names, with what is in their files (TOML)."""
    return dict(_swerve.scenarios())
