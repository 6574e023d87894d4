//! Rules of the originals, each a key that can be switched: the behaviour of Pylot at two moments of its history.
//!
//! Sources are files of github.com/erdos-project: `pylot` at c0454eb (2020-05-03) and at be7bf9c (2020-11-11, v0.3.1),
//! `rrt_star_planner` at b171364, `hybrid_astar_planner` at c4ba029, `frenet_optimal_trajectory_planner` at 52b0705.

use core::f64::consts::{PI, TAU};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, Ranges, require};

/// A moment of Pylot's history.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Era {
    /// May 2020, the last month in which the mode used for Table I could run. Source: `pylot` c0454eb; 019418a
    /// (2020-06-08) breaks `planning_pose_synchronizer_operator.py`.
    #[default]
    #[serde(rename = "pylot_2020_05")]
    May2020,
    /// November 2020, when the paper was submitted. Source: `pylot` be7bf9c.
    #[serde(rename = "pylot_2020_11")]
    November2020,
}

/// Original planner: some rules, ranges and gains apply to one planner only.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Original {
    /// Frenet optimal trajectories.
    Fot,
    /// RRT*.
    RrtStar,
    /// Hybrid A*.
    HybridAstar,
    /// Any other planner: only the rules of following apply.
    Other,
}

/// Plan to drive if a search finds no path.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fallback {
    /// Speed zero along the rest of the last plan. Source: `pylot` c0454eb,
    /// `planning/rrt_star/rrt_star_planning_operator.py:175-192`,
    /// `planning/frenet_optimal_trajectory/fot_planning_operator.py:256-290`.
    StopOnLastPlan,
    /// Speed zero along the route. Source: `pylot` be7bf9c, `planning/rrt_star/rrt_star_planner.py:69-71`,
    /// `planning/frenet_optimal_trajectory/fot_planner.py:103-107`.
    StopOnRoute,
    /// The route at the target speed, regardless of obstacles: in no version of Pylot.
    FollowRoute,
}

/// Point of a plan used as steering target.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Waypoint {
    /// Number `2 * int(v / 3)`, counted from the plan's first point, of which at most one is dropped as passed.
    /// Source: `pylot` c0454eb, `control/pid_agent_operator.py:79-83`, `planning/utils.py:26-70`.
    Number,
    /// The first point after the nearest one that is at least 5 m away. Source: `pylot` be7bf9c,
    /// `planning/waypoints.py:112-131`.
    Distance,
}

/// Law from target speed to throttle and brake.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SpeedLaw {
    /// Proportional to the error, as until May 2020: with `u` as 0.25 per m/s of excess speed, the throttle is
    /// `default_throttle - 1.3 u`, at most 0.75, and the brake is `0.35 u` if `u` is above 0.5. Source: `pylot`
    /// c0454eb, `control/utils.py`; `pid_controller` 0.2, whose integral keeps only the current step. No era uses it by
    /// default, because its throttle at the target speed is not known for certain.
    Proportional,
    /// A PID on km/h that saturates one pedal or the other. Source: `pylot` be7bf9c, `control/pid.py`,
    /// `control/utils.py`.
    Pid,
}

/// Rules of planning and following. [`Rules::of`] returns those of an era; each can be switched separately.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    /// Count an obstacle's predicted places only if they are in range themselves; off, all of them count once one is in
    /// range. Source: `pylot` be7bf9c, `planning/world.py:102-125`; c0454eb, `planning/planning_operator.py:121-180`.
    pub range_per_place: bool,
    /// Treat everything to the left (+y) of a box as solid: the test for a point inside a box compares its x with the
    /// box's y, which always holds in Town01. Source: `rrt_star_planner` `obstacle.cpp:61-65`, `hybrid_astar_planner`
    /// `Obstacle.cpp:64-68`. For roads along +x.
    pub solid_left: bool,
    /// Plan to drive if a search finds no path.
    pub fallback: Fallback,
    /// Heading of a road along +x in the simulator's left-handed frame, radians: motions are scanned around the
    /// absolute heading, so that the possible turns depend on the direction of north. Source: `hybrid_astar_planner`
    /// `HybridAStar.cpp:25-48`; the road of Town01 runs along -x.
    #[schemars(range(min = -TAU, max = TAU))]
    pub heading_of_road_rad: f64,
    /// Let Hybrid A* return the path to the nearest pose from which a Dubins path to the goal is free; off, it has to
    /// arrive. Source: `hybrid_astar_planner` `HybridAStar.cpp:105-118,170`.
    pub nearest_free: bool,
    /// Let RRT* reroute nodes through newer ones if that is shorter: the original compares each cost with itself plus a
    /// further term, so it never does. Source: `rrt_star_planner` `RRTStarWrapper.cpp:55-77`.
    pub rewiring: bool,
    /// Plan and steer for the centre of the car; off, the centre of the rear axle. Source: `pylot` be7bf9c,
    /// `planning/rrt_star/rrt_star_planner.py:85-89`, `control/pid_control_operator.py:77-88`.
    pub middle_of_car: bool,
    /// Represent the route by waypoints a metre apart, counted from its start, the first being the one nearest to the
    /// planned point: goals, the path along the route and FOT's end are such points; off, they are measured in metres
    /// from the planned point itself. Source: `pylot` be7bf9c, `planning/flags.py`, `planning/waypoints.py`.
    pub whole_metres: bool,
    /// End FOT's candidates where the route's 30 waypoints end. Source: `frenet_optimal_trajectory_planner`
    /// `CubicSpline1D.cpp:44`, `FrenetPath.cpp:17-19`.
    pub cut_at_route_end: bool,
    /// Use FOT's samples as the points of its plan; off, points are at most 0.1 s apart. Source:
    /// `frenet_optimal_trajectory_planner` `fot_wrapper.cpp`.
    pub sparse_points: bool,
    /// Let FOT check only the borders of car and boxes, at its samples, if a corner is within 6 m; off, the check is
    /// complete. Source: `frenet_optimal_trajectory_planner` `FrenetPath.cpp:89-140`.
    pub borders_only: bool,
    /// Point of a plan used as steering target.
    pub waypoint: Waypoint,
    /// Normalised steer per radian of the angle to the steering target. Source: `pylot` be7bf9c, `control/flags.py`
    /// (0.7) and the configurations of the experiment, which set 1.0 for all but RRT*.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub steer_gain: f64,
    /// Law from target speed to throttle and brake.
    pub speed: SpeedLaw,
    /// Throttle at the target speed under the proportional law, 0 to 1. Source: `pylot`, `default_throttle` in
    /// `control/flags.py` before May 2020 (0.0); readings of c0454eb have 0.5.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub default_throttle: f64,
    /// Half the side of the box used for a pedestrian if all predicted places count at once, metres; when absent, the
    /// predicted size. No era sets it: `pylot` takes the simulator's own boxes, and those of its walkers are in no
    /// public file. About 0.19 is assumed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub person_half_m: Option<f64>,
}

