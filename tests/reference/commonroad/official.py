"""Drives CommonRoad scenarios with Swerve and compares two verdicts on each solution: Swerve's and the official checker's.

    python3 -m venv venv
    venv/bin/pip install commonroad-drivability-checker==2025.4.0 commonroad-io==2024.3 commonroad-clcs triangle
    venv/bin/python official.py swerve OUT SCENARIOS... [--set KEY=VALUE]

SCENARIOS are files, or folders that are searched for `.xml.gz` and `.xml`. Each one is driven with seed 1 for each model, ST2 and
KS2. One line is printed for each solution, then the counts; all verdicts are in OUT/verdicts.json. The exit status is 1 where the
two verdicts differ.
`commonroad-io` 2026.1, which pip would install, lacks modules that the checker imports.
"""

import argparse
import contextlib
import gzip
import io
import json
import logging
import subprocess
import sys
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

warnings.filterwarnings("ignore")
logging.disable(logging.CRITICAL)

from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.solution import CommonRoadSolutionReader
from commonroad_dc.feasibility.solution_checker import valid_solution

MODELS = ("st", "ks")


def scenario_files(places: list[Path]) -> list[Path]:
    """CommonRoad scenarios, in the order of their names. Routes and nets of SUMO are XML too."""
    found = [file for place in places for file in (place.rglob("*") if place.is_dir() else [place])]
    known = [file for file in found if file.name.endswith((".xml", ".xml.gz"))]
    return sorted(file for file in known if b"<commonRoad " in text_of(file)[:2000])


def text_of(file: Path) -> bytes:
    data = file.read_bytes()
    return gzip.decompress(data) if file.suffix == ".gz" else data


def official(scenario: Path, solution: Path) -> str:
    """`valid`, `infeasible`, or the class of the exception that the checker raises."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            read = CommonRoadFileReader(str(scenario)).open()
            return "valid" if valid_solution(*read, CommonRoadSolutionReader.open(str(solution)))[0] else "infeasible"
    except Exception as error:
        return type(error).__name__


def driven(swerve: str, file: Path, out: Path, model: str, keys: list[str]) -> dict[str, Any]:
    """Drives one scenario: both verdicts, or the error of the program."""
    name = file.name.removesuffix(".gz").removesuffix(".xml").removesuffix(".cr")
    row: dict[str, Any] = {"scenario": name, "model": model}
    solution, plain = out / f"{name}.{model}.xml", out / f"{name}.xml"
    plain.write_bytes(text_of(file))
    words = [swerve, "run", file, "--seed", "1", "--solution", solution, "--solution-model", model, "--json"]
    words += ["--out", out / "run", "--overwrite", *(word for key in keys for word in ("--set", key))]
    run = subprocess.run(words, capture_output=True, text=True, check=False)
    if not solution.is_file():
        return row | {"swerve": "", "official": "", "error": run.stderr.strip()}
    check = [swerve, "eval", "commonroad", solution, "--scenarios", plain, "--json"]
    own = json.loads(subprocess.run(check, capture_output=True, text=True, check=False).stdout)[0]
    verdict = "valid" if own["valid"] else own["official"]
    return row | {"swerve": verdict, "official": official(plain, solution), "failures": own["failures"]}


def main() -> int:
    parser = argparse.ArgumentParser(description="Compares Swerve's verdict on its solutions with the official checker's.")
    parser.add_argument("swerve")
    parser.add_argument("out", type=Path)
    parser.add_argument("scenarios", type=Path, nargs="+")
    parser.add_argument("--set", action="append", default=[], dest="keys")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for file in scenario_files(args.scenarios):
        for model in MODELS:
            rows.append(driven(args.swerve, file, args.out, model, args.keys))
            print(*(rows[-1].get(key) or "-" for key in ("scenario", "model", "swerve", "official", "error")), flush=True)
    (args.out / "verdicts.json").write_text(json.dumps(rows, indent=1))
    for model, of_model in ((each, [row for row in rows if row["model"] == each]) for each in MODELS):
        pairs = Counter((row["swerve"] or "not written", row["official"] or "-") for row in of_model)
        for (own, other), count in sorted(pairs.items()):
            print(f"{model}: {count} x swerve {own}, official {other}")
    return int(any(row["swerve"] != row["official"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
