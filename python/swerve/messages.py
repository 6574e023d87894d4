"""The messages on the edges between operators, field by field as the Rust types have them.

Written by `tools/messages.py`: change the Rust types, not this file. SI units and radians; instants and spans
are integer nanoseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from ._plain import Message, Pixels, Tagged, Transform

#: An instant: nanoseconds since the run started.
Time = int
#: A length of time in nanoseconds.
Span = int
#: Identifies an actor or a track within one run.
ActorId = int


class RoadLine(str, Enum):
    """A line that the road's description gives."""
    RIGHT_EDGE = "right_edge"
    """Right edge of the drivable ground."""
    LANE_RIGHT = "lane_right"
    """Right border of the ego's lane, where the ground goes on."""
    LANE_LEFT = "lane_left"
    """Left border of the ego's lane, where the ground goes on."""
    LEFT_EDGE = "left_edge"
    """Left edge of the drivable ground."""


class Side(str, Enum):
    """One of two sides."""
    LEFT = "left"
    """Towards +d."""
    RIGHT = "right"
    """Towards -d."""


class Signal(str, Enum):
    """What a traffic light shows."""
    GREEN = "green"
    """Go."""
    YELLOW = "yellow"
    """Stop where that can be done."""
    RED = "red"
    """Stop."""


class StopCause(str, Enum):
    """Why the car is stopped."""
    COMMAND_TIMEOUT = "command_timeout"
    """No sound command for too long."""
    REPORT_TIMEOUT = "report_timeout"
    """No sound report of the vehicle for too long."""
    RELEASED = "released"
    """The person let go of the switch."""
    EMERGENCY = "emergency"
    """The emergency stop."""
    COMMAND_FROZEN = "command_frozen"
    """Commands come, and say the same for too long."""
    SECOND_WRITER = "second_writer"
    """Commands come from somebody else than from who drove."""
    CLOCK_JUMP = "clock_jump"
    """The clock that stamps the commands was set."""
    TRANSPORT_LOST = "transport_lost"
    """The process that carries commands and reports is gone."""
    POSE_LOST = "pose_lost"
    """Localization reports that the pose is lost."""
    POSE_IMPLAUSIBLE = "pose_implausible"
    """The pose does not move as the wheels do."""


class Refusal(str, Enum):
    """Why a command was refused."""
    NOT_FINITE = "not_finite"
    """A number of it is none."""
    OUT_OF_ORDER = "out_of_order"
    """It is older than the one before it."""
    STALE = "stale"
    """It is too old."""
    AHEAD = "ahead"
    """It is from the future."""


class Encoding(str, Enum):
    """What an image's numbers mean."""
    RGB8 = "rgb8"
    """Red, green, blue, a byte each, sRGB."""
    DEPTH_F32_M = "depth_f32_m"
    """Distance along the optical axis, metres; infinite where nothing is."""
    CLASS_U8 = "class_u8"
    """Class of what is seen, Cityscapes ids."""
    INSTANCE_U32 = "instance_u32"
    """Which thing is seen: an actor's identity, 0 for what is none. What the simulator alone can know."""


class PoseMode(str, Enum):
    """Whether a pose can be driven by; the worse the greater."""
    GOOD = "good"
    """What tells the place comes and is believed."""
    COASTING = "coasting"
    """By inertia and wheels alone for now."""
    LOST = "lost"
    """Not to be driven by: no pose is told."""


class ActorKind(str, Enum):
    """What an actor is."""
    CAR = "car"
    """A passenger car or van."""
    TRUCK = "truck"
    """A truck or bus."""
    MOTORCYCLE = "motorcycle"
    """A motorcycle with its rider."""
    CYCLIST = "cyclist"
    """A bicycle with its rider."""
    PEDESTRIAN = "pedestrian"
    """A person on foot."""
    STATIC = "static"
    """Anything that cannot move: walls, poles, boxes."""


class PlanStatus(str, Enum):
    """How a plan came about."""
    ROUTE = "route"
    """Nothing asked for planning: the route is followed."""
    FOUND = "found"
    """The planner found this path."""
    KEPT = "kept"
    """Nothing found: the previous plan goes on, still free of collision."""
    BRAKE = "brake"
    """Nothing found: full brake along the previous path."""
    STOP = "stop"
    """Nothing found: speed zero along the route."""
    GAVE_UP = "gave_up"
    """Nothing found: the route is followed regardless."""
    COMFORTABLE = "comfortable"
    """The comfortable layer found this path."""
    POSE_UNCERTAIN = "pose_uncertain"
    """A stop: the pose is too uncertain for the lane."""


