"""One drive."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from . import _swerve
from ._files import FileOrDict, checked_file, checked_names, checked_threads
from .streams import Stream, streams_of


@dataclass(frozen=True)
class Result:
    """What a run came to."""

    metrics: dict[str, Any]
    """Its measures, as `swerve run --json` tells them."""
    story: str = field(repr=False)
    """The drive as a picture, SVG."""
    streams: dict[str, Stream] = field(repr=False)
    """The messages of each stream, by name."""
    config: str = field(repr=False)
    """The resolved configuration, all defaults spelled out, TOML."""
    scenario: str = field(repr=False)
    """The scenario, TOML."""

    @property
    def digest(self) -> str:
        """A fingerprint that two equal runs share."""
        digest: str = self.metrics["digest"]
        return digest

    @property
    def verdict(self) -> str:
        """How it ended: `avoided`, `collision`, `left_road`, `timeout`."""
        verdict: str = self.metrics["verdict"]
        return verdict

    def _repr_svg_(self) -> str:
        return self.story


def run(
    scenario: FileOrDict,
    config: FileOrDict | None = None,
    *,
    set: dict[str, Any] | None = None,
    seed: int | None = None,
    threads: int = 1,
    streams: Iterable[str] | None = None,
    log: str | os.PathLike[str] | None = None,
    progress: Callable[[float, float], object] | None = None,
    allow_code: bool = False,
) -> Result:
    """Drives a scenario.

    `scenario` and `config` are files, names of those that come with the package, or the content of such a file as a
    dictionary; `set` assigns configuration keys such as `planning.planner`. All streams but those of images and point
    clouds are kept, or those that `streams` names. `log` is where the run is recorded. `progress` is called now and then
    with the simulated seconds and how many there are at most; what it raises ends the run.

    `allow_code` starts the programs that a configuration file from outside the current folder names
    (`process.NAME.start`, `python`, `interpreter`); what a dictionary names is started.

    Other threads of Python go on meanwhile, so that several runs drive at once.

    Raises ValueError with all that is wrong with a file or a key, or for an unknown stream.
    """
    checked_file("scenario", scenario)
    if config is not None:
        checked_file("config", config)
    driven = _swerve.run(
        scenario,
        config,
        set,
        seed,
        threads=checked_threads(threads),
        streams=checked_names("streams", streams),
        log=log,
        progress=progress,
        allow_code=allow_code,
    )
    return Result(
        metrics=json.loads(driven["metrics"]),
        story=driven["story"],
        streams=streams_of(driven["streams"]),
        config=driven["config"],
        scenario=driven["scenario"],
    )
