"""The messages on the edges between operators, field by field as the Rust types have them.

Written by `tools/messages.py`: change the Rust types, not this file. SI units and radians; instants and spans
are integer nanoseconds.
"""

from __future__ import annotations

from dataclasses import dataclass, field
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


class DrivingState(str, Enum):
    """State of driving."""
    CRUISE = "cruise"
    """On a free road."""
    FOLLOW = "follow"
    """Behind another vehicle."""
    APPROACH_LIGHT = "approach_light"
    """Towards a traffic light at which it stops."""
    WAIT_AT_LIGHT = "wait_at_light"
    """At rest before a traffic light."""
    GIVE_WAY = "give_way"
    """Towards a place where it gives way."""
    WAIT_FOR_GAP = "wait_for_gap"
    """At rest, until those with priority have passed."""
    CREEP = "creep"
    """Slowly up to the zone of those with priority, after a stop."""
    STOP_SIGN = "stop_sign"
    """Towards a stop sign, or at rest before it."""
    WAIT_FOR_ROOM = "wait_for_room"
    """Before a junction without room beyond it."""
    IN_JUNCTION = "in_junction"
    """In a junction."""
    WAIT_FOR_PEDESTRIAN = "wait_for_pedestrian"
    """Before a crossing that a pedestrian uses."""
    MERGE = "merge"
    """Slower, for a gap in the lane that it changes to."""
    LANE_CHANGE = "lane_change"
    """From one lane of the route to the next."""
    OVERTAKE = "overtake"
    """Over the line of its lane, past something."""
    EMERGENCY_STOP = "emergency_stop"
    """Braking as hard as only an emergency justifies."""


class StopReason(str, Enum):
    """Reasons to stop at a place."""
    TRAFFIC_LIGHT = "traffic_light"
    """A traffic light that is red, or yellow and far enough away."""
    GIVE_WAY = "give_way"
    """Road users with priority."""
    STOP_SIGN = "stop_sign"
    """A stop sign, before which the ego has not stood yet."""
    CROSSING = "crossing"
    """A pedestrian on a crossing, or on the way to it."""
    NO_ROOM = "no_room"
    """No room beyond a junction."""


class RoadLine(str, Enum):
    """A line from the road description."""
    RIGHT_EDGE = "right_edge"
    """Right edge of the drivable ground."""
    LANE_RIGHT = "lane_right"
    """Right border of the ego's lane, with drivable ground beyond."""
    LANE_LEFT = "lane_left"
    """Left border of the ego's lane, with drivable ground beyond."""
    LEFT_EDGE = "left_edge"
    """Left edge of the drivable ground."""


class Side(str, Enum):
    """Side of the ego or of a line."""
    LEFT = "left"
    """Towards +d."""
    RIGHT = "right"
    """Towards -d."""


class Signal(str, Enum):
    """Signal of a traffic light."""
    GREEN = "green"
    """Go."""
    YELLOW = "yellow"
    """Stop if possible."""
    RED = "red"
    """Stop."""
    OFF = "off"
    """Dark or flashing: the light does not apply."""


class StopCause(str, Enum):
    """Cause of a stop."""
    COMMAND_TIMEOUT = "command_timeout"
    """No valid command for too long."""
    REPORT_TIMEOUT = "report_timeout"
    """No valid vehicle report for too long."""
    RELEASED = "released"
    """The enabling switch was released."""
    EMERGENCY = "emergency"
    """The emergency stop."""
    COMMAND_FROZEN = "command_frozen"
    """Commands arrive but have been identical for too long."""
    SECOND_WRITER = "second_writer"
    """Commands arrive from a publisher other than the one that was driving."""
    CLOCK_JUMP = "clock_jump"
    """The clock that stamps the commands was set."""
    TRANSPORT_LOST = "transport_lost"
    """The process that transports commands and reports is gone."""
    POSE_LOST = "pose_lost"
    """Localization reports that the pose is lost."""
    POSE_IMPLAUSIBLE = "pose_implausible"
    """The motion of the pose does not match the wheels."""
    STEERING_DEVIATION = "steering_deviation"
    """The reported steering angle does not follow the commands."""
    ACCEL_DEVIATION = "accel_deviation"
    """The reported speed does not follow the commanded acceleration or braking."""
    SPEED_EXCESS = "speed_excess"
    """The reported speed is above the permitted one."""


