"""Road networks of scenarios: the files are as their script makes them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

MAPS = Path(__file__).resolve().parents[2] / "scenarios/maps"
pytestmark = pytest.mark.skipif(not MAPS.is_dir(), reason="the maps are not here")


def check(script: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True)


def test_maps_are_as_their_script_makes_them() -> None:
    result = check(MAPS / "make.py")
    assert result.returncode == 0, result.stderr


def test_check_names_changed_and_missing_maps(tmp_path: Path) -> None:
    shutil.copytree(MAPS, tmp_path, dirs_exist_ok=True)
    (tmp_path / "ramp.xodr").unlink()
    with (tmp_path / "crossing.xodr").open("a") as file:
        file.write("\n")
    result = check(tmp_path / "make.py")
    assert result.returncode == 1 and result.stderr.startswith("crossing.xodr, ramp.xodr: "), result.stderr
