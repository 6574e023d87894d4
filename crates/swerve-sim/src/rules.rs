//! Rules of the road and of the scenario: departure from the road, and the end of the run.

use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Point2};
use swerve_msg::Route;
use swerve_msg::truth::{Actor, EndReason, WorldState};
use swerve_scenario::{Course, End, MapCourse, Scenario, Standstill};

use crate::scripted::REACH_M;

/// Speed below which the ego counts as stationary, m/s.
const STILL_MPS: f64 = 0.05;
/// The rules with their state.
#[derive(Clone, Debug)]
pub(crate) struct Rules {
    end: End,
    end_m: f64,
    s_m: f64,
    /// The map, on which other routes lead to the destination.
    course: Option<Arc<MapCourse>>,
    /// True if the ego is off the ground of the first route.
    off_route: bool,
    off_road: bool,
    first_collision: Option<Time>,
    still_since: Option<Time>,
}

impl Rules {
    pub(crate) fn new(scenario: &Scenario) -> Self {
        Self {
            end: scenario.end,
            end_m: scenario.ego.end_m,
            s_m: scenario.ego.s_m,
            course: match &scenario.road.course {
                Course::Map(course) => Some(Arc::clone(course)),
                Course::Strip(_) => None,
            },
            off_route: false,
            off_road: false,
            first_collision: None,
            still_since: None,
        }
    }

    /// Updates the position of the centre of the ego's outline along the road; called once per step, before the others.
    pub(crate) fn follow(&mut self, route: &Route, center: Point2) {
        self.s_m = route.project_near(center, self.s_m, REACH_M).s_m;
    }

    /// True if the ego leaves the drivable area in this step, after having been on it.
    pub(crate) fn leaves_road(&mut self, route: &Route, outline: &Obb) -> bool {
        let near = |point: Point2| route.project_near(point, self.s_m, REACH_M);
        self.off_route = route.borders().margin_m(outline.corners(), near) < 0.0;
        let is_ground =
            |course: &Arc<MapCourse>| outline.corners().iter().all(|corner| course.is_ground(*corner));
        let off_road = self.off_route && !self.course.as_ref().is_some_and(is_ground);
        let leaves = off_road && !self.off_road;
        self.off_road = off_road;
        leaves
    }

    /// Reason for the end of the run in this state; `None` while it continues.
    pub(crate) fn ended(&mut self, state: &WorldState, center: Point2) -> Option<EndReason> {
        let now = state.stamp;
        if self.first_collision.is_none() {
            self.first_collision = state.collisions_of_ego().next().map(|(_, hit)| hit.stamp);
        }
        let stands = self.stands(state, center);
        let over = |since: Option<Time>, for_s: f64| since.is_some_and(|t| now - t >= Span::from_secs(for_s));
        if over(self.first_collision, self.end.after_collision_s) {
            Some(EndReason::Collision)
        } else if self.is_at_goal(center) {
            Some(EndReason::Goal)
        } else if stands {
            Some(EndReason::Stopped)
        } else if over(Some(Time::ZERO), self.end.timeout_s) {
            Some(EndReason::Timeout)
        } else {
            None
        }
    }

    /// Returns true if the ego has reached the end of the scenario, on the first route or on another one.
    fn is_at_goal(&self, center: Point2) -> bool {
        match &self.course {
            Some(course) if self.off_route => course.is_at_goal(center),
            _ => self.s_m >= self.end_m,
        }
    }

    fn stands(&mut self, state: &WorldState, center: Point2) -> bool {
        let Some(Standstill { near, within_m, for_s }) = self.end.standstill else { return false };
        let is_near = |actor: &Actor| actor.pose.point().distance(center) <= within_m;
        let there = near.is_none_or(|id| state.actor(id).is_some_and(is_near));
        if !there || state.ego.velocity_mps.norm() > STILL_MPS {
            self.still_since = None;
            return false;
        }
        let since = *self.still_since.get_or_insert(state.stamp);
        state.stamp - since >= Span::from_secs(for_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_geom::{FrenetPoint, Pose2};
    use swerve_map::{Border, Borders, Station};

    #[test]
    fn ego_leaves_a_road_that_narrows() {
        let text = include_str!("../../../scenarios/lane.toml");
        let scenario = Scenario::parse("lane.toml", text).unwrap_or_else(|p| panic!("{p:#?}"));
        let stations = [(20.0, 6.0), (30.0, 2.0), (40.0, 2.0), (50.0, 6.0)];
        let left = Border::linear(&stations.map(|(s_m, distance_m)| Station { s_m, distance_m })).unwrap();
        let route = Route::new(scenario.road.line(), Borders::new(left, Border::constant(2.0)));
        let leaves = |d_m: f64| -> Vec<i32> {
            let mut rules = Rules::new(&scenario);
            let at = |s: &i32| {
                let center = route.unproject(FrenetPoint { s_m: f64::from(*s), d_m });
                rules.follow(&route, center);
                rules.leaves_road(&route, &Obb::new(Pose2::new(center.x_m, center.y_m, 0.0), 4.0, 2.0))
            };
            (0..60).filter(at).collect()
        };
        // 2 m to the left, its left side at 3 m: the front is outside from s = 27.5 on, the rear until 42.5.
        assert_eq!(leaves(2.0), [26]);
        assert_eq!(leaves(0.9), [] as [i32; 0]);
    }
}
