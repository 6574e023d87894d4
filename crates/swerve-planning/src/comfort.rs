//! A comfort layer above a planner: uses a plan within the limits of comfort while one is free, otherwise the plan that
//! the inner planner finds within the vehicle's limits.
//!
//! The layer searches Frenet candidates (Werling 2010, as [`crate::fot`]) along the smoothed line, so that curvature
//! changes at a bounded rate, starting where the previous plan places the ego now: successive plans form one motion,
//! and the layer's only memory is the previous plan in the request.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_geom::{angle_between, math};
use swerve_msg::{EgoState, Plan};
use swerve_vehicle::{Limits, Shape};

use crate::collision::{CollisionMode, Obstacles};
use crate::cut_in::with_gaps;
use crate::fot::{self, Fot};
use crate::occlusion;
use crate::request::{Budget, Counted, Planner, Request};
use crate::traffic::without_followers;

mod beside;
mod decision;
mod ends;
mod hidden;
mod meet;
mod scene;
mod steer_out;
mod stop;

#[cfg(test)]
mod drives;

/// Limits of comfort; the vehicle's limits apply as well.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Largest lateral acceleration, m/s². Source: people describe 2 m/s² as firm.
    #[schemars(range(min = 0.1, max = 30.0))]
    pub lateral_accel_max_mps2: f64,
    /// Largest lateral jerk caused by steering, m/s³.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub lateral_jerk_max_mps3: f64,
    /// Largest acceleration, m/s². Source: within nuPlan's 2.4.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub accel_max_mps2: f64,
    /// Largest deceleration, m/s². Source: within nuPlan's 4.05.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub brake_max_mps2: f64,
    /// Distance to keep from obstacles, metres.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_m: f64,
    /// Passing distance from pedestrians and cyclists in the lane if the road is wide enough, metres. Source: 1.5 m in
    /// towns, StVO § 5 and Highway Code rule 163.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub pass_person_m: f64,
    /// Distance at which a moving vehicle is overtaken if the road is wide enough, metres. Source: German courts, § 5
    /// StVO.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub pass_vehicle_m: f64,
    /// Corners of the line are smoothed over this distance before and after each place, metres.
    #[schemars(range(min = 0.0, max = EASE_MAX_M))]
    pub ease_m: f64,
    /// Time gap to a lead vehicle, seconds. Source: ISO 15622 has 1.0 to 2.2.
    #[schemars(range(min = 0.5, max = 10.0))]
    pub time_gap_s: f64,
    /// Gap to a lead vehicle at standstill, metres. Source: Treiber, Hennecke and Helbing 2000.
    #[schemars(range(min = 0.5, max = 50.0))]
    pub standstill_gap_m: f64,
    /// Gap to a standing obstacle that can be passed in the other lane, metres: leaves room to steer out.
    #[schemars(range(min = 0.5, max = 50.0))]
    pub steer_out_gap_m: f64,
    /// The other lane is entered only with at least this time to collision with all road users in it, until the ego is
    /// back, seconds.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub other_lane_ttc_s: f64,
    /// A moving vehicle is overtaken only if it is slower than the target speed by at least this, m/s.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub overtake_gain_mps: f64,
    /// Longest time across the line of the ego's lane to pass something moving, seconds; four times as long for
    /// standing obstacles.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub over_line_max_s: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            lateral_accel_max_mps2: 2.5,
            lateral_jerk_max_mps3: 5.0,
            accel_max_mps2: 2.0,
            brake_max_mps2: 3.5,
            clearance_m: 0.5,
            pass_person_m: 1.5,
            pass_vehicle_m: 1.0,
            ease_m: 4.0,
            time_gap_s: 1.5,
            standstill_gap_m: 2.0,
            steer_out_gap_m: 7.0,
            other_lane_ttc_s: 4.0,
            overtake_gain_mps: 5.0,
            over_line_max_s: 12.0,
        }
    }
}