class Refusal(str, Enum):
    """Reason for rejecting a command."""
    NOT_FINITE = "not_finite"
    """A value is not finite."""
    OUT_OF_ORDER = "out_of_order"
    """Older than the previous command."""
    STALE = "stale"
    """Too old."""
    AHEAD = "ahead"
    """Stamped in the future."""


class Encoding(str, Enum):
    """Meaning of the values of an image."""
    RGB8 = "rgb8"
    """Red, green, blue, a byte each, sRGB."""
    DEPTH_F32_M = "depth_f32_m"
    """Distance along the optical axis, metres; infinite where the ray hits nothing."""
    CLASS_U8 = "class_u8"
    """Semantic class, Cityscapes ids."""
    INSTANCE_U32 = "instance_u32"
    """Instance: an actor's identity, 0 for anything else. Ground truth, known only to the simulator."""


class PoseMode(str, Enum):
    """Usability of a pose for driving."""
    GOOD = "good"
    """Position measurements arrive and are accepted."""
    COASTING = "coasting"
    """Dead reckoning by inertial measurements and wheel odometry for now."""
    LOST = "lost"
    """Unusable: no pose is reported."""
    NOISY = "noisy"
    """Position measurements are accepted, but their noise is measured to be far above the reported one."""


class ActorKind(str, Enum):
    """Kind of an actor."""
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
    """Any immovable object: walls, poles, boxes."""


class PlanStatus(str, Enum):
    """Origin of a plan."""
    ROUTE = "route"
    """No planning requested: the plan follows the route."""
    FOUND = "found"
    """The planner found this path."""
    KEPT = "kept"
    """No path found: keeps the previous plan, which is still collision-free."""
    BRAKE = "brake"
    """No path found: full braking along the previous path."""
    STOP = "stop"
    """No path found: zero speed along the route."""
    GAVE_UP = "gave_up"
    """No path found: follows the route regardless."""
    COMFORTABLE = "comfortable"
    """The comfortable layer found this path."""
    POSE_UNCERTAIN = "pose_uncertain"
    """Stop, because the pose is too uncertain for the lane."""
    REFUSED = "refused"
    """Full braking in place of a plan that no car can follow (`Plan::is_plausible`)."""


class InfractionKind(str, Enum):
    """Traffic rules that the ego can break."""
    LEFT_ROAD = "left_road"
    """Part of the footprint left the drivable ground."""


class EndReason(str, Enum):
    """Reason for the end of a scenario."""
    GOAL = "goal"
    """The ego reached the end of the scenario."""
    STOPPED = "stopped"
    """The ego stands still where the scenario requires it."""
    COLLISION = "collision"
    """A collision, some time after it happened."""
    TIMEOUT = "timeout"
    """The scenario's time is over."""


class Verdict(str, Enum):
    """Outcome of a run: the first that applies in the order of `docs/conventions.md`."""
    AVOIDED = "avoided"
    """The ego reached the end or the required stop, without a collision and without leaving the road."""
    COMPLETED = "completed"
    """The same, in a scenario without other actors."""
    COLLISION = "collision"
    """The ego hit something, regardless of anything else."""
    LEFT_ROAD = "left_road"
    """Part of the ego left the drivable ground, without a collision."""
    STOPPED = "stopped"
    """The scenario timed out with the ego safely at rest, for one of the reasons in `docs/conventions.md`."""
    TIMEOUT = "timeout"
    """The scenario timed out before the ego reached its end."""
    UNFINISHED = "unfinished"
    """The run ended before the scenario did."""


@dataclass(frozen=True, slots=True)
class GateMode(Tagged):
    """Mode of the safety gate."""
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
class Borders(Message):
    """The borders on both sides of a line."""
    left_m: list[tuple[float, float]]
    """Border to the left of the line: arc length and distance of its stations, metres."""
    right_m: list[tuple[float, float]]
    """Border to the right of the line, positive to the right."""


@dataclass(slots=True)
class Route(Message):
    """Route of the ego, with the borders of the drivable ground. Its line is the centre line of its lanes.
    The borders beside it are those of the drivable ground, neighbouring lanes included.
    """
    line: Polyline
    """Centre line of its lanes."""
    borders: Borders
    """Borders of the drivable ground."""
    lane: Borders | None
    """Borders of its lanes; `None` if all of the ground is one lane."""
    between_lines: Borders | None
    """Borders of the ground without crossing lines that must not be crossed; `None` if that is all of the
    ground.
    """
    stretches: list[Stretch]
    """Lanes in order; empty without a map."""


