//! Time to load OpenDRIVE files, with the index of their lanes, and projections per second: `map_times FILE...`.

use std::hint::black_box;
use std::time::Instant;

use swerve_geom::{FrenetPoint, Point2};
use swerve_map::{LaneHint, LaneIndex, Map};
use swerve_map_io::import::import;
use swerve_map_io::links::Links;
use swerve_map_io::opendrive::Network;

/// Repetitions of a load; the fastest counts.
const ROUNDS: usize = 9;

/// Projections timed together: shorter than a time slice of the system.
const PART: usize = 500;

/// Projections per measurement.
const POINTS: usize = 200_000;

#[expect(clippy::print_stdout, reason = "the result of an example")]
fn main() {
    println!(
        "file KiB read_ms links_ms map_ms index_ms ms_per_MB cold_per_us hint_per_us brute_per_us worst_mm"
    );
    for file in std::env::args().skip(1) {
        let Ok(bytes) = swerve_text::read_bytes(file.as_ref(), swerve_map_io::FILE_MAX) else { continue };
        let text = String::from_utf8_lossy(&bytes);
        let name = file.rsplit('/').next().unwrap_or_default();
        match measured(&file, &text) {
            Ok(figures) => println!("{name} {} {figures}", bytes.len() >> 10),
            Err(problems) => println!("{name} {problems}"),
        }
    }
}

/// Milliseconds of the fastest round, and the result.
#[expect(clippy::disallowed_methods, reason = "it measures")]
fn fastest<R>(mut work: impl FnMut() -> R) -> (f64, R) {
    let mut round = || {
        let start = Instant::now();
        let result = work();
        (start.elapsed().as_secs_f64() * 1e3, result)
    };
    let mut best = round();
    for _ in 1..ROUNDS {
        let other = round();
        if other.0 < best.0 {
            best = other;
        }
    }
    best
}

/// Milliseconds for all points: the sum over parts of the fastest round of each, which other programs disturb little.
#[expect(clippy::disallowed_methods, reason = "it measures")]
fn summed(points: &[Point2], mut work: impl FnMut(&[Point2]) -> f64) -> f64 {
    let mut fastest = vec![f64::INFINITY; points.len().div_ceil(PART)];
    for _ in 0..ROUNDS {
        for (fastest, part) in fastest.iter_mut().zip(points.chunks(PART)) {
            let start = Instant::now();
            black_box(work(black_box(part)));
            *fastest = fastest.min(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    fastest.iter().sum()
}

fn measured(file: &str, text: &str) -> Result<String, String> {
    let (read_ms, network) = fastest(|| Network::read(file, text));
    let network = network.map_err(|problems| problems.to_string())?;
    let (links_ms, links) = fastest(|| Links::of(&network));
    let (map_ms, imported) = fastest(|| import(&network, &links));
    let map = imported.map_err(|error| error.to_string())?.map;
    let (index_ms, index) = fastest(|| LaneIndex::new(&map));
    let (scattered, driven) = points(&map);
    let cold_ms = summed(&scattered, |points| {
        points.iter().filter_map(|point| index.nearest(*point)).map(|found| found.place.d_m).sum()
    });
    let mut hint = LaneHint::default();
    let hint_ms = summed(&driven, |points| {
        points
            .iter()
            .filter_map(|point| index.nearest_from(*point, &mut hint))
            .map(|found| found.place.d_m)
            .sum()
    });
    let few = &scattered[..scattered.len().min(500)];
    let brute_ms = summed(few, |points| {
        points.iter().filter_map(|point| map.nearest(*point)).map(|found| found.place.d_m).sum()
    });
    let count = |points: &[Point2]| points.len() as f64 / 1e3;
    let worst_m = scattered.iter().step_by(40).map(|point| apart_m(&map, &index, *point)).fold(0.0, f64::max);
    let all_ms = read_ms + links_ms + map_ms + index_ms;
    Ok(format!(
        "{read_ms:.2} {links_ms:.2} {map_ms:.2} {index_ms:.2} {:.1} {:.2} {:.2} {:.3} {:.6}",
        all_ms / (text.len() as f64 / 1e6),
        count(&scattered) / cold_ms,
        count(&driven) / hint_ms,
        count(few) / brute_ms,
        worst_m * 1e3,
    ))
}

/// Points beside lanes in a scattered order, and along lanes, a decimetre apart.
fn points(map: &Map) -> (Vec<Point2>, Vec<Point2>) {
    let lanes = map.lanes();
    let scattered = (0..POINTS).map(|k| {
        let lane = &lanes[(k * 7919) % lanes.len()];
        let share = |n: usize| ((k * n) % 1000) as f64 / 1000.0;
        let d_m = 4.0 * share(613) - 2.0;
        lane.line.to_map(FrenetPoint { s_m: share(271) * lane.line.length(), d_m })
    });
    let along = lanes.iter().cycle().flat_map(|lane| {
        let steps = (lane.line.length() / 0.1) as usize;
        (0..=steps).map(|k| lane.line.to_map(FrenetPoint { s_m: 0.1 * k as f64, d_m: 0.3 }))
    });
    (scattered.collect(), along.take(POINTS).collect())
}

/// Difference of the distances to the lanes that index and search of all lanes find.
fn apart_m(map: &Map, index: &LaneIndex, point: Point2) -> f64 {
    let distance_m = |found: swerve_map::LanePlace| {
        let line = &map.lanes()[found.lane.0 as usize].line;
        line.at(found.place.s_m.clamp(0.0, line.length())).pose.point().distance(point)
    };
    match (map.nearest(point), index.nearest(point)) {
        (Some(a), Some(b)) => (distance_m(a) - distance_m(b)).abs(),
        _ => f64::INFINITY,
    }
}
