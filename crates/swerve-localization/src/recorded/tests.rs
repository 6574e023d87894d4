use std::path::Path;

use super::*;
use crate::npz;

/// The CARLA log, where it is at hand.
fn log(name: &str) -> Option<Recorded> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .map(|folder| folder.join("shared/data/localization/carla_esekf").join(name))
        .find(|path| path.exists());
    let Some(path) = path else {
        eprintln!("skipped: no {name} under shared/data/localization/carla_esekf");
        return None;
    };
    let arrays = npz::read(&std::fs::read(path).unwrap()).unwrap();
    Some(Recorded::new(&arrays).unwrap())
}

/// Position on the ground on p1 under Pylot's settings: its algebra corrected, its first error, both.
/// Golden: an independent filter in Python with a global error of the attitude, 0.255, 0.288 and 0.776 m.
#[test]
fn the_papers_filter_and_what_its_errors_cost() {
    let Some(drive) = log("p1.npz") else { return };
    let expected = [(false, false, 0.255, 1.32), (true, false, 0.288, 1.94), (true, true, 0.776, 2.12)];
    for (degrees_error, gravity_free_jacobian, rmse_2d_m, attitude_deg) in expected {
        let params = Params { degrees_error, gravity_free_jacobian, ..drive.params(Preset::Paper) };
        let report = drive.run(params, Preset::Paper).unwrap();
        println!("{report:?}");
        assert!((report.rmse_2d_m - rmse_2d_m).abs() < 0.002, "{report:?}");
        assert!((report.attitude_deg - attitude_deg).abs() < 0.02, "{report:?}");
    }
}

#[test]
fn the_best_filter_keeps_its_bounds() {
    for (name, rmse_2d_m, largest_m) in [("p1.npz", 0.18, 1.0), ("p3.npz", 0.25, 1.0)] {
        let Some(drive) = log(name) else { continue };
        let report = drive.run(drive.params(Preset::Best), Preset::Best).unwrap();
        println!("{name} {report:?}");
        assert!(report.rmse_2d_m <= rmse_2d_m && report.largest_m <= largest_m, "{name}: {report:?}");
        assert!(report.attitude_deg <= 1.1 && (2.4..=3.7).contains(&report.nees), "{name}: {report:?}");
    }
}
#[test]
fn scan() {
    for name in ["p1.npz", "p3.npz"] {
        let Some(drive) = log(name) else { continue };
        for nh in [0.0, 0.05, 0.1, 0.3] {
            for acc in [[0.0224; 3], [0.0045, 0.038, 0.003], [0.01, 0.04, 0.01]] {
                for gyro in [0.0035, 0.00707] {
                    let params = Params { non_holonomic_mps: nh, accel_noise: acc, gyro_noise: [gyro; 3], ..drive.params(Preset::Best) };
                    let r = drive.run(params, Preset::Best).unwrap();
                    println!("{name} nh {nh} acc {acc:?} gyro {gyro}: 2d {:.3} max {:.3} att {:.3} nees {:.2} {:.2} {:?}", r.rmse_2d_m, r.largest_m, r.attitude_deg, r.nees, r.nees_in_95, r.nis.iter().map(|(k, n)| format!("{k} {:.2} {} {}", n.mean, n.taken, n.refused)).collect::<Vec<_>>());
                }
            }
        }
    }
}
