"""Algorithms of the stack, written in Python.

An algorithm is a class with one method:

    class MyPlanner(swerve.Planner):
        def plan(self, request: swerve.PlanRequest) -> messages.Plan:
            ...

The configuration names it for the operator that calls it, in a process of its own:

    [process.plan]
    operators = ["planner"]
    python = "my_planner.py:MyPlanner"

The operator remains that of the stack. It reads the streams, selects the messages of a frame, predicts the start state,
adds the comfort layer, and publishes the result. Its keys are those of the algorithm that the configuration names.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from ._plain import Message
from .messages import (
    Detections,
    EgoState,
    Plan,
    PlanPoint,
    PlanStatus,
    Pose2,
    Prediction,
    PredictionList,
    TrackList,
)

if TYPE_CHECKING:
    from .starts import Start


@dataclass(slots=True)
class Route(Message):
    """The route: points along its line, about a metre apart, with the ground beside them."""

    s_m: NDArray[np.float64]
    """Arc lengths, metres."""
    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    heading_rad: NDArray[np.float64]
    """Directions, radians."""
    curvature_1pm: NDArray[np.float64]
    """Curvatures, 1/m, positive to the left."""
    left_m: NDArray[np.float64]
    """Distances to the left border of the drivable ground, metres."""
    right_m: NDArray[np.float64]
    """Distances to the right border, metres."""

    def at(self, s_m: Any, d_m: Any = 0.0) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
        """x and y at arc lengths and offsets to the left, heading and curvature of the route there; interpolated, constant
        beyond the ends."""
        heading = np.interp(s_m, self.s_m, np.unwrap(self.heading_rad))
        x = np.interp(s_m, self.s_m, self.x_m) - d_m * np.sin(heading)
        y = np.interp(s_m, self.s_m, self.y_m) + d_m * np.cos(heading)
        return x, y, np.asarray(heading), np.asarray(np.interp(s_m, self.s_m, self.curvature_1pm))

    def path(self, s_m: Any, d_m: Any) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
        """x, y, heading and curvature of the path through two or more points at arc lengths and offsets to the left."""
        s, d = np.broadcast_arrays(np.asarray(s_m, dtype=float), np.asarray(d_m, dtype=float))
        x, y, heading, curvature = self.at(s, d)
        along, aside = np.gradient(s) * (1.0 - curvature * d), np.gradient(d)
        heading = np.unwrap(heading + np.arctan2(aside, along))
        length = np.hypot(along, aside)
        # Points at rest have no curvature of their own.
        turned = np.divide(np.gradient(heading), length, out=curvature.copy(), where=length > 1e-6)
        return x, y, heading, turned


@dataclass(slots=True)
class Shape(Message):
    """Outline of the ego, metres; its origin is the centre of the rear axle."""

    length_m: float
    width_m: float
    height_m: float
    wheelbase_m: float
    rear_overhang_m: float
    """From the rear axle to the rear end."""


@dataclass(slots=True)
class Limits(Message):
    """Limits of the ego."""

    steering_max_rad: float
    """Largest angle of the front road wheels, radians."""
    steering_rate_max_radps: float
    accel_max_mps2: float
    brake_max_mps2: float
    """Largest deceleration, positive."""
    lateral_accel_max_mps2: float


@dataclass(slots=True)
class PlanRequest(Message):
    """Input of a planner. Instants are integer nanoseconds."""

    stamp: int
    """Stamp of the predictions."""
    start: EgoState
    """Start state of the plan; its stamp is the instant at which the plan begins."""
    route: Route
    """Route to follow."""
    along_m: float
    """Arc length of the route at the start, metres."""
    target_speed_mps: float
    """Target speed on a free road."""
    overtake_max_m: float
    """Longest distance over the line of the own lane to overtake a moving road user, metres."""
    predictions: list[Prediction]
    """Predicted motions of other road users, ordered by identity."""
    changed_lately: list[int]
    """Identities of those that changed their pace in the last seconds."""
    shape: Shape
    limits: Limits
    previous: Plan | None
    """The latest previous plan."""
    seed: int
    """Seed of the random numbers of this call."""

    @property
    def aside_m(self) -> float:
        """Offset of the start to the left of the route, metres."""
        x, y, heading, _ = self.route.at(self.along_m)
        pose = self.start.pose
        return float((pose.y_m - y) * np.cos(heading) - (pose.x_m - x) * np.sin(heading))

    def points(
        self, t_s: Any, x_m: Any, y_m: Any, heading_rad: Any, curvature_1pm: Any, speed_mps: Any
    ) -> list[PlanPoint]:
        """Points of a plan from arrays, at seconds after the start; accelerations are the derivatives of the speeds.

        The first point is the start state, at 0 s: the start state of the next plan is predicted from this plan.
        """
        accel_mps2 = np.gradient(speed_mps, t_s)
        columns = (t_s, x_m, y_m, heading_rad, curvature_1pm, speed_mps, accel_mps2)
        return [
            PlanPoint(self.start.stamp + round(t * 1e9), Pose2(x, y, heading), curvature, speed, accel)
            for t, x, y, heading, curvature, speed, accel in np.stack(np.broadcast_arrays(*columns), axis=1).tolist()
        ]

    def answer(self, points: Sequence[PlanPoint], status: PlanStatus = PlanStatus.FOUND, work: int = 0) -> Plan:
        """A plan with these points. `work` counts units, which take time under the `work` model of run times."""
        return Plan(self.stamp, status, list(points), work)


class Algorithm(ABC):
    """An algorithm that an operator of the stack calls. It reads no clock, no file and no global during a call."""

    role: ClassVar[str]
    publishes: ClassVar[type[Message]]
    """The message that its operator publishes."""
    reads: ClassVar[type[Message]]
    """A message that its operator reads."""

    def begin(self, start: Start) -> None:
        """Takes the facts of the drive, before the first call."""

    @abstractmethod
    def _calls(self) -> Callable[[dict[str, Any]], dict[str, Any]]:
        """The function from plain fields to a plain message."""


def _with_route(fields: dict[str, Any], known: list[dict[str, Any]]) -> dict[str, Any]:
    """The fields with the route, which is passed only when it changes."""
    if fields["route"] is not None:
        known[:] = [fields["route"]]
    return {**fields, "route": known[0]}


_Answer = TypeVar("_Answer", bound=Message)


def _answer(algorithm: Algorithm, method: str, answer: object, kind: type[_Answer]) -> _Answer:
    """The answer of a method if it is a message of this class."""
    if isinstance(answer, kind):
        return answer
    found = "nothing" if answer is None else f"a `{type(answer).__name__}`"
    raise TypeError(f"`{type(algorithm).__name__}.{method}` returned {found}; expected a `{kind.__name__}`")


def _check_plan(name: str, plan: Plan) -> None:
    """Fails for a plan without points, with values that are not finite, or with instants out of order."""
    wrong = f"`{name}.plan` returned a `Plan` "
    if not plan.points:
        raise ValueError(wrong + "without points; expected at least one `PlanPoint`")
    for k, point in enumerate(plan.points):
        values = {
            "pose.x_m": point.pose.x_m,
            "pose.y_m": point.pose.y_m,
            "pose.heading_rad": point.pose.heading_rad,
            "curvature_1pm": point.curvature_1pm,
            "speed_mps": point.speed_mps,
            "accel_mps2": point.accel_mps2,
        }
        for key, value in values.items():
            if not math.isfinite(value):
                raise ValueError(wrong + f"with points[{k}].{key} = {value}; expected a finite number")
        if k > 0 and point.at < plan.points[k - 1].at:
            raise ValueError(wrong + f"with points[{k}].at before that of the point before; expected rising instants")


class Planner(Algorithm):
    """A motion planner. It keeps nothing but buffers between calls: the previous plan is in the request."""

    role = "planner"
    publishes = Plan
    reads = PredictionList

    @abstractmethod
    def plan(self, request: PlanRequest) -> Plan:
        """Plans once. Finding no path is a status of the plan."""

    def _calls(self) -> Callable[[dict[str, Any]], dict[str, Any]]:
        known: list[dict[str, Any]] = []

        def call(fields: dict[str, Any]) -> dict[str, Any]:
            plan = _answer(self, "plan", self.plan(PlanRequest.from_plain(_with_route(fields, known))), Plan)
            _check_plan(type(self).__name__, plan)
            return plan.to_plain()

        return call


class Predictor(Algorithm):
    """A predictor of the other road users."""

    role = "predictor"
    publishes = PredictionList
    reads = TrackList

    @abstractmethod
    def predict(self, tracks: TrackList, instants: list[int], route: Route | None) -> PredictionList:
        """Predicts the poses of each track at these instants, the stamp of the tracks first; along the route, if given."""

    def _calls(self) -> Callable[[dict[str, Any]], dict[str, Any]]:
        known: list[dict[str, Any]] = []

        def call(fields: dict[str, Any]) -> dict[str, Any]:
            route = Route.from_plain(_with_route(fields, known)["route"]) if fields["has_route"] else None
            found = self.predict(TrackList.from_plain(fields["tracks"]), fields["instants"], route)
            return _answer(self, "predict", found, PredictionList).to_plain()

        return call


class Tracker(Algorithm):
    """A tracker of a detector's boxes on the ground."""

    role = "tracker"
    publishes = TrackList
    reads = Detections

    @abstractmethod
    def update(self, found: Detections, ego: Pose2) -> TrackList:
        """Updates the tracks with the boxes of one instant, and the pose of the ego in the map at that instant."""

    def _calls(self) -> Callable[[dict[str, Any]], dict[str, Any]]:
        def call(fields: dict[str, Any]) -> dict[str, Any]:
            tracks = self.update(Detections.from_plain(fields["boxes"]), Pose2.from_plain(fields["ego"]))
            return _answer(self, "update", tracks, TrackList).to_plain()

        return call


def check(algorithm: type[Algorithm], operator: str, read: Sequence[str], published: Sequence[str]) -> None:
    """Compares an algorithm with the messages that an operator reads and publishes, by their names.

    Raises a `TypeError` where the operator does not call such an algorithm.
    """
    wanted = algorithm.publishes.__name__
    if wanted not in published:
        raise TypeError(
            f"operator `{operator}` publishes {', '.join(published)}; {algorithm.__name__} is a {algorithm.role}, "
            f"expected an operator that publishes {wanted}"
        )
    if algorithm.reads.__name__ not in read:
        raise TypeError(
            f"operator `{operator}` reads {', '.join(read)}; {algorithm.__name__} is a {algorithm.role}, "
            f"expected an operator that reads {algorithm.reads.__name__}"
        )