class InfractionKind(str, Enum):
    """Rules that the ego can break."""
    LEFT_ROAD = "left_road"
    """Part of the footprint left the drivable ground."""


class EndReason(str, Enum):
    """Why a scenario is over."""
    GOAL = "goal"
    """The ego reached the end of the scenario."""
    STOPPED = "stopped"
    """The ego stands still where the scenario asks for that."""
    COLLISION = "collision"
    """A collision, some time after it happened."""
    TIMEOUT = "timeout"
    """The scenario's time is over."""


class Verdict(str, Enum):
    """The outcome of a run in one word; the first that holds, in the order in which `docs/conventions.md` has
    them.
    """
    AVOIDED = "avoided"
    """The ego came to the end, or to the stop asked for, touching nothing and staying on the road."""
    COMPLETED = "completed"
    """The same, in a scenario without anybody else: there was nothing to avoid."""
    COLLISION = "collision"
    """The ego hit something, whatever else happened."""
    LEFT_ROAD = "left_road"
    """Part of the ego left the drivable ground, and it hit nothing."""
    STOPPED = "stopped"
    """The scenario's time was over, and the ego stood safely before what was in its way."""
    TIMEOUT = "timeout"
    """The scenario's time was over before the ego reached its end."""
    UNFINISHED = "unfinished"
    """The run was ended before the scenario was."""


@dataclass(frozen=True, slots=True)
class GateMode(Tagged):
    """What the safety gate does."""
    kind: str
    """One of `manual`, `driving`, `stopping`, `holding`."""
    value: StopCause | None = None


@dataclass(slots=True)
class Point2(Message):
    """A place in the ground plane of frame `F`, in metres."""
    x_m: float
    """Along the frame's x axis, metres."""
    y_m: float
    """Along the frame's y axis, metres."""


@dataclass(slots=True)
class Vector2(Message):
    """A displacement or velocity in the ground plane of frame `F`."""
    x: float
    """Component along the frame's x axis."""
    y: float
    """Component along the frame's y axis."""


@dataclass(slots=True)
class Pose2(Message):
    """A position and heading in the ground plane of frame `F`."""
    x_m: float
    """Position along the frame's x axis, metres."""
    y_m: float
    """Position along the frame's y axis, metres."""
    heading_rad: float
    """Heading from the frame's x axis towards its y axis, radians, in `(-pi, pi]`."""


@dataclass(slots=True)
class Obb(Message):
    """An oriented rectangle in the ground plane of frame `F`."""
    center: Pose2
    """Pose of the rectangle's centre."""
    half_length_m: float
    """Half its extent along its heading, metres."""
    half_width_m: float
    """Half its extent across its heading, metres."""


@dataclass(slots=True)
class Polyline(Message):
    """A line through points, parametrised by arc length `s` (metres from its first point). Positions are
    linear between the points; headings and curvatures are linear between per-point values, so that sampling
    is smooth when the points are dense. Beyond its ends the line goes on straight.
    """
    points: list[Point2]
    s_m: list[float]
    heading_rad: list[float]
    curvature_1pm: list[float]


@dataclass(slots=True)
class Command(Message):
    """What the stack asks of the vehicle."""
    steering_rad: float
    """Wanted angle of the front road wheels, radians; positive to the left."""
    throttle: float
    """Accelerator pedal, 0 to 1."""
    brake: float
    """Brake pedal, 0 to 1."""


@dataclass(slots=True)
class MotionCommand(Message):
    """What the stack asks of a vehicle whose own controllers work the pedals."""
    stamp: Time
    """Instant of the state that it was computed from."""
    steering_rad: float
    """Wanted angle of the front road wheels, radians; positive to the left."""
    speed_mps: float
    """Wanted speed of the ego origin along its heading, m/s; negative in reverse."""
    accel_mps2: float
    """Wanted acceleration along the heading, m/s²."""


