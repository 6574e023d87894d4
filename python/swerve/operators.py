"""Operators of the stack, written in Python.

An operator is a class in a file of its own:

    class Watcher(swerve.Operator):
        inputs = {"image": messages.Image}
        outputs = {"health": messages.SensorHealth}

        def step(self, frame: swerve.Frame) -> messages.SensorHealth:
            image = frame["image"]
            ...

It runs in a process of the run, which the configuration starts in the place of the operator's own:

    [process.watch]
    operators = ["eye"]
    python = "watcher.py:Watcher"

With `[operator.NAME] kind = "python"` a configuration declares an operator that Swerve does not know.

What images and point clouds consist of is read where their sensor wrote it, in shared memory: nothing is copied, and the
arrays cannot be written to. They are valid as long as they are held.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import Any, ClassVar

from . import _swerve, algorithms
from .algorithms import Algorithm
from .maps import Map
from .messages import Message
from .starts import Start, start_of
from .streams import message_class
from .worlds import Steps, World


@dataclass(frozen=True, slots=True)
class Header:
    """When a message describes the world, when it could be read, and where it comes from. Nanoseconds."""

    stamp: int
    visible_at: int
    seq: int
    watermark: int
    reused_from: int | None
    origin: int | None


@dataclass(frozen=True, slots=True)
class Frame:
    """What a step is given: the newest message of each input by its name, and when it is."""

    operator: str
    """The operator's name in the graph."""
    now: int
    """The present instant, nanoseconds."""
    stamp: int
    """The instant that the frame describes, nanoseconds."""
    deadline: int | None
    """When it has to be answered, nanoseconds."""
    windows: Mapping[str, Sequence[tuple[Header, Any]]] = field(repr=False)
    """All messages of each input, oldest first, with their headers; one at most where the input is no window."""
    _work: list[int] = field(default_factory=list, repr=False, compare=False)

    def spend(self, units: int) -> None:
        """Counts units of work of this step: under the run-time model `work`, its run time follows from their sum.

        Raises ValueError for a negative number.
        """
        if units < 0:
            raise ValueError(f"frame.spend({units}): expected zero or more units of work")
        self._work.append(int(units))

    def __getitem__(self, name: str) -> Any:
        """The newest message of an input; none where there is none yet."""
        messages = self.windows[name]
        return messages[-1][1] if messages else None

    def header(self, name: str) -> Header | None:
        """The header of that message."""
        messages = self.windows[name]
        return messages[-1][0] if messages else None


class Operator:
    """One component of the stack: a step from inputs to outputs, with state of its own.

    A step reads no clock, no file and no global: what it needs is in its frame and its state. It is made anew with each
    start of its process, without arguments.
    """

    inputs: ClassVar[Mapping[str, type[Message]]] = {}
    """The inputs by the names of the ports that the configuration declares. For an operator that Swerve knows by names
    of its own, in the order of the operator's ports, timers left out."""
    outputs: ClassVar[Mapping[str, type[Message]]] = {}
    """The outputs in the same way."""
    map: Map
    """The lanes of the scenario's road or map; those of a `Route` are in it. It is there from the first step on."""

    def begin(self, start: Start) -> None:
        """Takes the facts of the drive, before the first step; after a restart of its process again."""

    def step(self, frame: Frame) -> Message | Mapping[str, Message | None] | None:
        """Answers one frame: a message, or messages by the names of the outputs; none where it has no answer."""
        raise NotImplementedError


#: Of each port its name where the configuration declares it, how it is read, its stream, the Rust type of its messages;
#: of an output not how it is read.
_Ports = Sequence[tuple[str | None, ...]]


def _ports(
    what: str, operator: str, declared: Mapping[str, type[Message]], ports: _Ports
) -> list[tuple[str, type[Message]]]:
    """What a class declares in the order of the graph's ports: those that have names go by these, others by their place."""
    wanted = [(port[0] or name, message_class(str(port[-1]))) for port, name in zip_longest(ports, declared) if port]
    if sorted((name, kind.__name__) for name, kind in declared.items()) != sorted(
        (name or "", kind.__name__) for name, kind in wanted
    ):
        has = ", ".join(f"{port[0] or port[-2]}: {kind.__name__}" for port, (_, kind) in zip(ports, wanted))
        says = ", ".join(f"{name}: {kind.__name__}" for name, kind in declared.items())
        raise TypeError(f"{what} of operator `{operator}` are ({has}), the class declares ({says})")
    return wanted


#: A step with plain values: from the facts of a frame and its inputs to the units of work, and an output or none a port.
Stepper = Callable[..., tuple[int, list[Any]]]