@dataclass(slots=True)
class Stretch(Message):
    """The part of a route that is on one lane."""
    lane: int
    """The lane."""
    begin_m: float
    """Start of the stretch along the route, metres."""
    speed_limit_mps: float | None
    """Speed limit on it, m/s; `None` if unknown."""
    in_junction: bool
    """True if the lane is inside a junction."""


@dataclass(slots=True)
class Stop(Message):
    """A place on a lane of a map."""
    lane: int
    """The lane."""
    s_m: float
    """Arc length along its centre line in the direction of travel, metres."""


@dataclass(slots=True)
class Command(Message):
    """Actuation command: steering angle and pedals."""
    steering_rad: float
    """Wanted angle of the front road wheels, radians; positive to the left."""
    throttle: float
    """Accelerator pedal, 0 to 1."""
    brake: float
    """Brake pedal, 0 to 1."""


@dataclass(slots=True)
class MotionCommand(Message):
    """Motion command for a vehicle with its own speed or acceleration controller."""
    stamp: Time
    """Instant of the state from which it was computed."""
    steering_rad: float
    """Wanted angle of the front road wheels, radians; positive to the left."""
    speed_mps: float
    """Wanted speed of the ego origin along its heading, m/s; negative in reverse."""
    accel_mps2: float
    """Wanted acceleration along the heading, m/s²."""


@dataclass(slots=True)
class Closures(Message):
    """Places on the map that are reported to be closed to traffic."""
    stamp: Time
    """Instant of the report."""
    places: list[Stop]
    """Places that no route may pass."""


@dataclass(slots=True)
class ResponseBudget(Message):
    """Time budget for the response to a sensor frame, and its division."""
    stamp: Time
    """Stamp of the predictions from which it was computed."""
    left_s: float | None
    """Time until the ego, at its present motion, must begin to brake or swerve, seconds; negative once that
    is over, `None` if nothing is ahead.
    """
    hazard: ActorId | None
    """Actor that determines this time; `None` without one."""
    hidden: bool
    """True if the hazard is a possible actor hidden behind it rather than the hazard itself."""
    obstacles: int
    """Number of nearby obstacles."""
    response: Span
    """Time from the sensor frame to its plan."""
    detector: Span
    """The detector's share of it, for frames to come."""
    planner: Span
    """Time left for the planner, for this frame."""


@dataclass(slots=True)
class RungTaken(Message):
    """Rung of its ladder that an operator selected for a frame."""
    stamp: Time
    """Stamp of the frame."""
    rung: str
    """Name of the rung."""
    run_time: Span
    """Run time of the rung."""
    left: Span | None = None
    """Time left until the deadline at the start of the step; `None` without a deadline."""


@dataclass(slots=True)
class Decision(Message):
    """Decision of the behaviour planner: the ground, speeds and stops within which the motion planner plans.
    Arc lengths are along the line of one route, the message of the router with the sequence number `route`.
    """
    stamp: Time
    """Stamp of the predictions that it is based on."""
    route: int
    """Sequence number of the route."""
    corridor: Borders | None
    """Borders of the ground to use beside the route's line; `None` for the route's ground between lines that
    must not be crossed, which plans leave in an emergency only.
    """
    limits: list[SpeedLimit]
    """Speeds to keep, ordered by arc length."""
    overtake_until_m: float | None
    """Arc length up to which moving road users may be overtaken, metres; `None` without a limit."""
    stops: list[StopPoint]
    """Places to stop at, the nearest first."""
    yields: list[ActorId]
    """Road users to give way to, ordered by identity."""
    waiting: list[ActorId] = field(default_factory=list)
    """Vehicles ahead that wait in a queue before a stop line, ordered by identity: they are not overtaken."""
    expected_to_yield: list[ExpectedStop] = field(default_factory=list)
    """Vehicles that give way to the ego, ordered by identity."""
    state: DrivingState | None = None
    """State of driving; `None` if the planner has no states."""
    because: ActorId | None = None
    """Road user that is the reason for the state."""


@dataclass(slots=True)
class ExpectedStop(Message):
    """A vehicle that gives way to the ego."""
    id: ActorId
    """The vehicle."""
    after_m: float
    """Length of way from its present place after which it stops, metres."""


