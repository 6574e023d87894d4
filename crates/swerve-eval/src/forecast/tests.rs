use serde_json::Value;
use swerve_core::Rng;
use swerve_geom::Pose2;

use super::*;

/// Numbers of a nested array, in order.
fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(inner) => inner.iter().flat_map(flat).collect(),
        Value::Bool(is) => vec![f64::from(u8::from(*is))],
        number => vec![number.as_f64().unwrap()],
    }
}

fn points(value: &Value) -> Vec<Point2> {
    flat(value).as_chunks::<2>().0.iter().map(|[x, y]| Point2::new(*x, *y)).collect()
}

fn close(name: &str, ours: impl IntoIterator<Item = f64>, golden: &Value) {
    let (ours, golden): (Vec<_>, _) = (ours.into_iter().collect(), flat(golden));
    assert_eq!(ours.len(), golden.len(), "{name}");
    for (a, b) in ours.iter().zip(&golden) {
        assert!((a - b).abs() < 1e-9, "{name}: {a} is {b}");
    }
}

#[test]
fn errors_match_av2_and_densities_match_scipy() {
    let golden: Value =
        serde_json::from_str(include_str!("../../../../tests/reference/prediction/golden.json")).unwrap();
    let probabilities = flat(&golden["probabilities"]);
    let truth: Vec<_> = golden["truth"].as_array().unwrap().iter().map(points).collect();
    let paths = |actor: usize, mode: usize| points(&golden["paths"][actor][mode]);
    let errors: Vec<Vec<ModeErrors>> = (0..truth.len())
        .map(|m| {
            let mode = |(k, p): (usize, &f64)| ModeErrors::of(*p, &paths(m, k), &truth[m]).unwrap();
            probabilities.iter().enumerate().map(mode).collect()
        })
        .collect();
    let each = |of: fn(&ModeErrors) -> f64| errors.iter().flatten().map(of).collect::<Vec<_>>();
    close("ade", each(|mode| mode.ade_m), &golden["ade"]);
    close("fde", each(|mode| mode.fde_m), &golden["fde"]);
    close("brier", each(ModeErrors::brier_fde_m), &golden["brier_fde"]);
    close("missed", each(|mode| f64::from(u8::from(mode.missed()))), &golden["missed"]);
    close("missed", each(|mode| f64::from(u8::from(mode.missed()))), &golden["world_misses"]);
    close("world ade", joint(&errors, &probabilities).iter().map(|mode| mode.ade_m), &golden["world_ade"]);
    close("world fde", joint(&errors, &probabilities).iter().map(|mode| mode.fde_m), &golden["world_fde"]);
    for (m, truth) in truth.iter().enumerate() {
        let at = |t: usize| {
            let part = |(k, weight): (usize, &f64)| {
                let covariance_m2 = flat(&golden["covariances"][m][k][t]).try_into().unwrap();
                Gaussian { weight: *weight, mean: paths(m, k)[t], covariance_m2 }
            };
            nll(&probabilities.iter().enumerate().map(part).collect::<Vec<_>>(), truth[t])
        };
        close("nll", (0..truth.len()).map(at), &golden["nll"][m]);
    }
    for share in LEVELS {
        let unit = Gaussian { weight: 1.0, mean: Point2::default(), covariance_m2: [1.0, 0.0, 1.0] };
        let limit = golden["chi2"][share.to_string()].as_f64().unwrap().sqrt();
        for (off, within) in [(-1e-6, 1.0), (1e-6, 0.0)] {
            let mut coverage = Coverage::default();
            coverage.add(&unit, Point2::new(limit + off, 0.0));
            let k = LEVELS.iter().position(|level| *level == share).unwrap();
            assert_eq!(coverage.shares().unwrap()[k], within);
        }
    }
}

#[test]
fn best_mode_is_chosen_among_the_most_probable() {
    let mode = |probability, ade_m, fde_m, largest_m| ModeErrors { probability, ade_m, fde_m, largest_m };
    let modes = [mode(0.1, 0.1, 0.2, 0.3), mode(0.6, 1.0, 2.5, 2.5), mode(0.3, 1.5, 1.9, 3.0)];
    let best = |k| BestOf::of(&modes, k).unwrap();
    assert_eq!((best(1).fde_m, best(1).min_fde_m, best(1).missed), (2.5, 2.5, true));
    assert_eq!((best(2).min_ade_m, best(2).ade_of_min_fde_m, best(2).min_fde_m), (1.0, 1.5, 1.9));
    assert_eq!((best(2).missed, best(2).missed_anywhere), (false, true));
    assert!((best(2).brier_min_fde_m - 2.39).abs() < 1e-12);
    assert!((best(3).p_min_fde_m - (0.2 - math::ln(0.1))).abs() < 1e-12);
    assert_eq!((best(3).fde_m, best(3).min_fde_m), (2.5, 0.2));
    assert_eq!(BestOf::of(&[], 3), None);
    assert_eq!(ModeErrors::of(1.0, &[], &[]), None);
    assert_eq!(nll(&[], Point2::default()), f64::INFINITY);
}

/// Two actors of three modes: the scene follows the mode that one is certain of and the other finds probable.
#[test]
fn joint_probability_is_the_product_over_actors() {
    let actor = |shares: [f64; 3]| -> Vec<ModeErrors> {
        shares.map(|probability| ModeErrors { probability, ..ModeErrors::default() }).to_vec()
    };
    let found = joint_probabilities(&[actor([0.8, 0.1, 0.1]), actor([0.5, 0.3, 0.2])]);
    for (found, expected) in found.iter().zip([0.40 / 0.45, 0.03 / 0.45, 0.02 / 0.45]) {
        assert!((found - expected).abs() < 1e-12, "{found} is {expected}");
    }
    // Products over a hundred actors must not underflow to NaN.
    let many = vec![actor([0.98, 0.01, 0.01]); 100];
    assert!((joint_probabilities(&many)[0] - 1.0).abs() < 1e-12);
    assert_eq!(joint_probabilities(&[]), Vec::<f64>::new());
}

#[test]
fn outlines_collide_only_at_the_same_instant() {
    let at = |x_m: f64| Obb::new(Pose2::new(x_m, 0.0, 0.0), 1.0, 1.0);
    assert!(collide(&[at(0.0), at(1.0)], &[at(5.0), at(1.5)]));
    assert!(!collide(&[at(0.0), at(1.5)], &[at(1.5), at(0.0)]));
}

/// Regions that are three times too narrow reach nine of ten again, also after the errors have doubled.
#[test]
fn recalibrated_regions_reach_their_nominal_coverage() {
    let mut rng = Rng::keyed(1, "recalibration", &[]);
    let stated = Gaussian { weight: 1.0, mean: Point2::default(), covariance_m2: [1.0, 0.0, 1.0] };
    let (mut coverage, mut recalibration) = (Coverage::default(), Recalibration::new(0.9, 0.02));
    let mut held = 0;
    for k in 0..4000 {
        let scale = if k < 2000 { 3.0 } else { 6.0 };
        let place = Point2::new(scale * rng.normal(), scale * rng.normal());
        coverage.add(&stated, place);
        let squared = stated.mahalanobis_squared(place);
        let holds = squared <= recalibration.squared();
        held += usize::from(holds);
        recalibration.learn(squared, holds);
    }
    assert!(coverage.shares().unwrap()[2] < 0.3);
    assert!((0.885..0.915).contains(&(held as f64 / 4000.0)), "{held}");
}
