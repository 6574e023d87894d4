"""An operator that reads the map and the route: it reports roads as closed where a barrier is on the route.

`swerve run maps/closed_road -c barriers.toml` drives with it.
"""

import swerve
from swerve.messages import ActorKind, Closures, ObstacleList, Route, Stop


class Barriers(swerve.Operator):
    inputs = {"seen": ObstacleList, "route": Route}
    outputs = {"closures": Closures}

    def __init__(self) -> None:
        self.closed: dict[int, Stop] = {}  # by lane

    def step(self, frame: swerve.Frame) -> Closures:
        lanes = {stretch.lane for stretch in frame["route"].stretches}
        for barrier in (one for one in frame["seen"].obstacles if one.kind == ActorKind.STATIC):
            place = self.map.nearest(barrier.pose.x_m, barrier.pose.y_m)
            if place.lane in lanes and abs(place.d_m) < 1.0:
                self.closed.setdefault(place.lane, Stop(place.lane, place.s_m))
        return Closures(frame.stamp, list(self.closed.values()))