@dataclass(slots=True)
class SpeedLimit(Message):
    """A speed to keep on a part of a route, up to the next one."""
    from_m: float
    """Start of the part along the route, metres."""
    speed_mps: float
    """Speed, m/s."""


@dataclass(slots=True)
class StopPoint(Message):
    """A place to stop at."""
    s_m: float
    """Arc length before which the front of the ego stops, metres."""
    cause: StopReason
    """Reason."""


@dataclass(slots=True)
class DetectedBox(Message):
    """One detection: an upright box without identity or velocity."""
    kind: ActorKind
    """Estimated class."""
    score: float
    """Confidence of the detector, 0 to 1; not a probability."""
    pose: Pose2
    """Pose of the footprint's centre in the ego frame at the stamp."""
    bottom_m: float
    """Height of the bottom face above the ego's ground plane, metres."""
    extent: Extent
    """Size."""
    image_px: tuple[float, float, float, float] | None = None
    """Left, top, right and bottom edge of the bounding box in the image, clipped to it, pixels; `None`
    without a camera or if outside the image.
    """
    covariance_m2: tuple[float, float, float] | None = None
    """Covariance of the position in the ego frame: xx, xy, yy, m²; `None` if the detector does not estimate
    it.
    """
    radial_speed_mps: float | None = None
    """Speed over ground along the line of sight, m/s, positive if receding; `None` without a radar
    measurement.
    """


@dataclass(slots=True)
class Detections(Message):
    """All detections of a detector at one instant."""
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
    """One measurement of the inertial measurement unit, at its mounting position, in the axes of the ego
    frame.
    """
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
    """Contacts of the ego that began in one world step; usually empty."""
    stamp: Time
    """The step."""
    events: list[CollisionEvent]
    """Ordered by identity."""


@dataclass(slots=True)
class CollisionEvent(Message):
    """Start of a contact of the ego with an actor."""
    actor: ActorId
    """Actor touched."""
    kind: ActorKind
    """Kind of the actor."""
    impulse_n_s: float
    """Impulse of the first step of the contact, N s."""
    closing_speed_mps: float
    """Closing speed along the contact normal just before, m/s."""


@dataclass(slots=True)
class LaneInvasions(Message):
    """Lane lines that the ego began to cross in one world step; usually empty."""
    stamp: Time
    """The step."""
    events: list[LaneInvasion]
    """From the rightmost line to the leftmost."""


@dataclass(slots=True)
class LaneInvasion(Message):
    """Start of a crossing: the ego's outline touched a line or jumped over it."""
    line: RoadLine
    """Line that was crossed."""
    line_d_m: float
    """Lateral offset of the line from the centre of the ego's lane, metres; positive to the left."""
    side: Side
    """Side of the ego that crossed: left if the ego was to the right of the line."""
    s_m: float
    """Position of the outline's centre along the road at that instant, metres."""


@dataclass(slots=True)
class RedLightEvents(Message):
    """Red lights that the ego passed in one world step; usually empty."""
    stamp: Time
    """The step."""
    events: list[RedLightEvent]
    """In the order of the road's lights."""


@dataclass(slots=True)
class RedLightEvent(Message):
    """The ego's front crossed a stop line while its light was red."""
    light: int
    """Index of the light in the road description, from 0."""
    stop_s_m: float
    """Position of the stop line along the road, metres."""
    passed: Time
    """Instant of the crossing, interpolated between two world steps."""
    red_for_s: float
    """Time since the light turned red, seconds."""
    speed_mps: float
    """Speed of the front along the road, m/s."""


@dataclass(slots=True)
class FaultInjection(Message):
    """A fault that was injected into a message."""
    stamp: Time
    """Stamp of the message."""
    stream: str
    """Name of the stream."""
    harm: str
    """Kind of fault: `drop`, `delay`, `jitter`, `freeze`, `noise`, `nan`, `flip_bits`."""
    later_s: float
    """Added delay, seconds; 0 if not delayed."""


@dataclass(slots=True)
class VehicleReport(Message):
    """State that the vehicle reports."""
    stamp: Time
    """Instant of the measurement."""
    speed_mps: float
    """Speed along the heading, m/s; negative in reverse."""
    steering_rad: float
    """Angle of the front road wheels, radians; positive to the left."""
    driver_active: bool
    """True if the driver steers, brakes or accelerates, or the vehicle is in manual mode."""