impl Rules {
    /// The rules of an era for one of its planners.
    pub fn of(era: Era, original: Original) -> Self {
        let fot = original == Original::Fot;
        let (fallback, waypoint) = match era {
            Era::May2020 => (Fallback::StopOnLastPlan, Waypoint::Number),
            Era::November2020 => (Fallback::StopOnRoute, Waypoint::Distance),
        };
        Self {
            range_per_place: true,
            solid_left: !fot,
            fallback,
            heading_of_road_rad: PI,
            nearest_free: true,
            rewiring: false,
            middle_of_car: true,
            whole_metres: true,
            cut_at_route_end: true,
            sparse_points: true,
            borders_only: true,
            waypoint,
            steer_gain: if original == Original::RrtStar { 0.7 } else { 1.0 },
            speed: SpeedLaw::Pid,
            default_throttle: 0.0,
            person_half_m: None,
        }
    }

    /// Checks ranges, and that no rule excludes another.
    ///
    /// # Errors
    /// The first invalid rule.
    pub fn validate(&self, original: Original) -> Result<(), ParamError> {
        self.check_ranges()?;
        let borders = original == Original::Fot && self.borders_only;
        let solid = self.solid_left.to_string();
        require("solid_left", solid, !(borders && self.solid_left), "false: `borders_only` excludes it")
    }
}

impl Era {
    /// Range beyond which obstacles are ignored, metres. Source: `pylot` c0454eb, `planning/flags.py:10` (FOT) and the
    /// configurations of the experiment; be7bf9c, `perception/flags.py:19`, `configs/scenarios/`.
    pub fn range_m(self, original: Original) -> f64 {
        match (original, self) {
            (Original::RrtStar, _) | (Original::HybridAstar, Self::May2020) => 10.0,
            (Original::HybridAstar, Self::November2020) => 70.0,
            (Original::Fot | Original::Other, _) => 30.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eras_differ_in_fallback_and_steering_target() {
        let [may, november] = [Era::May2020, Era::November2020].map(|era| Rules::of(era, Original::RrtStar));
        let as_may = Rules { fallback: may.fallback, waypoint: may.waypoint, ..november };
        assert_eq!(as_may, may);
        assert_ne!((may.fallback, may.waypoint), (november.fallback, november.waypoint));
        for original in [Original::Fot, Original::RrtStar, Original::HybridAstar, Original::Other] {
            assert_eq!(Rules::of(Era::May2020, original).validate(original), Ok(()));
        }
    }

    #[test]
    fn invalid_rules_are_named() {
        let fot = Rules::of(Era::May2020, Original::Fot);
        let wrong = |rules: Rules| rules.validate(Original::Fot).unwrap_err().to_string();
        assert_eq!(
            wrong(Rules { solid_left: true, ..fot }),
            "`solid_left` is true, expected false: `borders_only` excludes it"
        );
        assert_eq!(
            wrong(Rules { heading_of_road_rad: f64::NAN, ..fot }),
            "`heading_of_road_rad` is NaN, expected -6.283185307179586 to 6.283185307179586"
        );
        assert_eq!(Rules { solid_left: true, borders_only: false, ..fot }.validate(Original::Fot), Ok(()));
    }
}
