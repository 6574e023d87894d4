use super::*;
use swerve_stack::config::detectors::fits;

/// Built-in scenarios with one seed each: half of the frames that the built-in fits were made with.
fn frames(sensing: Sensing) -> Frames {
    let all = scenarios(None).unwrap();
    let with = "control.controller=pid planning.collision=time_indexed planning.comfort.enabled=false";
    let with: Vec<String> = with.split(' ').map(str::to_owned).collect();
    let base = Setup::load(None, &swerve_text::parse_assignments(&with).unwrap()).unwrap();
    Frames::gather(&base, sensing, &all, &[1], || {}).unwrap()
}

#[test]
fn built_in_fits_hold_on_part_of_the_frames() {
    let frames = frames(Sensing::Camera);
    let mut before = 1.0;
    for name in ["efficientdet-d7x@v100", "efficientdet-d3@v100", "ssd-mobilenet-v1@titan-x"] {
        let detector = find(name).unwrap();
        let fit = fits()[name];
        let params = Params::of_error_level(detector.sensing, fit.error_level);
        let (ap, wanted) = measured(params, detector.measure, &frames, 1..9, 50.0).unwrap().unwrap();
        assert!(wanted > 300, "{wanted}");
        assert!((ap - fit.ap).abs() < 0.03, "{name}: {ap}, frozen with {}", fit.ap);
        assert!(ap < before, "{name}");
        before = ap;
    }
    for (error_level, least, most) in [(0.0, 1.0 - 1e-9, 1.0 + 1e-9), (50.0, 0.0, 0.05)] {
        let params = Params::of_error_level(Sensing::Camera, error_level);
        for overlap in [Overlap::Image, Overlap::Ground, Overlap::Volume] {
            let measure = Measure { overlap, ..Measure::default() };
            let (ap, _) = measured(params, measure, &frames, 1..2, 50.0).unwrap().unwrap();
            assert!((least..=most).contains(&ap), "{error_level} {overlap:?}: {ap}");
        }
    }
}