@dataclass(slots=True)
class Switch(Message):
    """State of the enabling switch, which a person holds."""
    enable: bool
    """True if the stack should drive; a rising edge enables it."""
    emergency: bool
    """True to stop the car at once."""


@dataclass(slots=True)
class WireAlarm(Message):
    """Fault of the link between the vehicle and the process that commands it. Published on every change."""
    cause: StopCause | None
    """Cause for which the car must be stopped; `None` without a fault, or once the switch has been released
    since.
    """
    what: str
    """Description of the fault."""


@dataclass(slots=True)
class Refusals(Message):
    """Number of rejected commands by reason."""
    not_finite: int
    """A value is not finite."""
    out_of_order: int
    """Older than the previous command."""
    stale: int
    """Too old."""
    ahead: int
    """Stamped in the future."""


@dataclass(slots=True)
class GateOutput(Message):
    """Output of the safety gate to the vehicle."""
    mode: GateMode
    """Mode of the gate."""
    engaged: bool
    """True if the vehicle should follow the command; otherwise the driver drives."""
    command: MotionCommand
    """The command: finite, within limits and rates."""
    heartbeat: int
    """Counter that increases by one with each call and wraps after 65535."""
    refused: Refusal | None
    """Reason for rejecting the input command; `None` if it was accepted."""
    refusals: Refusals
    """Number of rejected commands so far."""
    limited: bool
    """True if the command was limited in value or rate."""


@dataclass(slots=True)
class SensorHealth(Message):
    """Result of monitoring one image or point cloud."""
    stamp: Time
    """Stamp of the image or cloud."""
    numbers: int
    """Number of pixel values or points."""
    invalid: int
    """Number of invalid values: non-finite points, plus one if an array has the wrong length."""
    commonest_share: float
    """Share of the most frequent byte value, 0 to 1; close to 1 for a blank image."""
    frozen: bool
    """True if identical to the previous one, byte for byte."""
    checksum: int
    """Digest of the data."""


@dataclass(slots=True)
class Image(Message):
    """One image of one camera. Pixels are stored row by row from the top left. The image owns its memory,
    which `Image::reset` reuses.
    """
    stamp: Time
    """Middle of the exposure."""
    width_px: int
    """Columns."""
    height_px: int
    """Rows."""
    camera: CameraInfo
    """Calibration of the camera."""
    pixels: Pixels
    """Pixel data."""


@dataclass(slots=True)
class CameraInfo(Message):
    """Calibration of a camera: projection and mounting pose."""
    intrinsics: Intrinsics
    """Projection from rays to pixels."""
    ego_from_camera: Transform
    """Mounting pose; camera axes are x right, y down, z forward along the optical axis."""


@dataclass(slots=True)
class Intrinsics(Message):
    """Pinhole projection with lens distortion (Brown, 1966). With `x = X / Z`, `y = Y / Z` of a point in the
    camera's frame and `r² = x² + y²`, the lens moves `x` to `x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2
    (r² + 2 x²)`, and `y` to `y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y`; the pixel is at `(fx
    x + cx, fy y + cy)`. Pixel `(column, row)` covers `[column, column + 1) x [row, row + 1)`, so its centre
    is at `(column + 0.5, row + 0.5)`.
    """
    fx_px: float
    """Horizontal focal length, pixels."""
    fy_px: float
    """Vertical focal length, pixels."""
    cx_px: float
    """Column of the optical axis, pixels."""
    cy_px: float
    """Row of the optical axis, pixels."""
    distortion: tuple[float, float, float, float, float]
    """`k1, k2, p1, p2, k3`; all zero without distortion."""
    is_parallel: bool
    """True for an orthographic projection: `x = X`, `y = Y`, and focal lengths in pixels per metre."""


@dataclass(slots=True)
class Lanes(Message):
    """Lines of the ego's lane as detected by a camera."""
    stamp: Time
    """Instant of the image."""
    left: LaneLine | None
    """Line to the left of the ego."""
    right: LaneLine | None
    """Line to the right of the ego."""
    pitch_rad: float
    """Pitch of the camera relative to its mounting, radians; positive downwards, zero without lines."""


