"""What a run left behind."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from typing import Any

from . import _swerve
from .streams import Stream, Table, arrays, streams_of


@dataclass(frozen=True)
class Log:
    """A run as its log has it."""

    version: str
    """Version of the program that recorded it."""
    seed: int
    """The seed of everything random."""
    config: str = field(repr=False)
    """The resolved configuration, TOML."""
    extra: dict[str, str] = field(repr=False)
    """What else is in its head: the scenario's text and file."""
    digest: str | None
    """The run's fingerprint; none where the log was cut off."""
    end: int | None
    """The last instant, nanoseconds."""
    report: dict[str, Any] | None = field(repr=False)
    """What the engine counted, by operator."""
    damage: str | None
    """What ended the reading before the end of the run, if anything did."""
    streams: dict[str, Stream] = field(repr=False)
    """The messages of each stream, by name."""
    steps: Table = field(repr=False)
    """The steps: `operator`, `stamp`, `start`, `end`, `units`, `host_ns`, `late`. Instants in nanoseconds."""
    misses: Table = field(repr=False)
    """The missed deadlines: `operator`, `stamp`, `deadline`, `at`, `reaction`, `started`."""
    drops: Table = field(repr=False)
    """What was dropped: `operator`, `stamp`, `at`, `reason`."""


def read_log(path: str | os.PathLike[str]) -> Log:
    """Reads a log (`log.mcap`), as far as it is whole.

    Raises ValueError where not even its head can be read.
    """
    log = _swerve.read_log(path)
    return Log(
        version=log["version"],
        seed=log["seed"],
        config=log["config"],
        extra=log["extra"],
        digest=log["digest"],
        end=log["end_ns"],
        report=None if log["report"] is None else json.loads(log["report"]),
        damage=log["damage"],
        streams=streams_of(log["streams"]),
        steps=Table(arrays(log["steps"])),
        misses=Table(arrays(log["misses"])),
        drops=Table(arrays(log["drops"])),
    )
