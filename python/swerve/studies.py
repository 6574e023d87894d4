"""Many drives of one configuration with keys varied."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _swerve
from ._files import checked_file, checked_threads

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class StudyResult:
    """What a study came to."""

    name: str
    """Its name."""
    axes: list[str]
    """What varies."""
    cells: list[dict[str, Any]] = field(repr=False)
    """The cells: `labels` (one an axis), `verdict`, `digest` and metrics; `error` where the run failed."""
    csv: str = field(repr=False)
    """The same as a table."""
    heatmap: str = field(repr=False)
    """The verdicts as a picture, SVG."""

    def to_pandas(self) -> pd.DataFrame:
        """A row a cell, a column an axis and a figure."""
        import pandas as pd

        rows = [
            {**dict(zip(self.axes, cell["labels"])), **{k: v for k, v in cell.items() if k != "labels"}}
            for cell in self.cells
        ]
        return pd.DataFrame(rows)

    def _repr_svg_(self) -> str:
        return self.heatmap


def _toml(value: Any) -> str:
    """A value on one line of TOML: numbers and texts are written as in JSON."""
    if isinstance(value, dict):
        inside = ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items() if v is not None)
        return "{" + inside + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    if isinstance(value, os.PathLike):
        return json.dumps(os.fspath(value))
    if isinstance(value, (bool, int, float, str)):
        return json.dumps(value)
    return _toml(value.item())  # A number of NumPy.


def _with_paths(content: dict[str, Any]) -> dict[str, Any]:
    """A study whose paths hold wherever its file is."""
    base = dict(content.get("base", {}))
    for key in ("scenario", "config"):
        if key in base and os.path.exists(base[key]):
            base[key] = os.path.abspath(base[key])
    return {**content, "base": base}


def study(
    file: str | os.PathLike[str] | dict[str, Any],
    *,
    set: dict[str, Any] | None = None,
    threads: int | None = None,
    out: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], object] | None = None,
    allow_code: bool = False,
) -> StudyResult:
    """Runs a study: a file (TOML), or its content as a dictionary.

    Cells run in parallel, one a core unless `threads` says otherwise. What is finished is kept in the folder `out`, where
    there is one, so that a second call goes on from there. `progress` is called now and then with the number of finished
    cells and of all; what it raises ends the study.

    `allow_code` is as for `swerve.run`.

    Raises ValueError with all that is wrong with the study, its files or its cells.
    """
    checked_file("study", file)
    workers = (os.cpu_count() or 1) if threads is None else checked_threads(threads)
    with tempfile.TemporaryDirectory(prefix="swerve-") as folder:
        if isinstance(file, dict):
            path = Path(folder) / f"{file.get('name', 'study')}.toml"
            content = {k: v for k, v in _with_paths(file).items() if k != "name"}
            path.write_text("".join(f"{json.dumps(k)} = {_toml(v)}\n" for k, v in content.items()))
        else:
            path = Path(file)
        studied = _swerve.study(
            path,
            Path(folder) / "cells" if out is None else Path(out),
            [f"{key}={_toml(value)}" for key, value in (set or {}).items()],
            workers,
            progress,
            allow_code or isinstance(file, dict),
        )
    return StudyResult(
        name=studied["name"],
        axes=studied["axes"],
        cells=json.loads(studied["cells"]),
        csv=studied["csv"],
        heatmap=studied["heatmap"],
    )
