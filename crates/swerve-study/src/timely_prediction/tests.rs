use serde::Deserialize;
use swerve_geom::Point2;
use swerve_msg::{ActorId, ActorKind, Extent};
use swerve_prediction::recorded::RecordedTrack;
use swerve_text::{Document, Problems};

use super::*;

const TEXT: &str = "[base]\nscenario = \"person_crossing\"\n[[axis]]\nkey = \"seed\"\nvalues = [1]\n\
    [timely_prediction]\npredictors = [\"constant_velocity\", \"truth\", \"linear\"]\nhorizon_s = 3\n\
    [[timely_prediction.set]]\nname = \"made\"\nmade = { seeds = [5, 5], people = 3 }\nevery = 7\n\
    [[timely_prediction.set]]\nname = \"lost\"\nrecorded = { format = \"eth_ucy\", folder = \"no/such\", files = [\"a.txt\"] }\n\
    [[timely_prediction.run_time]]\nname = \"here\"\nms = { constant_velocity = [1], truth = [100, 150, 200] }\n";

#[derive(Deserialize)]
struct File {
    timely_prediction: TimelyPrediction,
}

fn asked(text: &str) -> (TimelyPrediction, Vec<String>) {
    let document = Document::parse("s.toml", text).unwrap();
    let file: File = toml::from_str(text).unwrap();
    let mut problems = Problems::new();
    file.timely_prediction.check(&document, &mut problems);
    (file.timely_prediction, problems.iter().map(ToString::to_string).collect())
}

/// A pedestrian who accelerates from standstill at a constant 1 m/s².
fn faster() -> Recording {
    let samples = (0..60).map(|k: i64| (k, Point2::new(0.5 * 0.01 * (k * k) as f64, 0.0))).collect();
    let extent = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 };
    let track = RecordedTrack { id: ActorId(1), kind: ActorKind::Pedestrian, extent, samples };
    Recording { step: swerve_core::Span::from_ms(100), tracks: vec![track], lanes: None }
}

#[test]
fn latency_extends_the_horizon_and_careless_reading_adds_the_motion_meanwhile() {
    let (mut asked, problems) = asked(TEXT);
    assert_eq!(problems, [] as [&str; 0]);
    asked.truth_s = 1.0;
    let by = |name| {
        let by = Foreteller { name, truth_s: 1.0 };
        Errors::of(&[faster()], &by, (8, 1), &asked)
    };
    let straight = by(PredictorName::ConstantVelocity);
    assert_eq!(straight.windows, 60 - 7 - 35);
    // The mean velocity of the last half second is that of 0.25 s ago, so the path lags by 0.25 t + t²/2 after t.
    let off_m = |t: f64| 0.25 * t + 0.5 * t * t;
    for (late_s, ahead_s) in [(0.0, 1.0), (0.5, 1.0), (0.2, 3.0), (0.0, 0.0)] {
        let found = straight.mean_m(late_s + ahead_s).unwrap();
        assert!((found - off_m(late_s + ahead_s)).abs() < 1e-3, "{late_s} {ahead_s}: {found}");
    }
    // Read carelessly at the present, 500 ms late: the motion during half a second at the mean speed of the windows,
    // plus the acceleration.
    let late = asked.latencies_ms.iter().position(|ms| *ms == 500).unwrap();
    let mean_mps = 0.1 * (7.0 + 24.0) / 2.0;
    assert!((straight.careless_m[late].unwrap() - (0.5 * mean_mps + 0.125)).abs() < 1e-3);
    // `truth` is exact for its horizon of one second and continues straight on after it.
    let truth = by(PredictorName::Truth);
    assert!(truth.mean_m(1.0).unwrap() < 1e-9 && truth.mean_m(0.35).unwrap() < 1e-9);
    assert!((truth.mean_m(2.0).unwrap() - (0.05 + 0.5)).abs() < 1e-3, "{:?}", truth.mean_m(2.0));
    // It reaches the other's error after 1 s when t/20 + t²/2 = 0.75 m, with t from its horizon on.
    let set = OfSet { name: "x", unseen_per_s: 0.0, errors: vec![straight, truth] };
    let t = -0.05 + (0.0025_f64 + 1.5).sqrt();
    let late_ms = set.may_be_late_ms(1, 1).unwrap();
    assert!((late_ms - 1e3 * t).abs() < 2.0, "{late_ms}");
    assert!(set.may_be_late_ms(0, 2).unwrap().abs() < 1e-6);
    assert_eq!(set.may_be_late_ms(1, 3), None, "longer than the tracks are");
}

#[test]
fn missing_sets_are_reported_and_the_others_evaluated() {
    let (asked, _) = asked(TEXT);
    let measured = asked.measure(Path::new("/")).unwrap();
    assert_eq!((measured.sets.len(), &measured.absent[..]), (1, &["lost"][..]));
    let text = measured.text();
    for expected in
        ["lost: its data are not there", "truth of 1 s", "falls behind constant_velocity", "(150 ms)"]
    {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    // Six latencies, four horizons, three predictors.
    assert_eq!(measured.csv().lines().count(), 1 + 3 * 6 * 4);
    assert_eq!(measured.crossover_csv().lines().count(), 1 + 3 * 3);
    let svg = measured.draw("a title").svg();
    assert!(svg.starts_with("<svg") && svg.contains("made, 3 s ahead") && !svg.contains("NaN"), "{svg}");
    assert_eq!(measured.csv(), asked.measure(Path::new("/")).unwrap().csv(), "the same twice");
}

#[test]
fn wrong_table_is_reported_by_its_key() {
    let said = |from: &str, to: &str| {
        assert!(TEXT.contains(from));
        asked(&TEXT.replacen(from, to, 1)).1.join("\n")
    };
    assert!(said("\"truth\", \"linear\"", "\"linear\", \"linear\"").contains("expected each once"));
    assert!(said("[100, 150, 200]", "[100, 150]").contains("run_time[0].ms"));
    assert!(said("horizon_s = 3", "horizon_s = 0").contains("expected 1 to 20"));
    assert!(said("seeds = [5, 5]", "seeds = [5, 4]").contains("set[0].made.seeds"));
    assert!(said("every = 7", "every = 0").contains("set[0].every"));
}
