"""Swerve from Python: drives, studies and logs; environments to learn in; operators of the stack.

>>> import swerve
>>> result = swerve.run("person_behind_truck", set={"planning.planner": "rrt_star"})
>>> result.verdict, result.digest
>>> result.streams["pose"]["speed_mps"]

`swerve.Stack` is the stack in a foreign world. `swerve.gym` has the environments, `swerve.messages` the messages of streams. `swerve.Planner`, `Predictor` and `Tracker` are
the base classes of algorithms, `swerve.Operator` that of operators, `swerve.World` that of worlds.
"""

from __future__ import annotations

import sys

from . import _swerve, messages
from ._files import scenarios
from .algorithms import Planner, PlanRequest, Predictor, Route, Tracker
from .logs import Log, read_log
from .maps import Lane, Map, Place, read_map
from .operators import Frame, Operator
from .runs import Result, run
from .stacks import Commanded, Input, Stack
from .starts import Start
from .streams import Stream, Table
from .studies import StudyResult, study
from .varied import varied
from .worlds import Scene, World

__version__: str = _swerve.__version__

# Processes of a run are this interpreter with this package.
_swerve.host(sys.executable, ["-m", "swerve"], _swerve.__file__)

__all__ = [
    "Commanded",
    "Frame",
    "Input",
    "Lane",
    "Log",
    "Map",
    "Operator",
    "Place",
    "PlanRequest",
    "Planner",
    "Predictor",
    "Result",
    "Route",
    "Scene",
    "Stack",
    "Start",
    "Stream",
    "StudyResult",
    "Table",
    "Tracker",
    "World",
    "messages",
    "read_log",
    "read_map",
    "run",
    "scenarios",
    "study",
    "varied",
]
