use super::*;

fn filter() -> Eskf {
    let nominal = Nominal {
        position_m: Vector3::new(3.0, -2.0, 0.5),
        velocity_mps: Vector3::new(9.0, 3.0, -0.2),
        attitude: from_euler(0.05, -0.1, 0.7),
        accel_bias_mps2: Vector3::new(0.03, -0.02, 0.01),
        gyro_bias_radps: Vector3::new(0.001, 0.002, -0.003),
        offset_m: [0.4, -0.3],
        wheel_scale: 0.004,
    };
    Eskf { nominal, covariance: Covariance::identity() }
}

/// Error of `a` relative to `b`, in the filter's error states.
fn error(a: &Nominal, b: &Nominal) -> [f64; STATES] {
    let turn = b.attitude.inverse() * a.attitude;
    let [p, v, o] = [a.position_m - b.position_m, a.velocity_mps - b.velocity_mps, turn.coords.xyz() * 2.0];
    let ba = a.accel_bias_mps2 - b.accel_bias_mps2;
    let bg = a.gyro_bias_radps - b.gyro_bias_radps;
    let offset = [a.offset_m[0] - b.offset_m[0], a.offset_m[1] - b.offset_m[1]];
    let mut all = [0.0; STATES];
    for (k, x) in [p, v, o, ba, bg].iter().flat_map(|v| v.iter()).chain(&offset).enumerate() {
        all[k] = *x;
    }
    all[SCALE] = a.wheel_scale - b.wheel_scale;
    all
}

/// Compares the covariance propagation with central differences of the nominal step.
#[test]
fn transition_is_the_derivative_of_the_nominal_step() {
    let quiet = Params {
        accel_noise: [0.0; 3],
        gyro_noise: [0.0; 3],
        accel_bias_walk: 0.0,
        gyro_bias_walk: 0.0,
        offset_m: 0.0,
        offset_time_s: 20.0,
        ..Params::default()
    };
    let (accel, gyro, dt_s, h) = (Vector3::new(1.0, -0.5, 9.7), Vector3::new(0.1, -0.2, 0.5), 0.01, 1e-5);
    let after = |from: &Eskf| {
        let mut to = from.clone();
        to.predict(&quiet, &accel, &gyro, dt_s);
        to
    };
    let middle = after(&filter());
    let mut numeric = Covariance::zeros();
    for k in 0..STATES {
        let moved = |by: f64| {
            let mut from = filter();
            let mut step = SVector::<f64, STATES>::zeros();
            step[k] = by;
            from.inject(&step, false);
            error(&after(&from).nominal, &middle.nominal)
        };
        let (plus, minus) = (moved(h), moved(-h));
        for i in 0..STATES {
            numeric[(i, k)] = (plus[i] - minus[i]) / (2.0 * h);
        }
    }
    // From a unit covariance, the propagated covariance is F Fᵀ.
    let spread = numeric * numeric.transpose();
    // Terms of second order in dt are neglected in F: half of the acceleration step in position, of the turn in the
    // bias.
    let worst = (spread - middle.covariance).amax();
    assert!(worst < 10.0 * dt_s * dt_s, "{worst}");
}

/// Compares the update with the textbook Joseph form.
#[test]
fn update_matches_the_joseph_form() {
    let mut filter = filter();
    for k in 0..50 {
        filter.predict(
            &Params::default(),
            &Vector3::new(0.3, 0.1, 9.8),
            &Vector3::new(0.0, 0.0, 0.02 * f64::from(k)),
            0.01,
        );
    }
    let mut rows = SMatrix::<f64, 3, STATES>::zeros();
    for i in 0..3 {
        rows[(i, POSITION + i)] = 1.0;
        rows[(i, ATTITUDE + i)] = 0.3;
    }
    let noise = Matrix3::from_diagonal(&Vector3::new(0.2, 0.3, 0.4));
    let p = filter.covariance;
    let linear = Linear { residual: Vector3::zeros(), rows, noise };
    let innovation = filter.update(&linear, f64::INFINITY, false);
    let gain = p * rows.transpose() * (rows * p * rows.transpose() + noise).try_inverse().unwrap();
    let kept = Covariance::identity() - gain * rows;
    let expected = kept * p * kept.transpose() + gain * noise * gain.transpose();
    assert!(innovation.accepted && innovation.nis == 0.0);
    assert!((filter.covariance - expected).amax() < 1e-12);
}

#[test]
fn update_rejects_nan_and_outliers() {
    let still = filter();
    let mut rows = SMatrix::<f64, 1, STATES>::zeros();
    rows[(0, 0)] = 1.0;
    for residual in [f64::NAN, f64::INFINITY, 10.0] {
        let mut filter = still.clone();
        let linear = Linear { residual: [residual].into(), rows, noise: [[0.1]].into() };
        assert!(!filter.update(&linear, 10.828, false).accepted);
        assert_eq!((filter.nominal, filter.covariance), (still.nominal, still.covariance));
    }
}

#[test]
fn yaw_and_angle_between_recover_known_rotations() {
    let attitude = from_euler(0.1, -0.2, 1.3);
    assert!((yaw_rad(&attitude) - 1.3).abs() < 1e-12);
    assert!((angle_between(&attitude, &(attitude * exp(&Vector3::new(0.0, 0.3, 0.4)))) - 0.5).abs() < 1e-12);
}