impl Params {
    /// Checks all ranges.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()
    }

    /// Largest steering rate at a speed, rad/s.
    fn wheels_max_radps(&self, shape: &Shape, speed_mps: f64) -> f64 {
        // Lateral acceleration is v² κ, and the front wheels' angle close to L κ.
        let v = speed_mps.max(SLOW_MPS);
        shape.wheelbase_m * self.lateral_jerk_max_mps3 / (v * v)
    }

    /// The limits of comfort, but never beyond the vehicle's.
    fn within(&self, request: &Request<'_>) -> Limits {
        let vehicle = request.limits;
        let steering_rate_radps = self.wheels_max_radps(request.shape, request.start.speed_mps);
        Limits {
            steering_rate_max_radps: steering_rate_radps.min(vehicle.steering_rate_max_radps),
            lateral_accel_max_mps2: self.lateral_accel_max_mps2.min(vehicle.lateral_accel_max_mps2),
            accel_max_mps2: self.accel_max_mps2.min(vehicle.accel_max_mps2),
            brake_max_mps2: self.brake_max_mps2.min(vehicle.brake_max_mps2),
            ..*vehicle
        }
    }
}

/// Longest smoothing distance to either side, metres: bounds the work.
const EASE_MAX_M: f64 = 50.0;

/// Below this speed the steering rate is limited as at this speed, m/s.
const SLOW_MPS: f64 = 6.0;

/// Style of clearing obstacles: that of the inner planner.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Manner {
    /// Stays on the line: slows, stops and follows, and cuts across nobody's path.
    Waits,
    /// Goes round obstacles on the line.
    GoesRound,
    /// Also keeps away from nearby obstacles, as a Frenet planner with these [`fot::Params`] does.
    KeepsAway {
        /// Weight of nearness.
        weight_obstacle: f64,
        /// Time between the samples of the nearness sum, seconds.
        time_step_s: f64,
    },
}

/// A planner with a comfort layer above it.
pub struct Comfort {
    params: Params,
    manner: Manner,
    gentle: Fot,
    obstacles: Obstacles,
    planner: Box<dyn Planner>,
    occlusion: Option<occlusion::Params>,
    /// Speed that curves and hidden places allow at the last start, m/s; infinite without a rule for hidden places.
    sight_mps: f64,
}

impl Comfort {
    /// Creates a comfort layer above `planner`; `collision` sets the treatment of predictions unless the layer waits.
    pub fn new(
        params: Params,
        collision: CollisionMode,
        manner: Manner,
        planner: Box<dyn Planner>,
    ) -> Result<Self, ParamError> {
        params.validate()?;
        let gentle = Fot::eased(gentle(&params, collision, manner), params.ease_m)?;
        Ok(Self {
            params,
            manner,
            gentle,
            obstacles: Obstacles::default(),
            planner,
            occlusion: None,
            sight_mps: f64::INFINITY,
        })
    }

    /// The layer with a rule for hidden places.
    #[must_use]
    pub fn with_occlusion(self, occlusion: Option<occlusion::Params>) -> Self {
        Self { occlusion, ..self }
    }
}

/// Distance kept from the lane borders, metres.
pub(crate) const LANE_EDGE_M: f64 = 0.05;

/// Spacing of candidate offsets and largest offsets to the left and right, metres.
pub(crate) const LATERAL_STEP_M: f64 = 0.25;
const LEFT_MAX_M: f64 = 4.0;
const RIGHT_MAX_M: f64 = 1.0;

/// Distance from the edge of the road reserved for the swing of the corners, metres.
const EDGE_SWING_M: f64 = 0.12;

/// Obstacles that never come within this distance are ignored, metres.
const OBSTACLES_M: f64 = 100.0;

/// A lateral acceleration above this fraction of the limit is not caused by a comfortable plan.
const SWERVE_SHARE: f64 = 1.1;

impl Planner for Comfort {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let mut counted = Counted::new(budget);
        let Request { route, start, shape, .. } = *request;
        let ego = (route, request.place(), shape);
        let (predictions, follower) = without_followers(request.predictions, ego, start.speed_mps);
        let predictions = with_gaps(predictions, ego, start.speed_mps);
        let request = &Request { predictions: &predictions, ..*request };
        let comfortable = self.comfortable(request, follower, &mut counted);
        let target_speed_mps = request.target_speed_mps.min(self.sight_mps);
        let slower = Request { target_speed_mps, ..*request };
        let plan = comfortable.unwrap_or_else(|| self.planner.plan(&slower, &mut counted));
        Plan { work: counted.spent, ..plan }
    }
}

