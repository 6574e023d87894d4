"""The pages on Python, block by block, from an empty folder."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/howto/python.md").read_text()
GUEST = (ROOT / "docs/howto/guest.md").read_text()
WORLD = (ROOT / "docs/howto/world_in_python.md").read_text()
BLOCKS = [(info.split(), text) for info, text in re.findall(r"^```(.*)\n((?:.*\n)*?)```$", PAGE + GUEST + WORLD, re.MULTILINE)]


def python(*words: str, folder: Path) -> str:
    run = subprocess.run([sys.executable, *words], cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run
    return run.stdout


@pytest.mark.parametrize("text", [text for info, text in BLOCKS if info == ["python"]])
def test_a_block_of_python_runs(text: str, tmp_path: Path) -> None:
    if "gymnasium" in text:
        pytest.importorskip("gymnasium")
    python("-c", text, folder=tmp_path)


def test_a_configuration_runs_with_what_is_beside_it(tmp_path: Path) -> None:
    shutil.copy(ROOT / "examples/python/detector.py", tmp_path)
    for info, text in BLOCKS:
        if info[:1] == ["python"] and len(info) == 2:
            (tmp_path / info[1]).write_text(text)
    configs = [text for info, text in BLOCKS if info == ["toml", "config"]]
    assert len(configs) == 4
    for index, text in enumerate(configs):
        (tmp_path / f"my_{index}.toml").write_text(text)
        said = [
            python("-m", "swerve", "run", "person_behind_truck", "-c", f"my_{index}.toml", "--json", folder=tmp_path)
            for _ in range(2)
        ]
        digests = [re.search(r'"digest": "(\w+)"', each) for each in said]
        assert digests[0] and digests[1] and digests[0][1] == digests[1][1]


def test_the_command_line_drives_as_the_page_says(tmp_path: Path) -> None:
    import swerve

    said = python("-m", "swerve", "run", "person_behind_truck", "--json", folder=tmp_path)
    assert f'"digest": "{swerve.run("person_behind_truck").digest}"' in said
