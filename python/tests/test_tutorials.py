"""The tutorials, block by block, from an empty folder: files are written, commands run, output compared.

The rules for blocks are those of `crates/swerve/tests/it/tutorials.rs`, which runs the blocks `sh rust`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PAGES = Path(__file__).resolve().parents[2] / "docs/tutorial"


def blocks(page: str) -> Iterator[tuple[str, str, str]]:
    """Language, second word and text of each block."""
    for info, text in re.findall(r"^```(.+)\n((?:.*\n)*?)```$", (PAGES / page).read_text(), re.MULTILINE):
        language, _, name = info.partition(" ")
        yield language, name, text


def missing(expected: str, output: str) -> str | None:
    """First expected line that is missing in the output, in this order; `...` stands for any lines."""
    lines, skips = iter(line.rstrip() for line in output.splitlines()), True
    for line in map(str.rstrip, expected.splitlines()):
        if line == "...":
            skips = True
            continue
        found = line in lines if skips else next(lines, None) == line
        if not found:
            return line
        skips = False
    return None


def follow(page: str, folder: Path) -> None:
    """Follows a page with this interpreter and its program `swerve`."""
    programs = folder / ".bin"
    programs.mkdir()
    for name, words in {"swerve": "-m swerve ", "python": "", "python3": ""}.items():
        (programs / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {words}"$@"\n')
        (programs / name).chmod(0o755)
    environment = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}", "VIRTUAL_ENV": sys.prefix}
    place, output, runs = folder, None, 0
    for language, name, text in blocks(page):
        if language == "sh" and name in ("", "python"):
            script = f"set -e\n{text}\npwd > '{folder}/.pwd'"
            run = subprocess.run(["sh", "-c", script], cwd=place, env=environment, capture_output=True, text=True, check=False)
            assert run.returncode == 0, (text, run.stdout, run.stderr)
            place, output, runs = Path((folder / ".pwd").read_text().rstrip()), run.stdout, runs + 1
        elif language == "sh":
            assert name in ("install", "long", "rust"), f"{page}: unknown mark `{name}`"
            output = None
        elif language == "text":
            missed = missing(text, output) if output is not None else None
            assert missed is None, (missed, output)
        else:
            assert name, f"{page}: expected a file name after `{language}`"
            (place / name).write_text(text)
    assert runs >= 2


def test_missing_lines_are_found() -> None:
    assert missing("a\n...\nd\n", "x\na\nb\nc\nd \n") is None
    assert missing("a\nc\n", "a\nb\nc\n") == "c"
    assert missing("a\n...\nd\n", "d\na\n") == "d"


def test_first_result_runs_with_its_planner_in_python(tmp_path: Path) -> None:
    follow("first_result.md", tmp_path)


def test_the_planner_of_the_first_result_has_15_lines() -> None:
    planners = [text for language, name, text in blocks("first_result.md") if name in ("brake.py", "src/brake.rs")]
    assert [len(text.splitlines()) for text in planners] <= [15, 40] and len(planners) == 2


def test_highway_runs(tmp_path: Path) -> None:
    pytest.importorskip("highway_env")
    follow("highway.md", tmp_path)