@dataclass(slots=True)
class ResponseBudget(Message):
    """How long the answer to a sensor frame may take, and how that is divided."""
    stamp: Time
    """Stamp of the predictions that it was made from."""
    left_s: float | None
    """Time in which the ego, as it goes now, has to begin to brake or to swerve, seconds; negative when that
    is over, none where nothing is ahead.
    """
    hazard: ActorId | None
    """What leaves so little time; none where nothing does."""
    hidden: bool
    """Whether it is what may be hidden behind the hazard, not the hazard itself."""
    obstacles: int
    """Things near by."""
    response: Span
    """From the sensor frame to its plan."""
    detector: Span
    """Of that, the detector's part for frames to come."""
    planner: Span
    """What is left to the planner for this one."""


@dataclass(slots=True)
class RungTaken(Message):
    """Which rung of its ladder an operator took for a frame."""
    stamp: Time
    """Stamp of the frame."""
    rung: str
    """The rung's name."""
    run_time: Span
    """What it takes."""
    left: Span | None = None
    """What was left until the deadline when the step started; none without deadline."""


@dataclass(slots=True)
class DetectedBox(Message):
    """One thing that a detector reports: a box that stands upright, without identity or velocity."""
    kind: ActorKind
    """What it is taken for."""
    score: float
    """How sure the detector is, 0 to 1; not a probability."""
    pose: Pose2
    """Pose of the centre of its footprint in the ego frame of the stamp."""
    bottom_m: float
    """Height of its bottom over the ego's ground plane, metres."""
    extent: Extent
    """Size."""
    image_px: tuple[float, float, float, float] | None = None
    """Left, top, right and bottom edge of its picture, cut at the image's edges, pixels; `None` without a
    camera and where nothing of it is in the image.
    """
    covariance_m2: tuple[float, float, float] | None = None
    """Covariance of the place in the ego frame: xx, xy, yy, m²; `None` from what does not know it."""
    radial_speed_mps: float | None = None
    """Speed over ground along the line of sight, m/s, positive for what goes away; `None` where no radar says
    it.
    """


@dataclass(slots=True)
class Detections(Message):
    """All that a detector reports of one instant."""
    stamp: Time
    """Instant of the measurement."""
    boxes: list[DetectedBox]
    """By falling score."""


@dataclass(slots=True)
class EgoState(Message):
    """The ego vehicle as localization reports it."""
    stamp: Time
    """Instant that this describes."""
    pose: Pose2
    """Pose of the ego origin (centre of the rear axle on the ground) in the map."""
    speed_mps: float
    """Speed of the ego origin along its heading, m/s; negative in reverse."""
    accel_mps2: float
    """Acceleration of the ego origin along its heading, m/s²."""
    lateral_accel_mps2: float
    """Lateral acceleration at the centre of gravity, m/s²; positive to the left."""
    yaw_rate_radps: float
    """Yaw rate, rad/s; positive to the left."""
    steering_rad: float
    """Present angle of the front road wheels, radians; positive to the left."""


@dataclass(slots=True)
class Imu(Message):
    """One reading of the inertial measurement unit at its place, axes of the ego frame."""
    stamp: Time
    """Instant of the measurement."""
    accel_mps2: tuple[float, float, float]
    """Specific force (acceleration minus gravity): at rest on level ground z reads +9.81, m/s²."""
    gyro_radps: tuple[float, float, float]
    """Angular rate, rad/s."""


@dataclass(slots=True)
class Gnss(Message):
    """One satellite fix of the receiver's antenna, WGS 84."""
    stamp: Time
    """Instant of the measurement."""
    latitude_deg: float
    """Latitude, degrees north."""
    longitude_deg: float
    """Longitude, degrees east."""
    altitude_m: float
    """Height above the ellipsoid, metres."""
    deviation_m: float
    """Standard deviation of the horizontal position, metres."""


@dataclass(slots=True)
class CollisionEvents(Message):
    """What the ego began to touch at one step of the world; mostly nothing."""
    stamp: Time
    """The step."""
    events: list[CollisionEvent]
    """Ordered by identity."""


@dataclass(slots=True)
class CollisionEvent(Message):
    """The ego began to touch something."""
    actor: ActorId
    """What it touched."""
    kind: ActorKind
    """What that is."""
    impulse_n_s: float
    """Impulse of the first step of the contact, N s."""
    closing_speed_mps: float
    """Speed at which the two closed along the contact normal just before, m/s."""


