//! Decisions of an agent, as numbers.

use swerve_core::Span;
use swerve_geom::{Pose2, Vector2, math};
use swerve_msg::{Command, EgoState, Plan, PlanPoint, PlanStatus};
use swerve_stack::Setup;
use swerve_stack::agent::{Agent, Seat, Target};

/// Component replaced by an agent.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Level {
    Command,
    Plan,
    Target,
}

/// Number of points of a plan, and their interval.
const POINTS: usize = 10;
const BETWEEN: Span = Span::from_ms(300);
/// Maximum planned speed, m/s.
const SPEED_MAX_MPS: f64 = 40.0;

impl Level {
    pub(crate) fn named(name: &str) -> Result<Self, String> {
        match name {
            "command" => Ok(Self::Command),
            "plan" => Ok(Self::Plan),
            "target" => Ok(Self::Target),
            other => Err(format!("level: expected command, plan or target, found `{other}`")),
        }
    }

    /// The agent, and the receiver of its decisions.
    pub(crate) fn agent(self) -> (Agent, Wheel) {
        match self {
            Self::Command => {
                let seat = Seat::default();
                (Agent::Command(seat.clone()), Wheel::Command(seat))
            }
            Self::Plan => {
                let seat = Seat::default();
                (Agent::Plan(seat.clone()), Wheel::Plan(seat))
            }
            Self::Target => {
                let seat = Seat::default();
                (Agent::Target(seat.clone()), Wheel::Target(seat))
            }
        }
    }

    /// Minimum, maximum and name of each number of an action.
    pub(crate) fn numbers(self, config: &Setup) -> Vec<(f64, f64, String)> {
        let steering = config.sim.vehicle.limits.steering_max_rad;
        let named = |low, high, name: &str| (low, high, name.to_owned());
        match self {
            Self::Command => vec![
                named(-steering, steering, "steering_rad"),
                named(0.0, 1.0, "throttle"),
                named(0.0, 1.0, "brake"),
            ],
            Self::Target => vec![named(0.0, SPEED_MAX_MPS, "speed_mps"), named(-5.0, 5.0, "offset_m")],
            Self::Plan => (1..=POINTS)
                .flat_map(|i| {
                    let reach_m = SPEED_MAX_MPS * BETWEEN.as_secs() * i as f64;
                    [
                        (-reach_m, reach_m, format!("{i}.forward_m")),
                        (-reach_m, reach_m, format!("{i}.left_m")),
                        (0.0, SPEED_MAX_MPS, format!("{i}.speed_mps")),
                    ]
                })
                .collect(),
        }
    }
}

/// Receiver of an agent's decisions.
pub(crate) enum Wheel {
    Command(Seat<Command>),
    Plan(Seat<Plan>),
    Target(Seat<Target>),
}

impl Wheel {
    /// Passes on an action; plans are relative to `ego`.
    pub(crate) fn take(&self, numbers: &[f64], ego: &EgoState) {
        match self {
            Self::Command(seat) => {
                if let &[steering_rad, throttle, brake] = numbers {
                    seat.set(Command { steering_rad, throttle, brake });
                }
            }
            Self::Target(seat) => {
                if let &[speed_mps, offset_m] = numbers {
                    seat.set(Target { speed_mps, offset_m });
                }
            }
            Self::Plan(seat) => seat.set(plan(numbers, ego)),
        }
    }

    /// Decides to brake to a standstill and to stay there.
    pub(crate) fn stop(&self, ego: &EgoState) {
        match self {
            Self::Command(seat) => seat.set(Command::FULL_BRAKE),
            Self::Target(seat) => seat.set(Target::default()),
            Self::Plan(seat) => seat.set(plan(&[0.0; 3 * POINTS], ego)),
        }
    }
}

/// Plan from the ego's pose through points ahead of it.
fn plan(numbers: &[f64], ego: &EgoState) -> Plan {
    let start = PlanPoint { at: ego.stamp, pose: ego.pose, speed_mps: ego.speed_mps, ..PlanPoint::default() };
    let mut points = vec![start];
    let (forward, left) = (ego.pose.direction(), ego.pose.direction().left());
    for (i, place) in numbers.chunks_exact(3).enumerate() {
        let before = points[i];
        let point = ego.pose.point() + forward * place[0] + left * place[1];
        let way: Vector2 = point - before.pose.point();
        let length = way.norm();
        let heading_rad = if length > 0.05 { math::atan2(way.y, way.x) } else { before.pose.heading_rad };
        let turn = swerve_geom::angle_between(before.pose.heading_rad, heading_rad);
        points.push(PlanPoint {
            at: ego.stamp + BETWEEN * (i as i64 + 1),
            pose: Pose2::new(point.x_m, point.y_m, heading_rad),
            curvature_1pm: if length > 0.05 { turn / length } else { 0.0 },
            speed_mps: place[2],
            accel_mps2: (place[2] - before.speed_mps) / BETWEEN.as_secs(),
        });
    }
    Plan { stamp: ego.stamp, status: PlanStatus::Found, points, work: 0 }
}
