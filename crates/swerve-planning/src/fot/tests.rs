use super::*;
use crate::testing::{World, conformance};
use crate::{CollisionMode, Unlimited};

#[test]
fn best_conforms() {
    conformance(&|| Fot::new(Params::fast(Preset::Best)).unwrap(), true);
}

#[test]
fn paper_conforms() {
    conformance(&|| Fot::new(Params::fast(Preset::Paper)).unwrap(), false);
}

fn plan(world: &World, params: Params) -> Plan {
    Fot::new(params).unwrap().plan(&world.request(), &mut Unlimited::default())
}

#[test]
fn a_free_road_is_driven_straight() {
    let plan = plan(&World::straight(15.0), Params::default());
    assert_eq!(plan.status, PlanStatus::Found);
    assert!(plan.points.iter().all(|p| p.pose.y_m.abs() < 1e-9 && p.pose.heading_rad.abs() < 1e-9));
}

/// A person walks off the lane to the right and is gone when the ego comes; all her places at once are in
/// the way of every path on the road.
#[test]
fn a_person_is_passed_behind_in_time() {
    let world = World::straight(14.0).with_person((26.0, 3.0), (0.0, -3.0));
    for preset in [Preset::Best, Preset::Paper] {
        let timed = plan(&world, Params { clearance_m: 0.5, ..Params::fast(preset) });
        assert_eq!(timed.status, PlanStatus::Found);
        assert!(world.clearance_m(&timed, CollisionMode::TimeIndexed) >= 0.49);
        let swept = Params { collision: CollisionMode::SweptStatic, left_m: 1.0, ..Params::fast(preset) };
        assert!(plan(&world, swept).status.is_fallback());
    }
}

#[test]
fn paper_counts_every_candidate_and_best_few() {
    let world = World::straight(16.0).with_person((25.0, 0.5), (0.0, 0.0));
    assert_eq!(plan(&world, Params::fast(Preset::Paper)).work, 825);
    assert_eq!(plan(&world, Params::slow(Preset::Paper)).work, 11_005);
    let best = plan(&world, Params::slow(Preset::Best));
    assert!(best.work > 0 && best.work < 3_000, "{}", best.work);
}
