//! Slippery patches under the wheels of the ego, against closed forms.

use super::*;
use swerve_world::World as _;

use crate::tests::{at_hz, drive, scenario};

const G_MPS2: f64 = 9.81;

/// A straight road on which the ego begins with 15 m/s at 10 m, with a patch.
fn road(patch: &str) -> Scenario {
    scenario(&format!(
        "name = \"patch\"\nroad = {{ segments = [{{ length_m = 300.0 }}], lane_width_m = 8.0 }}\n\
         ego = {{ s_m = 10.0, target_speed_mps = 15.0, end_m = 290.0 }}\n{patch}"
    ))
}

fn started(scenario: &Scenario, params: &SimParams) -> Simulator {
    Simulator::exact(scenario.clone(), params).unwrap()
}

/// Distance of a stop with full brake on ground of one friction, with the time in which half the deceleration is missing
/// as the brake torque rises.
fn stop_m(speed_mps: f64, friction: f64) -> f64 {
    let build_up_s = 0.15 * (friction * G_MPS2 * 1800.0 * 0.335 / 7100.0).min(1.0);
    speed_mps * 0.5 * build_up_s + speed_mps * speed_mps / (2.0 * friction * G_MPS2)
}

/// Way of the ego with full brake from the start.
fn driven_stop_m(scenario: &Scenario, params: &SimParams) -> f64 {
    let mut sim = started(scenario, params);
    for _ in 0..4_000 {
        sim.step(Command::FULL_BRAKE);
    }
    let ego = &sim.state().ego.state;
    assert!(ego.speed_mps.abs() < 0.01, "{ego:?}");
    ego.pose.x_m - started(scenario, params).state().ego.state.pose.x_m
}

#[test]
fn stop_on_a_patch_takes_v_squared_over_2_mu_g() {
    for friction in [0.5, 0.3, 0.2] {
        let patch = format!(
            "[[slippery]]\nname = \"ice\"\nfriction = {friction:?}\ns_m = 0.0\nlength_m = 200.0\nwidth_m = 8.0"
        );
        let (way_m, ideal_m) = (driven_stop_m(&road(&patch), &at_hz(200)), stop_m(15.0, friction));
        assert!(
            (0.92..1.01).contains(&(ideal_m / way_m)),
            "friction {friction}: {way_m} m, ideal {ideal_m} m"
        );
    }
    let (dry_m, ideal_m) = (driven_stop_m(&road(""), &at_hz(200)), stop_m(15.0, 0.9));
    assert!((0.92..1.01).contains(&(ideal_m / dry_m)), "{dry_m} m, ideal {ideal_m} m");
}

/// A patch under the right wheels alone: with full brake each right wheel has at most a third of the force of the left one.
#[test]
fn each_wheel_has_the_friction_of_the_ground_below_it() {
    let patch = "[[slippery]]\nname = \"ice\"\nfriction = 0.3\ns_m = 0.0\nlength_m = 200.0\nd_m = -2.0\nwidth_m = 4.0";
    let mut sim = started(&road(patch), &at_hz(200));
    // Largest force per load of each wheel: the anti-lock control lets it fall below the friction in between.
    let mut shares = [0.0_f64; 4];
    for _ in 0..70 {
        sim.step(Command::FULL_BRAKE);
        for (share, wheel) in shares.iter_mut().zip(sim.egos[0].car.car().wheels()) {
            *share = share.max(-wheel.fx_n / wheel.load_n);
        }
    }
    let [front_left, front_right, rear_left, rear_right] = shares;
    for (left, right) in [(front_left, front_right), (rear_left, rear_right)] {
        assert!((0.7..0.97).contains(&left), "left wheel on the road: {left}");
        assert!((0.25..0.33).contains(&right), "right wheel on the patch: {right}");
    }
    assert!(sim.state().ego.state.yaw_rate_radps > 0.01, "the car turns to the side with more grip");
}

