//! Place of a car relative to the route that it has to follow.

use core::fmt;

use swerve_geom::{Map, Pose2, angle_between};
use swerve_msg::Route;

/// Largest angle between a car and its route at which the stack takes over, degrees.
const ACROSS_DEG: f64 = 60.0;

/// Reason in a car's pose for not taking it over.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Misplaced {
    /// Its origin is beside the drivable ground.
    Beside {
        /// Distance from the border of the ground, metres.
        outside_m: f64,
        /// Distance from the route, metres; positive to the left.
        d_m: f64,
    },
    /// It heads across the route, or against it.
    Across {
        /// Angle between car and route, degrees; 0 to 180.
        angle_deg: f64,
    },
}

impl fmt::Display for Misplaced {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Beside { outside_m, d_m } => {
                let side = if d_m > 0.0 { "left" } else { "right" };
                let d_m = d_m.abs();
                write!(
                    f,
                    "the car is {d_m:.1} m to the {side} of its route, {outside_m:.1} m beside the drivable ground"
                )
            }
            Self::Across { angle_deg } => {
                write!(f, "the car heads {angle_deg:.0} degrees off its route, more than {ACROSS_DEG:.0}")
            }
        }
    }
}

impl Misplaced {
    /// Reason not to take over a car at this pose (centre of the rear axle, in the map) on `route`, if there is one.
    pub fn of(route: &Route, pose: Pose2<Map>) -> Option<Self> {
        let place = route.line().project_pose(pose);
        let outside_m = (place.d_m - route.left_m(place.s_m)).max(-place.d_m - route.right_m(place.s_m));
        if outside_m > 0.0 {
            return Some(Self::Beside { outside_m, d_m: place.d_m });
        }
        let along_rad = route.line().at(place.s_m).pose.heading_rad;
        let angle_deg = angle_between(along_rad, pose.heading_rad).abs().to_degrees();
        (angle_deg > ACROSS_DEG).then_some(Self::Across { angle_deg })
    }
}

#[cfg(test)]
mod tests {
    use swerve_geom::{Point2, Polyline};

    use super::*;

    fn route() -> Route {
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(100.0, 0.0)]).unwrap();
        Route::uniform(line, 5.25, 1.75)
    }

    fn words(x_m: f64, y_m: f64, heading_deg: f64) -> Option<String> {
        let pose = Pose2::new(x_m, y_m, heading_deg.to_radians());
        Misplaced::of(&route(), pose).map(|reason| reason.to_string())
    }

    #[test]
    fn pose_on_the_ground_along_the_route_is_accepted() {
        for (x_m, y_m, heading_deg) in
            [(5.0, 0.0, 0.0), (50.0, 5.2, 59.0), (50.0, -1.7, -59.0), (-3.0, 0.0, 0.0)]
        {
            assert_eq!(words(x_m, y_m, heading_deg), None);
        }
    }

    #[test]
    fn reason_has_distance_or_angle() {
        let left = "the car is 12.0 m to the left of its route, 6.8 m beside the drivable ground";
        assert_eq!(words(5.0, 12.0, 0.0).unwrap(), left);
        let right = "the car is 2.0 m to the right of its route, 0.2 m beside the drivable ground";
        assert_eq!(words(50.0, -2.0, 0.0).unwrap(), right);
        let across = "the car heads 90 degrees off its route, more than 60";
        assert_eq!(
            (words(50.0, 0.0, 90.0).as_deref(), words(50.0, 0.0, -90.0).as_deref()),
            (Some(across), Some(across))
        );
        assert_eq!(words(50.0, 0.0, 180.0).unwrap(), "the car heads 180 degrees off its route, more than 60");
    }
}