@dataclass(slots=True)
class LaneLine(Message):
    """A painted line on flat ground: `y = c0 + c1 x + c2 x²` in the ego frame, metres, within `seen_m`."""
    coefficients: tuple[float, float, float]
    """`c0` (m), `c1`, `c2` (1/m)."""
    covariance: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    """Covariance of the coefficients."""
    seen_m: tuple[float, float]
    """`x` of the nearest and farthest detected point, metres."""


@dataclass(slots=True)
class PoseMatch(Message):
    """Position and heading of the ego by lidar scan matching: against a map, or against its previous turns."""
    stamp: Time
    """Instant of the pose: the end of the turn."""
    at_m: tuple[float, float, float]
    """Ego origin in the map, metres."""
    heading_rad: float
    """Heading, radians."""
    covariance_m2: tuple[float, float, float]
    """Covariance of the horizontal position: xx, xy, yy, m². Large along directions that the scan does not
    constrain.
    """
    height_sigma_m: float
    """Standard deviation of the height, metres."""
    heading_sigma_rad: float
    """Standard deviation of the heading, radians."""


@dataclass(slots=True)
class PoseQuality(Message):
    """Quality of the pose that localization reports."""
    stamp: Time
    """Instant of the pose."""
    mode: PoseMode
    """Usability of the pose for driving."""
    covariance: tuple[float, float, float, float, float, float]
    """Covariance of x (m), y (m) and heading (rad): xx, xy, yy, xh, yh, hh."""


@dataclass(slots=True)
class LocalPose(Message):
    """Pose of the ego for control in the odometry frame of ROS REP 105, with the transform to the map. `odom`
    is continuous and follows the motion of the car. Corrections by satellite fixes or scan matches change
    only `map_from_odom`, at a bounded rate.
    """
    stamp: Time
    """Instant of the pose."""
    odom: Pose2
    """Ego origin in the odometry frame."""
    map_from_odom: Pose2
    """Origin of the odometry frame in the map."""


@dataclass(slots=True)
class Extent(Message):
    """Full dimensions of a box, metres."""
    length_m: float
    """Along the heading."""
    width_m: float
    """Across the heading."""
    height_m: float
    """Vertical."""


@dataclass(slots=True)
class Obstacle(Message):
    """An obstacle detected at one instant."""
    id: ActorId
    """Identity if the source knows one (ground truth: the actor's)."""
    kind: ActorKind
    """Kind of the obstacle."""
    pose: Pose2
    """Pose of the footprint's centre in the map."""
    extent: Extent
    """Size."""
    velocity_mps: Vector2
    """Velocity over ground in the map frame, m/s."""
    visible_share: float
    """Share of its sample points that are visible to the sensor, 0 to 1."""


@dataclass(slots=True)
class ObstacleList(Message):
    """All obstacles of a sensor or detector at one instant."""
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
    """An obstacle tracked over time."""
    id: ActorId
    """Stable identity."""
    kind: ActorKind
    """Kind of the obstacle."""
    pose: Pose2
    """Present pose of the centre in the map."""
    extent: Extent
    """Size."""
    velocity_mps: Vector2
    """Reported or estimated velocity over ground, m/s."""
    history: list[Sighting]
    """Past positions, oldest first; the last is the present one."""


@dataclass(slots=True)
class TrackList(Message):
    """All live tracks."""
    stamp: Time
    """Instant that the tracks describe."""
    tracks: list[Track]
    """Ordered by identity."""


@dataclass(slots=True)
class PredictedPose(Message):
    """Predicted pose at one instant."""
    at: Time
    """Instant."""
    pose: Pose2
    """Pose of the centre in the map."""


@dataclass(slots=True)
class Prediction(Message):
    """One possible future motion (mode) of a road user. All modes of a road user are adjacent in the list."""
    id: ActorId
    """Identity of the track."""
    kind: ActorKind
    """Kind of the obstacle."""
    extent: Extent
    """Size."""
    probability: float
    """Probability of this path, 0 to 1. Those of all modes of a road user sum to 1."""
    path: list[PredictedPose]
    """Poses at increasing instants; the first describes the stamp of the list. Never empty."""
    covariances_m2: list[tuple[float, float, float]] = field(default_factory=list)
    """Covariance of the centre in the map at each pose of the path: xx, xy, yy, m². Empty if the uncertainty
    is unknown.
    """