@dataclass(slots=True)
class LaneInvasions(Message):
    """Which lines the ego began to cross at one step of the world; mostly none."""
    stamp: Time
    """The step."""
    events: list[LaneInvasion]
    """From the rightmost line to the leftmost."""


@dataclass(slots=True)
class LaneInvasion(Message):
    """The ego's outline came onto a line, or leapt over it."""
    line: RoadLine
    """Which line of the road."""
    line_d_m: float
    """Where that is: to the left of the centre of the ego's lane, metres."""
    side: Side
    """With which side of the ego: to the left when it was to the right of the line."""
    s_m: float
    """Where the middle of the outline was then, along the road, metres."""


@dataclass(slots=True)
class RedLightEvents(Message):
    """Which red lights the ego passed at one step of the world; mostly none."""
    stamp: Time
    """The step."""
    events: list[RedLightEvent]
    """In the order of the road's lights."""


@dataclass(slots=True)
class RedLightEvent(Message):
    """The ego's front went over a stop line while its light was red."""
    light: int
    """Which light: its place in the road's description, from 0."""
    stop_s_m: float
    """Where its stop line is along the road, metres."""
    passed: Time
    """When the front went over it: between two steps of the world."""
    red_for_s: float
    """How long the light had been red then, seconds."""
    speed_mps: float
    """How fast the front went, m/s along the road."""


@dataclass(slots=True)
class FaultInjection(Message):
    """A fault was put on a message."""
    stamp: Time
    """Stamp of the message."""
    stream: str
    """The stream."""
    harm: str
    """What was done: `drop`, `delay`, `jitter`, `freeze`, `noise`, `nan`, `flip_bits`."""
    later_s: float
    """How much later the message came, seconds; 0 for what is not late."""


@dataclass(slots=True)
class ForecastPose(Message):
    """Where something will be at one instant, and how sure that is."""
    at: Time
    """Instant."""
    pose: Pose2
    """Pose of its centre in the map."""
    covariance_m2: tuple[float, float, float]
    """Covariance of the centre in the map: xx, xy, yy, m²."""


@dataclass(slots=True)
class Mode(Message):
    """One way in which something may go on."""
    probability: float
    """Probability of this mode, 0 to 1."""
    path: list[ForecastPose]
    """Poses at increasing instants; the first describes the stamp of the list. Never empty."""


@dataclass(slots=True)
class Forecast(Message):
    """All ways in which one actor may go on."""
    id: ActorId
    """Identity of the track."""
    kind: ActorKind
    """What it is."""
    extent: Extent
    """Size."""
    modes: list[Mode]
    """At least one, with the same instants each; probabilities sum to 1."""


@dataclass(slots=True)
class ForecastList(Message):
    """How everything tracked may go on."""
    stamp: Time
    """Instant of the newest sighting that this builds on."""
    forecasts: list[Forecast]
    """Ordered by identity."""
    joint: bool
    """Whether mode `k` of one actor goes with mode `k` of every other: as many modes each. Probabilities are
    each actor's own all the same, since a bound on what may be touched adds up those of single actors.
    """


@dataclass(slots=True)
class VehicleReport(Message):
    """What the vehicle says of itself."""
    stamp: Time
    """Instant that it describes."""
    speed_mps: float
    """Speed along the heading, m/s; negative in reverse."""
    steering_rad: float
    """Angle of the front road wheels, radians; positive to the left."""
    driver_active: bool
    """Whether the driver steers, brakes or accelerates, or the vehicle is in manual mode."""


@dataclass(slots=True)
class Switch(Message):
    """The switch that a person holds."""
    enable: bool
    """Whether the stack is to drive: its rising edge enables."""
    emergency: bool
    """Whether the car is to be stopped at once."""


@dataclass(slots=True)
class WireAlarm(Message):
    """What is wrong with the wire between a vehicle and who drives it. Said whenever that changes."""
    cause: StopCause | None
    """Why the car is to be stopped; none where all is well, or somebody has let go of the switch since."""
    what: str
    """What happened, in words."""


@dataclass(slots=True)
class Refusals(Message):
    """How often commands were refused, by reason."""
    not_finite: int
    """A number of it is none."""
    out_of_order: int
    """It is older than the one before it."""
    stale: int
    """It is too old."""
    ahead: int
    """It is from the future."""