/// Parameters of the layer's search: later end times and more speeds than in the paper, and far less weight on nearness
/// unless the inner planner uses it.
fn gentle(params: &Params, collision: CollisionMode, manner: Manner) -> fot::Params {
    let round = fot::Params {
        collision,
        obstacle_range_m: OBSTACLES_M,
        clearance_m: params.clearance_m,
        left_m: LEFT_MAX_M,
        lateral_step_m: LATERAL_STEP_M,
        time_step_s: 0.5,
        speed_step_mps: 0.5,
        speed_steps: 1,
        // The target speed is the only one.
        max_speed_mps: SPEED_MAX_MPS,
        horizon_min_s: 3.0,
        horizon_max_s: 7.0,
        slower_speeds: 12,
        weight_obstacle: 2.0,
        ..fot::Params::fast()
    };
    match manner {
        Manner::Waits => {
            fot::Params { collision: CollisionMode::SweptStatic, left_m: 0.0, right_m: 0.0, ..round }
        }
        Manner::GoesRound => round,
        // Nearness is summed over samples: scaled so that a second has the same weight as in the inner planner.
        Manner::KeepsAway { weight_obstacle, time_step_s } => {
            let weight_obstacle = (weight_obstacle * round.time_step_s / time_step_s).min(fot::WEIGHT_MAX);
            fot::Params { weight_obstacle, ..round }
        }
    }
}

/// Upper bound on the speed of any vehicle, m/s.
const SPEED_MAX_MPS: f64 = 150.0;

/// Within these tolerances of its plan in position, speed and heading, the ego continues it from where the plan places
/// it now.
const ON_PLAN_M: f64 = 0.5;
const ON_PLAN_MPS: f64 = 1.0;
const ON_PLAN_RAD: f64 = 0.1;

/// State where the previous plan places the ego at the start instant, otherwise the measured state.
fn taken_up(request: &Request<'_>) -> EgoState {
    let start = request.start;
    let covers =
        |plan: &&Plan| plan.points.first().is_some_and(|p| p.at <= start.stamp) && start.stamp <= plan.end();
    let Some(p) = request.previous.filter(covers).and_then(|plan| plan.at(start.stamp)) else { return start };
    let near = p.pose.point().distance(start.pose.point()) <= ON_PLAN_M
        && (p.speed_mps - start.speed_mps).abs() <= ON_PLAN_MPS
        && angle_between(p.pose.heading_rad, start.pose.heading_rad).abs() <= ON_PLAN_RAD;
    if !near {
        return start;
    }
    let yaw_rate_radps = p.speed_mps * p.curvature_1pm;
    EgoState {
        pose: p.pose,
        speed_mps: p.speed_mps,
        accel_mps2: p.accel_mps2,
        steering_rad: math::atan(request.shape.wheelbase_m * p.curvature_1pm),
        yaw_rate_radps,
        lateral_accel_mps2: p.speed_mps * yaw_rate_radps,
        ..start
    }
}

/// Fractions of the limits used in the line's curves; the rest is reserved for corrections.
const CURVE_SHARE: f64 = 0.8;
const BRAKE_SHARE: f64 = 0.5;

#[cfg(test)]
mod tests {
    use swerve_core::{Span, Time};
    use swerve_geom::{Point2, Pose2};
    use swerve_msg::{PlanPoint, PlanStatus, Prediction};

    use super::*;

    use crate::request::Unlimited;
    use crate::steady_stop::STEP_S;
    use crate::testing::World;

    /// Inner planner that reports that it was called.
    struct Below;

    impl Planner for Below {
        fn plan(&mut self, request: &Request<'_>, _: &mut dyn Budget) -> Plan {
            Plan { stamp: request.stamp, status: PlanStatus::GaveUp, ..Plan::default() }
        }
    }

    fn plan(world: &World, manner: Manner, previous: Option<&Plan>) -> Plan {
        let mut comfort =
            Comfort::new(Params::default(), CollisionMode::TimeIndexed, manner, Box::new(Below)).unwrap();
        comfort.plan(&Request { previous, ..world.request() }, &mut Unlimited::default())
    }

    /// Largest deceleration and lateral acceleration, m/s², and lateral jerk between points, m/s³.
    fn felt(plan: &Plan) -> [f64; 3] {
        let lateral = |p: &PlanPoint| p.curvature_1pm * p.speed_mps * p.speed_mps;
        let brake = plan.points.iter().map(|p| -p.accel_mps2).fold(0.0, f64::max);
        let across = plan.points.iter().map(|p| lateral(p).abs()).fold(0.0, f64::max);
        let jerk = plan.points.windows(2).map(|p| (lateral(&p[1]) - lateral(&p[0])).abs() / STEP_S);
        [brake, across, jerk.fold(0.0, f64::max)]
    }