@dataclass(slots=True)
class PredictionList(Message):
    """Predicted motion of all tracks."""
    stamp: Time
    """Instant of the newest sighting used."""
    predictions: list[Prediction]
    """Ordered by identity."""
    joint: bool = False
    """True if the modes are known to be joint: mode `k` of one road user occurs with mode `k` of all others,
    and all have equally many modes. Probabilities remain those of each road user, since a bound on the
    collision probability sums over them.
    """


@dataclass(slots=True)
class WheelOdometry(Message):
    """Motion of the car since the previous message, measured by the wheels."""
    stamp: Time
    """End of the interval over which the speeds are averaged."""
    counts: tuple[int, int, int, int]
    """Encoder counts since the first message: front left, front right, rear left, rear right."""
    wheel_speeds_radps: tuple[float, float, float, float]
    """Mean speed of each wheel, rad/s; positive forward."""
    speed_mps: float
    """Speed of the ego origin along its heading, from the wheels, m/s."""
    yaw_rate_radps: float
    """Yaw rate from the wheels, rad/s; positive to the left."""
    steering_rad: float
    """Measured angle of the front road wheels, radians; positive to the left."""


@dataclass(slots=True)
class Plan(Message):
    """Planned motion of the ego origin."""
    stamp: Time
    """Stamp of the predictions from which it was made."""
    status: PlanStatus
    """Origin of the plan."""
    points: list[PlanPoint]
    """Points at increasing instants."""
    work: int
    """Work of the planner: candidates (FOT), iterations (RRT*), expanded neighbours (Hybrid A*)."""


@dataclass(slots=True)
class PlanPoint(Message):
    """One point of a plan."""
    at: Time
    """Instant of the point."""
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
    """One sweep of a lidar as a structure of arrays of equal length. Positions are in the sensor frame at the
    instant of each point's measurement, stamp plus `time_offset_s`; consumers compensate the motion during
    the sweep. The cloud owns its memory, which `PointCloud::clear` keeps for reuse.
    """
    stamp: Time
    """Reference instant of the time offsets."""
    x_m: NDArray[np.float32]
    """Forward, metres."""
    y_m: NDArray[np.float32]
    """To the left, metres."""
    z_m: NDArray[np.float32]
    """Up, metres."""
    intensity: NDArray[np.float32]
    """Intensity of the return, 0 to 1."""
    ring: NDArray[np.uint16]
    """Index of the beam, from 0 at the lowest."""
    time_offset_s: NDArray[np.float32]
    """Time of measurement relative to the stamp, seconds."""


@dataclass(slots=True)
class RadarScan(Message):
    """All detections of one radar scan."""
    stamp: Time
    """Instant of the scan."""
    detections: list[RadarDetection]
    """Nearest first."""


@dataclass(slots=True)
class RadarDetection(Message):
    """One detection above the threshold, in the axes of the sensor."""
    range_m: float
    """Distance, metres."""
    range_rate_mps: float
    """Range rate, m/s: positive if receding, negative if approaching. Relative to the sensor, so a tree ahead
    of a moving car has a negative range rate.
    """
    azimuth_rad: float
    """Azimuth from the sensor's axis, radians; positive to the left."""
    elevation_rad: float | None
    """Elevation above the sensor's horizontal plane, radians; `None` if the sensor does not measure it."""
    rcs_dbsm: float
    """Radar cross-section measured in this scan, dBsm."""
    snr_db: float
    """Signal-to-noise ratio, dB."""


@dataclass(slots=True)
class Supervision(Message):
    """Processes of a run that are currently gone. Published on every change."""
    gone: list[GoneProcess]
    """Processes that are gone; while there are any, the ego is brought to a stop."""


@dataclass(slots=True)
class GoneProcess(Message):
    """A process that is gone."""
    process: str
    """Name in the configuration."""
    why: str
    """Cause of its end."""


@dataclass(slots=True)
class TrafficLights(Message):
    """Traffic lights in one camera image."""
    stamp: Time
    """Instant of the image."""
    lights: list[TrafficLight]
    """In map order; without a map, from the top of the image to the bottom."""


@dataclass(slots=True)
class TrafficLight(Message):
    """One traffic light."""
    name: str | None
    """Name on the map; `None` without a map."""
    signal: Signal | None
    """Signal, filtered over this and previous images; `None` if unknown."""
    seen: Signal | None
    """Signal in this image alone."""
    score: float
    """Confidence of `seen`, 0 to 1; 0 if nothing was seen."""
    distance_m: float
    """Horizontal distance from the ego origin, metres."""
    stop_s_m: float | None
    """Position of its stop line along the newest route, metres; `None` without a map, or for other traffic."""
    image_px: tuple[float, float, float, float]
    """Left, top, right and bottom edge of the light's head in the image, pixels."""


