"""The command line: `python -m swerve` is `swerve`, and `swerve worker FILE.py:Class` has operators in Python."""

from __future__ import annotations

import signal
import sys

from . import _swerve
from ._files import CONFIGS, SCENARIOS, found


def _with_bundled(words: list[str]) -> list[str]:
    """Names of scenarios and configurations that come with the package, as their files."""
    if not words or words[0] not in ("run", "graph", "check"):
        return words
    out = [words[0]]
    for before, word in zip(words, words[1:]):
        if before in ("-c", "--config"):
            out.append(found(word, CONFIGS))
        elif before.startswith("-") and before != "--json" or word.startswith("-"):
            out.append(word)
        else:
            out.append(found(word, SCENARIOS))
    return out


def main() -> int:
    """Runs the command line of this process; gives the exit code."""
    words = sys.argv[1:]
    if words[:1] == ["worker"] and len(words) > 1:
        from .operators import work

        return work(words[1:])
    # Rust does not look for Python's note of Ctrl-C: what it does not handle itself ends the process.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _swerve.main(["swerve", *_with_bundled(words)])


if __name__ == "__main__":
    sys.exit(main())
