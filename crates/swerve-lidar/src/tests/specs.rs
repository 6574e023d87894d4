//! Specifications: presets and rejected values.

use super::*;

#[test]
fn presets_match_their_data_sheets() {
    for (preset, beams, columns, lowest, highest) in [
        (LidarPreset::Vlp32, 32, 1800, -25.0, 15.0),
        (LidarPreset::Hdl64, 64, 2083, -24.333, 2.0),
        (LidarPreset::Os1, 64, 2048, -16.611, 16.611),
    ] {
        let spec = preset.spec();
        assert_eq!(spec.check(), Ok(()));
        assert_eq!((spec.beams.len(), spec.columns, spec.rate_hz), (beams, columns, 10.0));
        let degrees: Vec<f64> = spec.beams.iter().map(|b| b.elevation_rad.to_degrees()).collect();
        assert!(degrees.windows(2).all(|pair| pair[0] < pair[1]), "{degrees:?}");
        assert!((degrees[0] - lowest).abs() < 1e-3 && (degrees[beams - 1] - highest).abs() < 1e-3);
        assert_eq!(preset.name().parse(), Ok(preset));
    }
    assert_eq!("os1".parse(), Ok(LidarPreset::Os1));
    let error = "vlp_33".parse::<LidarPreset>().unwrap_err().to_string();
    assert!(error.contains("`vlp_33`") && error.contains("hdl_64"), "{error}");
    let os1 = LidarPreset::Os1.beams();
    let steps: Vec<f64> =
        os1.windows(2).map(|pair| (pair[1].elevation_rad - pair[0].elevation_rad).to_degrees()).collect();
    assert!(steps.iter().all(|step| (step - 0.5273).abs() < 1e-3), "{steps:?}");
}

#[test]
fn sweeper_rejects_invalid_specs_by_field() {
    let twins = |count: usize| vec![Beam { elevation_rad: 0.1, azimuth_rad: 0.0 }; count];
    type Change = Box<dyn Fn(&mut LidarSpec)>;
    let cases: Vec<(&str, Change)> = vec![
        ("`beams` is empty", Box::new(|s| s.beams.clear())),
        ("`beams` is a table of 513", Box::new(|s| s.beams.resize(513, Beam::default()))),
        ("`beams[1]` is at the angles of beams[0] (1 of 2", Box::new(move |s| s.beams = twins(2))),
        ("`beams[1]` is at the angles of beams[0] (199 of 200", Box::new(move |s| s.beams = twins(200))),
        ("`beams[3].elevation_rad` is NaN", Box::new(|s| s.beams[3].elevation_rad = f64::NAN)),
        ("`beams[0].elevation_rad` is 2", Box::new(|s| s.beams[0].elevation_rad = 2.0)),
        ("`beams[0].azimuth_rad` is inf", Box::new(|s| s.beams[0].azimuth_rad = f64::INFINITY)),
        ("`columns` is 0", Box::new(|s| s.columns = 0)),
        ("`columns` is 4000000000", Box::new(|s| s.columns = 4_000_000_000)),
        (
            "`beams x columns`",
            Box::new(|s| {
                s.columns = 16_384;
                s.beams =
                    (0..512).map(|k| Beam { elevation_rad: f64::from(k) * 1e-3, azimuth_rad: 0.0 }).collect();
            }),
        ),
        ("`rate_hz` is 0", Box::new(|s| s.rate_hz = 0.0)),
        ("`rate_hz` is -10", Box::new(|s| s.rate_hz = -10.0)),
        ("`rate_hz` is NaN", Box::new(|s| s.rate_hz = f64::NAN)),
        ("`first_azimuth_rad` is NaN", Box::new(|s| s.first_azimuth_rad = f64::NAN)),
        (
            "`range_min_m` is 120, expected less than",
            Box::new(|s| (s.range_min_m, s.range_max_m) = (120.0, 120.0)),
        ),
        (
            "`range_min_m` is 130, expected less than",
            Box::new(|s| (s.range_min_m, s.range_max_m) = (130.0, 120.0)),
        ),
        ("`range_min_m` is -1", Box::new(|s| s.range_min_m = -1.0)),
        ("`range_max_m` is inf", Box::new(|s| s.range_max_m = f64::INFINITY)),
        ("`reach_m` is 0", Box::new(|s| s.reach_m = 0.0)),
        ("`range_sigma_m` is -0.1", Box::new(|s| s.range_sigma_m = -0.1)),
        ("`range_step_m` is NaN", Box::new(|s| s.range_step_m = f64::NAN)),
        ("`dropout` is 1.5", Box::new(|s| s.dropout = 1.5)),
        ("`intensity_full_m` is NaN", Box::new(|s| s.intensity_full_m = f64::NAN)),
    ];
    for (message, change) in cases {
        let mut spec = LidarSpec::default();
        change(&mut spec);
        let error = Sweeper::new(spec, 1).map(|_| ()).unwrap_err().to_string();
        assert!(error.starts_with(message), "{error} for {message}");
        assert!(error.contains("expected"), "{error}");
    }
    let error = Sweeper::new(LidarSpec::default(), usize::MAX).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("`threads` is 18446744073709551615, expected at most 256"), "{error}");
    // Beams of equal elevation with different azimuth offsets are a fan, which some sensors have.
    let fan = (0..8).map(|k| Beam { elevation_rad: 0.0, azimuth_rad: 0.01 * f64::from(k) }).collect();
    assert!(Sweeper::new(LidarSpec { beams: fan, ..LidarSpec::default() }, 1).is_ok());
}