@dataclass(slots=True)
class WorldState(Message):
    """The state of the simulated world after one step."""
    stamp: Time
    """Instant of the state."""
    ego: EgoTruth
    """The ego vehicle."""
    actors: list[Actor]
    """All other actors, ordered by identity; in a world with several egos, the other egos too."""
    collisions: list[Collision]
    """Contacts that began since the previous step, of the ego and between others. Contacts that exist at the
    start of a run are none.
    """
    infractions: list[Infraction]
    """Rules broken since the previous step."""
    ended: EndReason | None = None
    """Reason why the scenario is over, from the step on at which it is."""


@dataclass(slots=True)
class EgoTruth(Message):
    """Full state of the ego vehicle."""
    id: ActorId
    """Identity in the run: `ActorId::EGO` in a world with one ego."""
    map_from_ego: Transform
    """Pose of the ego frame in the map, three-dimensional."""
    state: EgoState
    """The same state as a perfect localization would report it."""
    velocity_mps: tuple[float, float, float]
    """Velocity of the centre of gravity in the map, m/s."""
    specific_force_mps2: tuple[float, float, float]
    """Specific force at the centre of gravity in the ego frame, m/s²."""
    angular_velocity_radps: tuple[float, float, float]
    """Angular velocity in the ego frame, rad/s."""


@dataclass(slots=True)
class Actor(Message):
    """Another road user or an object."""
    id: ActorId
    """Identity in the run."""
    kind: ActorKind
    """Kind of the actor."""
    pose: Pose2
    """Pose of the footprint's centre in the map."""
    z_m: float
    """Height of the bottom of its box above the map plane, metres."""
    extent: Extent
    """Size."""
    velocity_mps: Vector2
    """Velocity over ground, m/s."""


@dataclass(slots=True)
class Collision(Message):
    """A collision of two bodies."""
    stamp: Time
    """Instant of first contact."""
    parties: tuple[ActorId, ActorId]
    """The two parties: the ego first if it is one of them, else in order of identity."""
    impulse_n_s: float
    """Impulse of the first contact step, N s; zero if physics moves neither of the two."""
    closing_speed_mps: float
    """Closing speed along the contact normal just before, m/s."""
    speeds_mps: tuple[float, float]
    """Speeds of the two parties over ground just before, m/s."""


@dataclass(slots=True)
class Infraction(Message):
    """A traffic rule broken by the ego."""
    stamp: Time
    """Instant at which the infraction began."""
    kind: InfractionKind
    """Rule that was broken."""


@dataclass(slots=True)
class PointInstances(Message):
    """Actor hit by each point of the `PointCloud` of the same stamp."""
    stamp: Time
    """Stamp of the cloud."""
    instance: NDArray[np.uint32]
    """Identity of the actor for each point, 0 for anything else."""


@dataclass(slots=True)
class RadarSources(Message):
    """Sources of the detections of the `RadarScan` of the same stamp."""
    stamp: Time
    """Stamp of the scan."""
    sources: list[ActorId | None]
    """For each detection the actor with the largest share of the return; `None` for clutter."""


@dataclass(slots=True)
class Surroundings(Message):
    """Everything visible to a sensor at one instant, and its pose: the whole input of an emulated detector."""
    stamp: Time
    """Instant of the measurement."""
    ego: Pose2
    """True pose of the ego origin in the map."""
    obstacles: list[Obstacle]
    """Visible actors, ordered by identity, in the map."""


__all__ = [
    "Actor",
    "ActorId",
    "ActorKind",
    "Borders",
    "CameraInfo",
    "Closures",
    "Collision",
    "CollisionEvent",
    "CollisionEvents",
    "Command",
    "Decision",
    "DetectedBox",
    "Detections",
    "DrivingState",
    "EgoState",
    "EgoTruth",
    "Encoding",
    "EndReason",
    "ExpectedStop",
    "Extent",
    "FaultInjection",
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
    "Route",
    "RungTaken",
    "SensorHealth",
    "Side",
    "Sighting",
    "Signal",
    "Span",
    "SpeedLimit",
    "Stop",
    "StopCause",
    "StopPoint",
    "StopReason",
    "Stretch",
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