@dataclass(slots=True)
class GateOutput(Message):
    """What the safety gate lets through to the vehicle."""
    mode: GateMode
    """What the gate does."""
    engaged: bool
    """Whether the vehicle is to follow the command; without it the driver drives."""
    command: MotionCommand
    """Finite, within limits and rates."""
    heartbeat: int
    """Grows by one with each call, and wraps after 65535."""
    refused: Refusal | None
    """Why the command given was refused, if it was."""
    refusals: Refusals
    """How often commands were refused so far."""
    limited: bool
    """Whether the command had to be changed to be within limits or rates."""


@dataclass(slots=True)
class SensorHealth(Message):
    """What a watcher of a camera or lidar says of one image or point cloud."""
    stamp: Time
    """Of the image or cloud."""
    numbers: int
    """How many numbers or points it has."""
    invalid: int
    """How many of them cannot be: not finite, or not as many as there should be."""
    commonest_share: float
    """How much of it is one and the same byte, 0 to 1: nearly all of a blank image."""
    frozen: bool
    """It is the same as the one before, byte for byte."""
    checksum: int
    """Its fingerprint."""


@dataclass(slots=True)
class Image(Message):
    """One image of one camera. Pixels lie row by row from the top left. It owns its memory, to be reused:
    `Image::reset`.
    """
    stamp: Time
    """Middle of the exposure."""
    width_px: int
    """Columns."""
    height_px: int
    """Rows."""
    camera: CameraInfo
    """What the camera was."""
    pixels: Pixels
    """What it saw."""


@dataclass(slots=True)
class CameraInfo(Message):
    """A camera as calibration knows it: what a reader of its images needs to get from pixels to rays."""
    intrinsics: Intrinsics
    """From rays to pixels."""
    ego_from_camera: Transform
    """Where it sits: x right, y down, z forward along the optical axis."""


@dataclass(slots=True)
class Intrinsics(Message):
    """From rays to pixels: a pinhole behind a lens that bends (Brown, 1966). With `x = X / Z`, `y = Y / Z` of
    a point in the camera's frame and `r² = x² + y²`, the lens moves `x` to `x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2
    p1 x y + p2 (r² + 2 x²)`, and `y` to `y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y`; the
    pixel is at `(fx x + cx, fy y + cy)`. The pixel `(column, row)` covers `[column, column + 1) x [row, row +
    1)`: its centre is half a pixel on.
    """
    fx_px: float
    """Focal length across, pixels."""
    fy_px: float
    """Focal length down, pixels."""
    cx_px: float
    """Column of the optical axis."""
    cy_px: float
    """Row of the optical axis."""
    distortion: tuple[float, float, float, float, float]
    """`k1, k2, p1, p2, k3`; all zero for a lens that does not bend."""
    is_parallel: bool
    """Rays are parallel, as those of a map: `x = X`, `y = Y`, and focal lengths are pixels per metre."""


@dataclass(slots=True)
class Lanes(Message):
    """The lines of the ego's lane as a camera sees them."""
    stamp: Time
    """Instant of the image."""
    left: LaneLine | None
    """On the ego's left."""
    right: LaneLine | None
    """On its right."""
    pitch_rad: float
    """By how much further down the camera looked at the road than it is mounted, radians; zero without lines."""


@dataclass(slots=True)
class LaneLine(Message):
    """A line of paint on flat ground: `y = c0 + c1 x + c2 x²` in the ego frame, metres, where it was seen."""
    coefficients: tuple[float, float, float]
    """`c0` (m), `c1`, `c2` (1/m)."""
    covariance: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    """Of these."""
    seen_m: tuple[float, float]
    """`x` of the nearest and of the farthest place at which it was seen, metres."""


@dataclass(slots=True)
class PoseMatch(Message):
    """Place and heading of the ego by what a lidar sees: on a map, or on from its own turns before."""
    stamp: Time
    """Instant that this describes: the end of the turn."""
    at_m: tuple[float, float, float]
    """Ego origin in the map, metres."""
    heading_rad: float
    """Heading, radians."""
    covariance_m2: tuple[float, float, float]
    """Covariance of the place on the ground: xx, xy, yy, m². Along a direction in which nothing was seen it
    is large.
    """
    height_sigma_m: float
    """Standard deviation of the height, metres."""
    heading_sigma_rad: float
    """Standard deviation of the heading, radians."""


