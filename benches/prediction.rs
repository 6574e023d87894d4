//! Predictors, on one core: 24 vehicles in two lanes of a bend and eight people beside them, 5 s ahead in steps of 0.1
//! s, from 3.2 s of history at 20 Hz.

use std::hint::black_box;

use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, now};
use swerve_core::{Rng, Span, Time};
use swerve_geom::{FrenetPoint, Point2, Polyline, Pose2, Vector2, math};
use swerve_msg::{ActorId, ActorKind, Extent, Route, Sighting, Track, TrackList};
use swerve_prediction::{Ground, Horizon, PredictorName, predict};

/// Number of past observations, and their interval.
const PAST: i64 = 64;
const EVERY_MS: i64 = 50;

/// A bend to the left of 300 m radius, 400 m long.
fn road() -> Route {
    let point = |k: i64| {
        let (sin, cos) = math::sin_cos(k as f64 / 300.0);
        Point2::new(300.0 * sin, 300.0 - 300.0 * cos)
    };
    let line = Polyline::new(&(0..=400).map(point).collect::<Vec<_>>()).expect("a line of 400 m");
    Route::uniform(line, 6.0, 2.0)
}

fn track(id: u32, road: &Route) -> Track {
    let mut rng = Rng::keyed(u64::from(id), "track", &[]);
    let rolls = id < 24;
    let (from_m, d_m) = match rolls {
        true => (15.0 * f64::from(id / 2) + 60.0, 3.5 * f64::from(id % 2)),
        false => (20.0 * f64::from(id - 24) + 80.0, -3.0),
    };
    let speed_mps = if rolls { rng.uniform(9.0, 12.0) } else { rng.uniform(1.0, 1.8) };
    let mut place = |k: i64| {
        let s_m = from_m + speed_mps * 1e-3 * (EVERY_MS * (k - PAST + 1)) as f64;
        let at: Point2 = road.unproject(FrenetPoint { s_m, d_m });
        at + Vector2::new(rng.normal(), rng.normal()) * 0.03
    };
    let sighting = |k: i64| Sighting { at: Time::from_ms(EVERY_MS * k), point: place(k) };
    let history: Vec<Sighting> = (0..PAST).map(sighting).collect();
    let velocity_mps: Vector2 = (history[63].point - history[53].point) * (1e3 / (10 * EVERY_MS) as f64);
    let (kind, extent) = match rolls {
        true => (ActorKind::Car, Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 }),
        false => (ActorKind::Pedestrian, Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 }),
    };
    let now = history[63].point;
    let pose = Pose2::new(now.x_m, now.y_m, velocity_mps.heading());
    Track { id: ActorId(id), kind, pose, extent, velocity_mps, history }
}

fn goal(name: PredictorName) -> Goal {
    match name {
        PredictorName::Multipath | PredictorName::LaneIdm => Goal::Most(1.0),
        PredictorName::Mfp => Goal::Most(15.0),
        PredictorName::R2p2 => Goal::Most(40.0),
        _ => Goal::None,
    }
}

fn main() {
    let road = road();
    let tracks = TrackList {
        stamp: Time::from_ms(EVERY_MS * (PAST - 1)),
        tracks: (0..32).map(|id| track(id, &road)).collect(),
    };
    let horizon = Horizon { steps: 50, step: Span::from_ms(100) };
    let calls = if is_asked_to_measure() { 300 } else { 2 };
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "prediction");
    for name in PredictorName::ALL {
        let ms = (0..calls).map(|_| {
            let start = now();
            black_box(predict(name, black_box(&tracks), &horizon, Ground::Road(&road)));
            1e3 * start.elapsed().as_secs_f64()
        });
        let sample = Sample::new(ms.collect());
        let reads = format!("{:.3} ms, 99 %: {:.3} ms", sample.median(), sample.at(0.99));
        rows.row(&format!("{}, 32 agents, 5 s ahead", name.name()), sample.at(0.99), &reads, goal(name));
    }
    rows.finish();
}