    fn is_free(world: &World, plan: &Plan, predictions: &[Prediction]) -> bool {
        let obstacles = Obstacles::new(predictions, CollisionMode::TimeIndexed);
        let poses: Vec<(Pose2, Time)> = plan.points.iter().map(|p| (p.pose, p.at)).collect();
        obstacles.path_free(|pose| world.shape.footprint(pose), &poses, 0.4)
    }

    #[test]
    fn comfort_slows_for_a_bend_and_enters_it_gently() {
        // 14 m/s round 60 m would be 3.3 m/s²; the bend begins 40 m ahead.
        let straight = (-20..40).map(|x| Point2::new(f64::from(x), 0.0));
        let bend = (0..150).map(|k| {
            let (sin, cos) = math::sin_cos(f64::from(k) / 60.0);
            Point2::new(40.0 + 60.0 * sin, 60.0 * (1.0 - cos))
        });
        let mut world = World::on(&straight.chain(bend).collect::<Vec<_>>(), 14.0);
        let mut previous: Option<Plan> = None;
        for _ in 0..60 {
            let plan = plan(&world, Manner::GoesRound, previous.as_ref());
            assert_eq!(plan.status, PlanStatus::Comfortable);
            let [brake, across, jerk] = felt(&plan);
            assert!(brake <= 3.5 + 1e-6 && across <= 2.75 && jerk < 7.0, "{brake} {across} {jerk}");
            let next = plan.at(world.start.stamp + Span::from_ms(100)).unwrap();
            world.start =
                EgoState { speed_mps: next.speed_mps, pose: next.pose, stamp: next.at, ..world.start };
            world.start.yaw_rate_radps = next.speed_mps * next.curvature_1pm;
            world.start.accel_mps2 = next.accel_mps2;
            previous = Some(plan);
        }
        assert!(world.start.speed_mps < 12.5, "{}", world.start.speed_mps);
    }

    #[test]
    fn comfort_stops_steadily_before_a_standing_person() {
        // A quartic from 14 m/s over these 35 m would brake with 4.2 m/s².
        let world = World::straight(14.0).with_person((40.0, 0.0), (0.0, 0.0));
        let plan = plan(&world, Manner::Waits, None);
        assert_eq!(plan.status, PlanStatus::Comfortable);
        let [brake, ..] = felt(&plan);
        assert!((3.0..=3.5 + 1e-6).contains(&brake), "{brake}");
        assert!(is_free(&world, &plan, &world.predictions));
        assert!(plan.points.last().unwrap().speed_mps == 0.0);
    }

    #[test]
    fn obstacles_too_near_for_comfort_are_left_to_the_inner_planner() {
        let world = World::straight(14.0).with_person((20.0, 0.0), (0.0, 0.0));
        assert_eq!(plan(&world, Manner::Waits, None).status, PlanStatus::GaveUp);
        // The same applies during a swerve.
        let mut world = World::straight(14.0);
        world.start.yaw_rate_radps = 0.3;
        assert_eq!(plan(&world, Manner::GoesRound, None).status, PlanStatus::GaveUp);
    }

    #[test]
    fn only_manners_that_go_round_leave_the_line() {
        let world = World::straight(8.0).with_person((28.0, -0.3), (0.0, 0.0));
        let farthest = |manner| {
            let plan = plan(&world, manner, None);
            assert!(plan.status == PlanStatus::Comfortable && is_free(&world, &plan, &world.predictions));
            plan.points.iter().map(|p| p.pose.y_m.abs()).fold(0.0, f64::max)
        };
        assert!(farthest(Manner::Waits) < 1e-6);
        assert!(farthest(Manner::GoesRound) > 1.0);
    }

    #[test]
    fn limits_out_of_range_are_named() {
        let params = Params { brake_max_mps2: 0.0, ..Params::default() };
        assert_eq!(params.validate().unwrap_err().key, "brake_max_mps2");
        let params = Params { ease_m: 1e12, ..Params::default() };
        assert_eq!(params.validate().unwrap_err().key, "ease_m");
    }
}