@dataclass(slots=True)
class PoseQuality(Message):
    """How good the pose is that localization tells."""
    stamp: Time
    """Instant that this describes."""
    mode: PoseMode
    """Whether it can be driven by."""
    covariance: tuple[float, float, float, float, float, float]
    """Covariance of x (m), y (m) and heading (rad): xx, xy, yy, xh, yh, hh."""


@dataclass(slots=True)
class LocalPose(Message):
    """Pose of the ego for control, in the odometry frame of ROS REP 105, and the transform to the map that
    goes with it. `odom` moves as the car moves, without jumps. A correction by a satellite fix or a scan
    match changes `map_from_odom` alone, at a bounded rate.
    """
    stamp: Time
    """Instant that this describes."""
    odom: Pose2
    """Ego origin in the odometry frame."""
    map_from_odom: Pose2
    """Origin of the odometry frame in the map."""


@dataclass(slots=True)
class Extent(Message):
    """Full size of a box, metres."""
    length_m: float
    """Along its heading."""
    width_m: float
    """Across its heading."""
    height_m: float
    """Upwards."""


@dataclass(slots=True)
class Obstacle(Message):
    """Something seen at one instant."""
    id: ActorId
    """Identity as far as the source knows one (truth: the actor's)."""
    kind: ActorKind
    """What it is."""
    pose: Pose2
    """Pose of the centre of its footprint in the map."""
    extent: Extent
    """Size."""
    velocity_mps: Vector2
    """Velocity over ground in the map frame, m/s."""
    visible_share: float
    """Share of its fixed points that the sensor sees, 0 to 1."""


@dataclass(slots=True)
class ObstacleList(Message):
    """All that a sensor or detector saw at one instant."""
    stamp: Time
    """Instant of the measurement."""
    obstacles: list[Obstacle]
    """Ordered by identity."""


@dataclass(slots=True)
class Sighting(Message):
    """One past position of a track."""
    at: Time
    """Instant of the sighting."""
    point: Point2
    """Position of the centre in the map."""


@dataclass(slots=True)
class Track(Message):
    """One obstacle followed over time."""
    id: ActorId
    """Stable identity."""
    kind: ActorKind
    """What it is."""
    pose: Pose2
    """Present pose of its centre in the map."""
    extent: Extent
    """Size."""
    velocity_mps: Vector2
    """Velocity over ground as reported or estimated, m/s."""
    history: list[Sighting]
    """Past positions, oldest first, the present one last."""


@dataclass(slots=True)
class TrackList(Message):
    """All live tracks."""
    stamp: Time
    """Instant that the tracks describe."""
    tracks: list[Track]
    """Ordered by identity."""


@dataclass(slots=True)
class PredictedPose(Message):
    """Where something will be at one instant."""
    at: Time
    """Instant."""
    pose: Pose2
    """Pose of its centre in the map."""


@dataclass(slots=True)
class Prediction(Message):
    """The expected motion of one obstacle."""
    id: ActorId
    """Identity of the track."""
    kind: ActorKind
    """What it is."""
    extent: Extent
    """Size."""
    probability: float
    """Probability of this path, 0 to 1."""
    path: list[PredictedPose]
    """Poses at increasing instants; the first describes the stamp of the list. Never empty."""


@dataclass(slots=True)
class PredictionList(Message):
    """The expected motion of everything tracked."""
    stamp: Time
    """Instant of the newest sighting that this builds on."""
    predictions: list[Prediction]
    """Ordered by identity."""


@dataclass(slots=True)
class WheelOdometry(Message):
    """What the wheels say of the car's motion since the previous message."""
    stamp: Time
    """End of the time that the speeds are means over."""
    counts: tuple[int, int, int, int]
    """Counts of the encoders since the first message: front left, front right, rear left, rear right."""
    wheel_speeds_radps: tuple[float, float, float, float]
    """Mean speed of each wheel, rad/s; positive forward."""
    speed_mps: float
    """Speed of the ego origin along its heading from them, m/s."""
    yaw_rate_radps: float
    """Yaw rate from them, rad/s; positive to the left."""
    steering_rad: float
    """Angle of the front road wheels as its sensor reads it, radians; positive to the left."""


@dataclass(slots=True)
class Plan(Message):
    """A planned motion of the ego origin."""
    stamp: Time
    """Stamp of the predictions it was made from."""
    status: PlanStatus
    """How it came about."""
    points: list[PlanPoint]
    """Points at increasing instants."""
    work: int
    """What the planner looked at: candidates (FOT), iterations (RRT*), neighbours (Hybrid A*)."""


