"""The command line: `python -m swerve` is `swerve`, and `swerve worker FILE.py:Class` has operators in Python."""

from __future__ import annotations

import signal
import sys

from . import _swerve


def main() -> int:
    """Runs the command line of this process; gives the exit code."""
    words = sys.argv[1:]
    if words[:1] == ["worker"] and len(words) > 1:
        from .operators import work

        return work(words[1:])
    # Rust does not look for Python's note of Ctrl-C: what it does not handle itself ends the process.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _swerve.main(["swerve", *words])


if __name__ == "__main__":
    sys.exit(main())