/// Wheels come onto the patch at its begin, the front ones a wheelbase before the rear ones, and leave it at its end.
#[test]
fn wheels_enter_and_leave_a_patch_one_after_the_other() {
    let patch = "[[slippery]]\nname = \"ice\"\nfriction = 0.3\ns_m = 20.0\nlength_m = 10.0\nwidth_m = 8.0";
    let mut sim = started(&road(patch), &at_hz(200));
    let points = sim.egos[0].car.car().contact_points();
    let mut seen = [0; 2];
    while sim.state().ego.state.pose.x_m < 50.0 {
        let pose = sim.state().ego.map_from_ego;
        sim.step(Command { brake: 0.5, ..Command::default() });
        if sim.state().ego.state.speed_mps < 3.0 {
            break;
        }
        for (wheel, point) in sim.egos[0].car.car().wheels().iter().zip(points) {
            let x_m = (pose * point).coords.x;
            let share = -wheel.fx_n / wheel.load_n;
            // 1 m behind the begin, the tyre has settled.
            if (21.0..30.0).contains(&x_m) {
                seen[0] += 1;
                assert!(share < 0.33, "{share} on the patch at {x_m} m");
            } else if !(19.9..31.0).contains(&x_m) && sim.state().stamp > Time::from_ms(600) {
                seen[1] += usize::from(share > 0.33);
            }
        }
    }
    assert!(seen[0] > 50 && seen[1] > 50, "{seen:?}");
}

/// The friction of a patch counts also for tyres that have a friction of their own.
#[test]
fn patch_replaces_the_friction_of_the_tyres() {
    let patch = "[[slippery]]\nname = \"ice\"\nfriction = 0.3\ns_m = 0.0\nlength_m = 200.0\nwidth_m = 8.0";
    let mut params = at_hz(200);
    params.vehicle.tyre.friction = Some(1.2);
    let (way_m, ideal_m) = (driven_stop_m(&road(patch), &params), stop_m(15.0, 0.3));
    assert!((0.92..1.01).contains(&(ideal_m / way_m)), "{way_m} m, ideal {ideal_m} m");
    assert!(driven_stop_m(&road(""), &params) < 1.02 * stop_m(15.0, 1.0));
}

/// Other egos drive over the same ground, and a patch beside the way changes nothing.
#[test]
fn patch_is_the_same_for_all_egos_and_harmless_beside_the_way() {
    let patch = "[[slippery]]\nname = \"ice\"\nfriction = 0.2\ns_m = 50.0\nlength_m = 200.0\nd_m = 3.0\nwidth_m = 2.0";
    let trace = |scenario: &Scenario| {
        let mut sim = started(scenario, &at_hz(200));
        let mut states = Vec::new();
        drive(
            &mut sim,
            |_| Command { brake: 0.3, ..Command::default() },
            |state| states.push(state.ego.clone()),
        );
        states
    };
    let mut short = road(patch);
    short.end.timeout_s = 6.0;
    let mut plain = road("");
    plain.end.timeout_s = 6.0;
    assert!(trace(&short) == trace(&plain));
    let text = "name = \"two\"\nroad = { segments = [{ length_m = 300.0 }], lane_width_m = 8.0, left_m = 12.0 }\n\
                [ego.a]\ns_m = 10.0\ntarget_speed_mps = 15.0\nend_m = 290.0\n\
                [ego.b]\ns_m = 30.0\ntarget_speed_mps = 15.0\nend_m = 290.0\n\
                [[slippery]]\nname = \"ice\"\nfriction = 0.3\ns_m = 28.0\nlength_m = 200.0\n";
    let mut sim = started(&scenario(text), &at_hz(200));
    for _ in 0..60 {
        let command = Command::FULL_BRAKE;
        let until = sim.state.stamp + sim.params.dt;
        let all: Vec<_> = sim.egos.iter().map(|ego| (ego.car.id(), command)).collect();
        sim.advance(until, &all);
    }
    let decelerations = sim.egos.iter().map(|ego| -ego.car.truth(&sim.world).state.accel_mps2);
    let [first, second]: [f64; 2] = decelerations.collect::<Vec<_>>().try_into().unwrap();
    assert!(first > 6.5 && (2.5..3.3).contains(&second), "{first} and {second} m/s²");
}