@dataclass(slots=True)
class PlanPoint(Message):
    """One point of a plan."""
    at: Time
    """Instant at which the ego should be here."""
    pose: Pose2
    """Pose of the ego origin in the map."""
    curvature_1pm: float
    """Curvature of the path, 1/m; positive turns left."""
    speed_mps: float
    """Speed along the path, m/s."""
    accel_mps2: float
    """Acceleration along the path, m/s²."""


@dataclass(slots=True)
class PointCloud(Message):
    """One sweep of a lidar: an array for each quantity, all of one length. Places are in the frame of the
    sensor at the instant at which the point was measured, stamp plus `time_offset_s`: undoing the motion
    during the sweep is the reader's work. It owns its memory, to be reused: `PointCloud::clear`.
    """
    stamp: Time
    """Instant that the time offsets count from."""
    x_m: NDArray[np.float32]
    """Forward, metres."""
    y_m: NDArray[np.float32]
    """To the left, metres."""
    z_m: NDArray[np.float32]
    """Up, metres."""
    intensity: NDArray[np.float32]
    """Strength of the echo, 0 to 1."""
    ring: NDArray[np.uint16]
    """Which beam, from 0 at the lowest."""
    time_offset_s: NDArray[np.float32]
    """When, from the stamp, seconds."""


@dataclass(slots=True)
class RadarScan(Message):
    """All echoes of one scan of a radar."""
    stamp: Time
    """Instant of the scan."""
    detections: list[RadarDetection]
    """Nearest first."""


@dataclass(slots=True)
class RadarDetection(Message):
    """One echo above the threshold, about the sensor's own axes."""
    range_m: float
    """Distance, metres."""
    range_rate_mps: float
    """How fast the distance grows, m/s: positive for what goes away, negative for what comes nearer. It is
    relative to the sensor, so a tree ahead of a moving car has a negative one.
    """
    azimuth_rad: float
    """Angle from the sensor's axis, radians; positive to the left."""
    elevation_rad: float | None
    """Angle above the sensor's level, radians; `None` from a sensor that does not measure it."""
    rcs_dbsm: float
    """Radar cross-section as measured in this scan, decibels over a square metre."""
    snr_db: float
    """Signal over noise, decibels."""


@dataclass(slots=True)
class Supervision(Message):
    """The processes of a run that are gone at the moment. Said whenever one goes or comes back."""
    gone: list[GoneProcess]
    """Those that are gone; while there is one, the ego is brought to a stop."""


@dataclass(slots=True)
class GoneProcess(Message):
    """A process that is gone."""
    process: str
    """Its name in the configuration."""
    why: str
    """How it ended."""


@dataclass(slots=True)
class TrafficLights(Message):
    """The traffic lights in a camera's image."""
    stamp: Time
    """Instant of the image."""
    lights: list[TrafficLight]
    """Those of a map in its order, or what was found from the top of the image to its bottom."""


@dataclass(slots=True)
class TrafficLight(Message):
    """One of them."""
    name: str | None
    """Its name on the map; none without a map."""
    signal: Signal | None
    """What it shows, by this image and those before it; none where that is not known."""
    seen: Signal | None
    """What this image alone shows."""
    score: float
    """How sure that is, 0 to 1; 0 where nothing is seen."""
    distance_m: float
    """From the ego's origin to it over the ground, metres."""
    stop_s_m: float | None
    """Where its stop line is along the route, metres; none without a map."""
    image_px: tuple[float, float, float, float]
    """Left, top, right and bottom edge of its head in the image, pixels."""


@dataclass(slots=True)
class WorldState(Message):
    """The state of the simulated world after one step."""
    stamp: Time
    """Instant of the state."""
    ego: EgoTruth
    """The ego vehicle."""
    actors: list[Actor]
    """All other actors, ordered by identity."""
    collisions: list[Collision]
    """Contacts of the ego that began since the previous step."""
    infractions: list[Infraction]
    """Rules broken since the previous step."""
    ended: EndReason | None = None
    """Set from the step on at which the scenario is over."""