def stepper(operator: Operator, name: str, inputs: _Ports, outputs: _Ports) -> Stepper:
    """The function that takes the steps of an operator."""
    ports = _ports("inputs", name, operator.inputs, inputs)
    out = [name for name, _ in _ports("outputs", name, operator.outputs, outputs)]

    def step(facts: dict[str, Any], read: list[list[tuple[dict[str, Any], dict[str, Any]]]]) -> tuple[int, list[Any]]:
        windows = {
            name: [(Header(**header), kind.from_plain(plain)) for header, plain in messages]
            for (name, kind), messages in zip(ports, read, strict=True)
        }
        frame = Frame(windows=windows, **facts)
        answer = operator.step(frame)
        work = sum(frame._work)
        if answer is None:
            return work, []
        if isinstance(answer, Message):
            if len(out) != 1:
                raise TypeError(f"one message, expected a dictionary of the outputs {', '.join(out)}")
            answer = {out[0]: answer}
        if not isinstance(answer, Mapping):
            raise TypeError(
                f"`{type(operator).__name__}.step` returned a `{type(answer).__name__}`; expected a message, a dictionary of "
                f"messages by output ({', '.join(out)}), or None"
            )
        unknown = answer.keys() - set(out)
        if unknown:
            raise KeyError(f"no output is called {', '.join(sorted(unknown))}; there are {', '.join(out)}")
        messages = [answer.get(name) for name in out]
        for name, message in zip(out, messages):
            if message is not None and not isinstance(message, Message):
                found = type(message).__name__
                raise TypeError(f"`{type(operator).__name__}.step` returned a `{found}` as `{name}`; expected a message")
        return work, [None if message is None else message.to_plain() for message in messages]

    return step


def load(where: str) -> type[Operator] | type[Algorithm] | type[World]:
    """The class that `FILE.py:Class` names."""
    file, _, name = where.rpartition(":")
    if not file:
        raise ValueError(f"expected FILE.py:Class, found `{where}`")
    path = Path(file).resolve()
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise FileNotFoundError(f"{file}: expected a Python file with the class `{name}`")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    # What lies beside the file is imported as if it were run.
    sys.path.insert(0, str(path.parent))
    spec.loader.exec_module(module)
    found = getattr(module, name, None)
    if not (isinstance(found, type) and issubclass(found, (Operator, Algorithm, World))):
        fit = (v for v in vars(module).values() if isinstance(v, type) and issubclass(v, (Operator, Algorithm, World)))
        classes = [v.__name__ for v in fit if v.__module__ == module.__name__]
        raise TypeError(f"{file} has no operator `{name}`, only {', '.join(classes) or 'none'}")
    return found


#: Creates an algorithm and returns the function that the stack calls.
_Creator = Callable[[], Callable[[dict[str, Any]], dict[str, Any]]]


def _creator(algorithm: type[Algorithm], starts: list[Start]) -> _Creator:
    def create() -> Callable[[dict[str, Any]], dict[str, Any]]:
        made = algorithm()
        made.begin(starts[-1])
        return made._calls()

    return create


def _algorithms(places: Iterable[str], starts: list[Start]) -> dict[str, _Creator]:
    """The algorithms among the classes, by role. A class that cannot be loaded is reported with its operator."""
    made: dict[str, _Creator] = {}
    for where in places:
        try:
            found = load(where)
        except Exception:
            continue
        if issubclass(found, Algorithm):
            made[found.role] = _creator(found, starts)
    return made


class _Process:
    """The classes of a process, and the facts of its drive."""

    def __init__(self, places: Mapping[str, str]) -> None:
        self._places = places
        self._worlds: dict[str, Steps] = {}
        self.starts: list[Start] = []

    def make(
        self, name: str, inputs: _Ports, outputs: _Ports, about: tuple[str, int, _swerve.Lanes, dict[str, Any]]
    ) -> Callable[..., Any] | None:
        """The steps of an operator; `None` if it is one of the stack, which calls an algorithm."""
        kind, period_ns, lanes, plain = about
        where = self._places.get(name, self._places.get(""))
        if where is None:
            raise KeyError(f"no class is named for operator `{name}`")
        map = Map(lanes)
        start = start_of(plain, map)
        self.starts.append(start)
        found = load(where)
        if (kind in ("python_world", "python_sensor")) != issubclass(found, World):
            expected = "a `swerve.World`" if kind.startswith("python_") else "an operator of the kind python_world"
            raise TypeError(f"operator `{name}` and the class `{found.__name__}` do not fit: expected {expected}")
        if issubclass(found, World):
            if where not in self._worlds:
                self._worlds[where] = Steps(found, start)
            world = self._worlds[where]
            return world.world if kind == "python_world" else world.sensor(name, str(outputs[0][-1]), period_ns)
        if issubclass(found, Algorithm):
            # The operator of the stack calls it.
            read, published = ([message_class(str(port[-1])).__name__ for port in side] for side in (inputs, outputs))
            algorithms.check(found, name, read, published)
            return None
        operator = found()
        operator.map = map
        operator.begin(start)
        return stepper(operator, name, inputs, outputs)


def work(words: list[str]) -> int:
    """Takes steps for the run that started this process: `[NAME=]FILE.py:Class`, one for all its operators or each."""
    places = {name: where for name, _, where in (word.rpartition("=") for word in words)}
    process = _Process(places)
    # Standard output is how a process answers its run; what an operator prints is for people.
    sys.stdout = sys.stderr
    try:
        _swerve.work(process.make, _algorithms(places.values(), process.starts))
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
