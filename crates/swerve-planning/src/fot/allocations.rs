//! Counts FOT's allocations in steady state: only the returned plan.

use crate::fot::{Fot, Params};
use crate::{Planner, Request, Unlimited};
use swerve_core::{Span, Time};
use swerve_geom::{Point2, Polyline, Pose2};
use swerve_msg::{ActorId, ActorKind, EgoState, Extent, PlanStatus, PredictedPose, Prediction, Route};
use swerve_vehicle::{Limits, Shape};

#[test]
fn a_plan_allocates_its_points_only() {
    let points: Vec<Point2> = (0..200).map(|x| Point2::new(f64::from(x), 0.0)).collect();
    let route = Route::uniform(Polyline::new(&points).unwrap(), 6.0, 2.0);
    let path = (0..=50)
        .map(|k| PredictedPose {
            at: Time::ZERO + Span::from_ms(100) * k,
            pose: Pose2::new(55.0, 2.0 - 0.1 * k as f64, 0.0),
        })
        .collect();
    let extent = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 };
    let person = Prediction::single(ActorId(1), ActorKind::Pedestrian, extent, path);
    let request = Request {
        stamp: Time::ZERO,
        start: EgoState { pose: Pose2::new(30.0, 0.0, 0.0), speed_mps: 14.0, ..EgoState::default() },
        route: &route,
        along_m: None,
        target_speed_mps: 14.0,
        overtake_max_m: f64::INFINITY,
        changed_lately: &[],
        predictions: &[person],
        shape: &Shape::default(),
        limits: &Limits::default(),
        previous: None,
        seed: 0,
    };
    for params in [Params::fast(), Params::slow()] {
        let mut planner = Fot::new(params).unwrap();
        assert_eq!(planner.plan(&request, &mut Unlimited::default()).status, PlanStatus::Found);
        let planned = allocation_counter::measure(|| {
            let plan = planner.plan(&request, &mut Unlimited::default());
            assert_eq!(plan.status, PlanStatus::Found);
        });
        // The vector of the points, allocated once.
        assert!(planned.count_total <= 1, "{planned:?}");
    }
}
