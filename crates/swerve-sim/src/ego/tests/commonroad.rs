//! The car compared with the single-track drift model of the CommonRoad vehicle models (recorded data).

use serde::{Deserialize, Serialize};
use swerve_vehicle::SingleTrack;

use super::*;

#[derive(Deserialize)]
struct Reference {
    car: ReferenceCar,
    steering_step_s: f64,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct ReferenceCar {
    mass_kg: f64,
    yaw_inertia_kgm2: f64,
    wheelbase_m: f64,
    front_weight_share: f64,
    cg_height_m: f64,
    wheel_radius_m: f64,
    wheel_spin_inertia_kgm2: f64,
    brake_front_share: f64,
    drive_front_share: f64,
    steering_max_rad: f64,
    steering_rate_max_radps: f64,
    longitudinal: swerve_vehicle::MagicFormula,
    lateral: swerve_vehicle::MagicFormula,
    friction: f64,
}

#[derive(Deserialize)]
struct Case {
    kind: String,
    speed_mps: f64,
    accel_mps2: f64,
    accel_from_s: f64,
    duration_s: f64,
    /// Samples every `steering_step_s`, linear in between; empty for straight driving.
    steering_rad: Vec<f64>,
    end_x_m: f64,
    end_y_m: f64,
    peak_yaw_rate_radps: f64,
}

/// Motion of this car's centre of gravity.
#[derive(Serialize, Deserialize, Clone, Debug)]
struct Ours {
    kind: String,
    speed_mps: f64,
    accel_mps2: f64,
    end_x_m: f64,
    end_y_m: f64,
    peak_yaw_rate_radps: f64,
    /// `[t, x, y, yaw, yaw rate, speed, lateral acceleration]`, rounded.
    rows: Vec<[f64; 7]>,
}

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/reference/vehicle");

fn reference() -> Reference {
    let text = std::fs::read_to_string(format!("{FOLDER}/commonroad_std.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// The car without actuator lags, drag and rolling resistance, which the reference does not model.
fn bare_car() -> VehicleParams {
    let mut params = car();
    params.steering.lag_s = 0.0;
    params.brakes.build_up_s = 0.0;
    params.aero.drag_area_m2 = 0.0;
    params.wheel.rolling_resistance = 0.0;
    params
}

fn steering_at(case: &Case, step_s: f64, t_s: f64) -> f64 {
    let at = t_s / step_s;
    let i = at.floor() as usize;
    match (case.steering_rad.get(i), case.steering_rad.get(i + 1)) {
        (Some(a), Some(b)) => a + (b - a) * (at - at.floor()),
        _ => 0.0,
    }
}

/// Drives one case with the reference's brake torque, or with full pedal and ABS.
fn drive(params: &VehicleParams, reference: &Reference, case: &Case, full_pedal: bool, rate_hz: f64) -> Ours {
    let mut drive = Drive::new(params, case.speed_mps, rate_hz);
    drive.friction = reference.car.friction;
    let torque_nm = -case.accel_mps2 * params.body.mass_kg * params.wheel.radius_m;
    let pedal = if full_pedal { 1.0 } else { torque_nm / params.brakes.torque_max_nm };
    let duration_s = if case.kind == "lane_change" { case.duration_s } else { case.duration_s + 1.0 };
    let half_step_s = 0.5 * drive.dt_s;
    let (mut peak, mut rows, mut tick) = (0.0f64, Vec::new(), 0u32);
    let mut last = [0.0; 2];
    drive.watch(
        duration_s,
        |t| Command {
            steering_rad: steering_at(case, reference.steering_step_s, t + half_step_s),
            throttle: 0.0,
            brake: if t + half_step_s >= case.accel_from_s { pedal } else { 0.0 },
        },
        |ego, truth| {
            let cg = (truth.map_from_ego * ego.car().center_of_gravity()).coords;
            // The reference measures from the initial centre of gravity.
            last = [cg.x - params.cg_to_rear_m(), cg.y];
            peak = peak.max(truth.state.yaw_rate_radps.abs());
            tick += 1;
            let now_s = f64::from(tick) / rate_hz;
            if (now_s * 10.0).fract().min(1.0 - (now_s * 10.0).fract()) < 1e-6 {
                let row = [
                    now_s,
                    last[0],
                    last[1],
                    truth.state.pose.heading_rad,
                    truth.state.yaw_rate_radps,
                    truth.velocity_mps.norm(),
                    truth.state.lateral_accel_mps2,
                ];
                rows.push(row.map(|value| (value * 1e4).round() / 1e4));
            }
        },
    );
    Ours {
        kind: if full_pedal { "full_pedal_stop".into() } else { case.kind.clone() },
        speed_mps: case.speed_mps,
        accel_mps2: case.accel_mps2,
        end_x_m: last[0],
        end_y_m: last[1],
        peak_yaw_rate_radps: peak,
        rows,
    }
}

#[test]
fn both_cars_have_the_same_parameters() {
    let (r, p) = (reference().car, car());
    let pairs = [
        (r.mass_kg, p.body.mass_kg),
        (r.yaw_inertia_kgm2, p.body.yaw_inertia_kgm2),
        (r.wheelbase_m, p.shape.wheelbase_m),
        (r.front_weight_share, p.body.front_weight_share),
        (r.cg_height_m, p.body.cg_height_m),
        (r.wheel_radius_m, p.wheel.radius_m),
        (r.wheel_spin_inertia_kgm2, p.wheel.spin_inertia_kgm2),
        (r.brake_front_share, p.brakes.front_share),
        (r.drive_front_share, p.drivetrain.front_share),
        (r.steering_max_rad, p.limits.steering_max_rad),
        (r.steering_rate_max_radps, p.limits.steering_rate_max_radps),
    ];
    assert!(pairs.iter().all(|(a, b)| a == b), "{pairs:?}");
    assert_eq!(r.longitudinal, p.tyre.longitudinal);
    assert_eq!(r.lateral, p.tyre.lateral);
}

/// Bounds: 0.25 m of lateral offset, 7 % of peak yaw rate, 3 % of stopping distance.
fn check(case: &Case, our: &Ours) {
    let what = format!("{} {} m/s {} m/s²", our.kind, case.speed_mps, case.accel_mps2);
    if case.kind == "lane_change" {
        let off_m = our.end_y_m - case.end_y_m;
        let yaw = our.peak_yaw_rate_radps / case.peak_yaw_rate_radps - 1.0;
        println!("{what}: {:.3} m, {off_m:+.3} m; peak yaw rate {:+.2} %", case.end_y_m, 100.0 * yaw);
        assert!(off_m.abs() < 0.25, "{what}: {off_m} m");
        assert!(yaw.abs() < 0.07, "{what}: {yaw}");
    } else {
        let way = our.end_x_m / case.end_x_m - 1.0;
        println!("{what}: {:.2} m, {:+.2} %", case.end_x_m, 100.0 * way);
        assert!(way.abs() < 0.03, "{what}: {way}");
    }
}

fn all_cases(rate_hz: f64) -> Vec<Ours> {
    let (reference, params) = (reference(), bare_car());
    let mut all = Vec::new();
    for case in &reference.cases {
        // The reference has no ABS: full pedal with ABS is also compared with its hardest stop.
        let pedals: &[bool] = if case.kind == "hardest_stop" { &[false, true] } else { &[false] };
        for &full_pedal in pedals {
            let our = drive(&params, &reference, case, full_pedal, rate_hz);
            check(case, &our);
            all.push(our);
        }
    }
    all
}

/// The car also reproduces its recorded motion (`SWERVE_BLESS=1` rewrites it).
#[test]
fn car_matches_the_drift_model() {
    compare_with_recorded(&all_cases(200.0));
}

#[test]
fn car_matches_the_drift_model_at_1_khz() {
    assert!(!all_cases(1000.0).is_empty());
}

/// The single-track model of `swerve-vehicle` with the same inputs, compared with the full car: the missing effects
/// (roll, lateral load transfer, relaxation) matter most when braking in the turn.
#[test]
fn single_track_model_is_near_the_full_car() {
    let (reference, params) = (reference(), bare_car());
    let model = SingleTrack::new(&params, reference.car.friction);
    let dt_s = 0.005;
    for case in &reference.cases {
        let full = drive(&params, &reference, case, false, 200.0);
        let mut state = SingleTrack::straight(Pose2::default(), case.speed_mps);
        let (mut peak, steps) = (0.0f64, (case.duration_s / dt_s).round() as u32);
        for i in 0..steps {
            let t = (f64::from(i) + 0.5) * dt_s;
            // The input of the reference is a torque, part of which decelerates the wheels.
            let braking = case.accel_mps2 * params.body.mass_kg / params.effective_mass_kg();
            let accel = if t >= case.accel_from_s { braking } else { 0.0 };
            state = model.step(state, steering_at(case, reference.steering_step_s, t), accel, dt_s);
            peak = peak.max(state.yaw_rate_radps.abs());
        }
        let cg = state.pose.ahead(params.cg_to_rear_m());
        let what = format!("{} {} m/s {} m/s²", case.kind, case.speed_mps, case.accel_mps2);
        if case.kind == "lane_change" {
            let off_m = cg.y_m - full.end_y_m;
            let yaw = peak / full.peak_yaw_rate_radps - 1.0;
            println!("{what}: {off_m:+.3} m, peak yaw rate {:+.2} %", 100.0 * yaw);
            assert!(off_m.abs() < 0.15, "{what}: {off_m} m");
            assert!(yaw.abs() < if case.accel_mps2 < 0.0 { 0.06 } else { 0.02 }, "{what}: {yaw}");
        } else {
            let way = (cg.x_m - params.cg_to_rear_m()) / full.end_x_m - 1.0;
            println!("{what}: {way:+.4}");
            assert!(way.abs() < 0.03, "{what}: {way}");
        }
    }
}

fn compare_with_recorded(ours: &[Ours]) {
    let file = format!("{FOLDER}/swerve.json");
    if std::env::var_os("SWERVE_BLESS").is_some() {
        let lines: Vec<String> = ours.iter().map(|our| serde_json::to_string(our).unwrap()).collect();
        std::fs::write(&file, format!("[\n{}\n]\n", lines.join(",\n"))).unwrap();
    }
    let recorded: Vec<Ours> = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    assert_eq!(recorded.len(), ours.len());
    for (then, now) in recorded.iter().zip(ours) {
        assert_eq!(then.kind, now.kind);
        let moved = math::hypot(then.end_x_m - now.end_x_m, then.end_y_m - now.end_y_m);
        assert!(moved < 1e-3, "{} at {} m/s ends {moved} m from where it did", now.kind, now.speed_mps);
    }
}
