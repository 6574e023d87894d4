use serde_json::Value;

use super::*;

/// First sequence of KITTI with two estimates, if available.
fn poses(name: &str) -> Option<Vec<SpacePose>> {
    let path = swerve_tests::data_or_skip(&format!("localization/metric_oracle/{name}"))?;
    Some(SpacePose::from_kitti(&std::fs::read_to_string(path).unwrap()).unwrap())
}

fn close(ours: &TrajectoryErrors, golden: &Value, share: f64, what: &str) {
    for (ours, key) in [
        (ours.rmse, "rmse"),
        (ours.mean, "mean"),
        (ours.median, "median"),
        (ours.std, "std"),
        (ours.max, "max"),
    ] {
        let golden = golden[key].as_f64().unwrap();
        assert!((ours - golden).abs() <= share * golden, "{what} {key}: {ours}, evo has {golden}");
    }
}

/// Against `evo`, whose results and script are in `tests/reference/trajectory`.
#[test]
fn trajectory_errors_match_evo() {
    let golden: Value =
        serde_json::from_str(include_str!("../../../../tests/reference/trajectory/golden.json")).unwrap();
    for run in golden["runs"].as_array().unwrap() {
        let name = run["file"].as_str().unwrap();
        let (Some(truth), Some(found)) = (poses("KITTI_00_gt.txt"), poses(name)) else { return };
        let alignment = match (run["align"].as_bool(), run["scale"].as_bool()) {
            (Some(true), Some(true)) => Alignment::Scaled,
            (Some(true), _) => Alignment::Rigid,
            _ => Alignment::None,
        };
        let found = aligned(&truth, &found, alignment);
        let what = format!("{name} {alignment:?}");
        let absolute = absolute_errors(&truth, &found);
        close(&absolute.position_m, &run["ape_m"], 1e-6, &format!("{what} APE"));
        // The file's rotations have six digits; evo orthogonalizes them first.
        close(&absolute.angle_deg, &run["ape_deg"], 1e-3, &format!("{what} APE"));
        for delta in [1, 100] {
            let relative = relative_errors(&truth, &found, delta);
            close(&relative.position_m, &run[format!("rpe_{delta}_m")], 1e-6, &format!("{what} RPE {delta}"));
            close(
                &relative.angle_deg,
                &run[format!("rpe_{delta}_deg")],
                1e-3,
                &format!("{what} RPE {delta}"),
            );
        }
    }
}

#[test]
fn invalid_pose_line_is_reported() {
    let good = "1 0 0 1 0 1 0 2 0 0 1 3";
    assert_eq!(SpacePose::from_kitti(good).unwrap()[0].position_m, [1.0, 2.0, 3.0]);
    assert_eq!(SpacePose::from_kitti(&format!("{good}\n1 0 0")), Err(2));
    assert_eq!(SpacePose::from_kitti("nan 0 0 1 0 1 0 2 0 0 1 3"), Err(1));
}

#[test]
fn errors_without_poses_are_zero() {
    assert_eq!(absolute_errors(&[], &aligned(&[], &[], Alignment::Scaled)), PoseErrors::default());
    assert_eq!(relative_errors(&[], &[], 100), PoseErrors::default());
}
