"""The scenarios and configurations that come with the package."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, TypeAlias, Union

#: A path, or the content of such a file.
FileOrDict: TypeAlias = Union[str, "os.PathLike[str]", dict[str, Any]]

_DATA = Path(__file__).parent / "data"
#: The folder of the scenarios that come with the package.
SCENARIOS = _DATA / "scenarios"
#: The folder of the configurations that come with the package.
CONFIGS = _DATA / "configs"


def scenarios() -> list[str]:
    """The names of the scenarios that come with the package."""
    return sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def found(file: str | os.PathLike[str], folder: Path) -> str:
    """The path of a file: as it is, or, for a bare name that is no file here, of the one in `folder`."""
    path = os.fspath(file)
    bundled = folder / f"{path}.toml"
    return str(bundled) if not os.path.exists(path) and bundled.is_file() else path


def file_or_dict(what: FileOrDict, folder: Path) -> str | dict[str, Any]:
    """A dictionary as it is, anything else as the path of a file."""
    return what if isinstance(what, dict) else found(what, folder)