@dataclass(slots=True)
class EgoTruth(Message):
    """The ego vehicle in full."""
    map_from_ego: Transform
    """Pose of the ego frame in the map, in three dimensions."""
    state: EgoState
    """The same, as a perfect localization would report it."""
    velocity_mps: tuple[float, float, float]
    """Velocity of the centre of gravity in the map, m/s."""
    specific_force_mps2: tuple[float, float, float]
    """Specific force at the centre of gravity in the ego frame, m/s²."""
    angular_velocity_radps: tuple[float, float, float]
    """Angular velocity in the ego frame, rad/s."""


@dataclass(slots=True)
class Actor(Message):
    """Another road user or thing."""
    id: ActorId
    """Identity: its place in the scenario file, from 1."""
    kind: ActorKind
    """What it is."""
    pose: Pose2
    """Pose of the centre of its footprint in the map."""
    z_m: float
    """Height of the bottom of its box above the map plane, metres."""
    extent: Extent
    """Size."""
    velocity_mps: Vector2
    """Velocity over ground, m/s."""


@dataclass(slots=True)
class Collision(Message):
    """The ego touched something."""
    stamp: Time
    """Instant of first contact."""
    actor: ActorId
    """What was hit."""
    impulse_n_s: float
    """Impulse of the first contact step, N s."""
    closing_speed_mps: float
    """Speed at which the two closed along the contact normal just before, m/s."""
    ego_speed_mps: float
    """Speed of the ego just before, m/s."""


@dataclass(slots=True)
class Infraction(Message):
    """A rule broken by the ego."""
    stamp: Time
    """Instant at which it began."""
    kind: InfractionKind
    """Which rule."""


@dataclass(slots=True)
class PointInstances(Message):
    """What the points of the `PointCloud` of the same stamp lie on."""
    stamp: Time
    """Stamp of the cloud."""
    instance: NDArray[np.uint32]
    """For each point the identity of the actor, 0 for what is none."""


@dataclass(slots=True)
class RadarSources(Message):
    """Where the echoes of the `RadarScan` of the same stamp come from."""
    stamp: Time
    """Stamp of the scan."""
    sources: list[ActorId | None]
    """For each detection the actor that gave most of the echo; `None` for clutter."""


@dataclass(slots=True)
class Surroundings(Message):
    """What a sensor could see at one instant, and from where: all that an emulated detector is given."""
    stamp: Time
    """Instant of the measurement."""
    ego: Pose2
    """True pose of the ego origin in the map."""
    obstacles: list[Obstacle]
    """The actors of which something is in sight, ordered by identity, in the map."""


__all__ = [
    "Actor",
    "ActorId",
    "ActorKind",
    "CameraInfo",
    "Collision",
    "CollisionEvent",
    "CollisionEvents",
    "Command",
    "DetectedBox",
    "Detections",
    "EgoState",
    "EgoTruth",
    "Encoding",
    "EndReason",
    "Extent",
    "FaultInjection",
    "Forecast",
    "ForecastList",
    "ForecastPose",
    "GateMode",
    "GateOutput",
    "Gnss",
    "GoneProcess",
    "Image",
    "Imu",
    "Infraction",
    "InfractionKind",
    "Intrinsics",
    "LaneInvasion",
    "LaneInvasions",
    "LaneLine",
    "Lanes",
    "LocalPose",
    "Message",
    "Mode",
    "MotionCommand",
    "Obb",
    "Obstacle",
    "ObstacleList",
    "Pixels",
    "Plan",
    "PlanPoint",
    "PlanStatus",
    "Point2",
    "PointCloud",
    "PointInstances",
    "Polyline",
    "Pose2",
    "PoseMatch",
    "PoseMode",
    "PoseQuality",
    "PredictedPose",
    "Prediction",
    "PredictionList",
    "RadarDetection",
    "RadarScan",
    "RadarSources",
    "RedLightEvent",
    "RedLightEvents",
    "Refusal",
    "Refusals",
    "ResponseBudget",
    "RoadLine",
    "RungTaken",
    "SensorHealth",
    "Side",
    "Sighting",
    "Signal",
    "Span",
    "StopCause",
    "Supervision",
    "Surroundings",
    "Switch",
    "Time",
    "Track",
    "TrackList",
    "TrafficLight",
    "TrafficLights",
    "Transform",
    "Vector2",
    "VehicleReport",
    "Verdict",
    "WheelOdometry",
    "WireAlarm",
    "WorldState",
]
