//! Localization on one core: the filter, lidar scans along `scenarios/street.toml` matched with a map and with each
//! other, and the pair of scans beside the repository, with the times of small_gicp in the same run if the Python of
//! `SWERVE_PYTHON` has it.

mod street;

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::Path;

use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, named, now, python};
use swerve_core::{Span, Time};
use swerve_geom::{Ego, Map, Point, Transform};
use swerve_lidar::{Cloud, Firing, SceneTree, Sweeper};
use swerve_localization::map_file::MapFile;
use swerve_localization::matcher::{Guess, Matcher};
use swerve_localization::ndt::{self, Isometry3, Limits, Matched, Vector3};
use swerve_localization::odometry::Odometry;
use swerve_localization::sweep::Sweep;
use swerve_localization::voxels::{VoxelMap, VoxelSums, coarser};
use swerve_localization::{Initial, Localizer, Params, Sensed, downsampled, ply};
use swerve_stack::config::sensors::LidarConfig;
use swerve_stack::street::EGO_INSTANCE;
use swerve_vehicle::VehicleParams;

/// Motion of the lidar in one scan, metres: 14 m/s at 10 Hz.
const STEP_M: f64 = 1.4;
const VOXEL_M: f64 = 1.0;
const ROUNDS: usize = 15;

/// Milliseconds since an instant.
fn ms(since: std::time::Instant) -> f64 {
    1e3 * since.elapsed().as_secs_f64()
}

/// The filter alone, driving with fixes at 10 Hz.
fn filter(rows: &mut Rows, seconds: i64) {
    let initial = Initial {
        position_m: Vector3::zeros(),
        velocity_mps: Vector3::x() * 14.0,
        attitude: Isometry3::identity().rotation,
        sigma: [0.5, 0.1, 0.02],
    };
    let params = Params::default();
    let (accel_mps2, gyro_radps) = ([0.0, 0.0, params.gravity_mps2], [0.0; 3]);
    let mut localizer =
        Localizer::starting_at(params, Time::ZERO, &initial).expect("parameters in their range");
    let mut fixes = Vec::new();
    for k in 1..=100 * seconds {
        let stamp = Time::ZERO + Span::from_ms(10 * k);
        localizer.take(stamp, Sensed::Imu { accel_mps2, gyro_radps });
        if k % 10 == 0 {
            let at_m = [0.14 * k as f64, 0.0, 0.0];
            let start = now();
            black_box(localizer.take(stamp, Sensed::Fix { at_m, sigma_m: [0.5, 0.5, 1.0] }));
            fixes.push(1e3 * ms(start));
        }
    }
    let mut filter = localizer.filter().expect("it has started").clone();
    let [accel, gyro] = [accel_mps2, gyro_radps].map(Vector3::from);
    let steps = (0..10 * seconds).map(|_| {
        let start = now();
        (0..100).for_each(|_| filter.predict(black_box(&params), &accel, &gyro, 0.01));
        10.0 * ms(start)
    });
    let sample = Sample::new(steps.collect());
    rows.row("filter, a prediction", sample.median(), &sample.text(2, "us"), Goal::Most(2.0));
    let sample = Sample::new(fixes);
    rows.row("filter, a fix taken in order", sample.median(), &sample.text(2, "us"), Goal::Most(5.0));
}

/// A scan: pose of the lidar at its end, and its measured points with their time before the end as a share of the scan.
struct Turn {
    map_from_lidar: Isometry3<f64>,
    points: Vec<(Vector3<f64>, f64)>,
}

/// Scans of a roof-mounted lidar along the street, with at most this many columns.
fn turns(steps: usize, columns: u32) -> Vec<Turn> {
    let vehicle = VehicleParams::default();
    let (scenario, street) = street::at_start(&vehicle);
    let mut tree = SceneTree::default();
    tree.update(street.scene()).expect("a sound scene");
    let lidar = LidarConfig::default();
    let mut spec = lidar.spec(1).expect("a preset");
    spec.columns = spec.columns.min(columns);
    let mut sweeper = Sweeper::new(spec, 1).expect("a sound lidar");
    let mut cloud = Cloud::new(sweeper.spec(), true);
    let ego_from_lidar = lidar.ego_from_lidar(&vehicle.shape);
    let turn = |k: usize| {
        let pose = scenario.road.line().at(STEP_M * k as f64).pose;
        let at = Point::new(pose.x_m, pose.y_m, 0.0);
        let map_from_ego: Transform<Map, Ego> =
            Transform::from_roll_pitch_yaw(at, 0.0, 0.0, pose.heading_rad);
        let map_from_lidar = map_from_ego * ego_from_lidar;
        let rest = Firing::turn_at_rest(&sweeper, map_from_lidar);
        let firing = Firing { hidden_instance: Some(EGO_INSTANCE), ..rest };
        cloud.len = 0;
        sweeper.begin_turn(k as u64, &mut cloud.as_mut());
        sweeper.fire(&tree, &firing, &mut cloud.as_mut()).expect("a sound firing");
        // Motion distortion: points fired first are seen from further back.
        let measured = |point: usize| {
            let share = (point + 1) as f64 / cloud.len as f64 - 1.0;
            let at_end = Vector3::from(cloud.point_m(point).map(f64::from));
            (at_end - Vector3::x() * (STEP_M * share), share)
        };
        Turn { map_from_lidar: map_from_lidar.isometry(), points: (0..cloud.len).map(measured).collect() }
    };
    (0..steps).map(turn).collect()
}

/// Approximate motion of a forward-facing lidar during one scan.
fn motion() -> Isometry3<f64> {
    Isometry3::translation(STEP_M, 0.0, 0.0)
}

/// This many points of each scan, evenly spread.
fn thinned(turns: &[Turn], count: usize) -> Vec<Turn> {
    let of = |turn: &Turn| {
        let len = turn.points.len();
        let points = (0..count.min(len)).map(|k| turn.points[k * len / count.min(len)]).collect();
        Turn { map_from_lidar: turn.map_from_lidar, points }
    };
    turns.iter().map(of).collect()
}

fn map(turns: &[Turn]) -> MapFile {
    let (mut sums, sweep) = (VoxelSums::new(VOXEL_M), Sweep::steady(&motion()));
    for turn in turns {
        let Turn { map_from_lidar, points } = turn;
        for point in sweep.straightened(points) {
            sums.add(&(map_from_lidar.rotation * point + map_from_lidar.translation.vector));
        }
    }
    MapFile::new(VOXEL_M, sums.voxels())
}

/// Milliseconds of each scan, the fastest of several rounds: the time without disturbance by the host.
fn fastest(rounds: usize, mut round: impl FnMut() -> Vec<f64>) -> Vec<f64> {
    let mut least = round();
    for _ in 1..rounds {
        least.iter_mut().zip(round()).for_each(|(least, ms)| *least = least.min(ms));
    }
    least
}

/// Localization of scans on a map.
fn on_a_map(rows: &mut Rows, map: &MapFile, turns: &[Turn], goals: [Goal; 2], rounds: usize) {
    let (sweep, motion) = (Sweep::steady(&motion()), motion());
    let start = turns[0].map_from_lidar * Isometry3::translation(-0.5, 0.3, 0.0);
    let guess = Guess { map_from_lidar: start, sigma_m: 1.0, sigma_rad: 0.09, particles: 200 };
    let (mut matcher, mut missed) = (Matcher::new(map, 1, guess), 0);
    let mut took = fastest(rounds, || {
        matcher.begin_at(guess);
        let mut since = Isometry3::identity();
        let take = |turn: &Turn| {
            let began = now();
            missed += usize::from(matcher.take(&turn.points, &sweep, &since).is_none());
            since = motion;
            ms(began)
        };
        turns.iter().map(take).collect()
    });
    let first_ms = took.remove(0);
    let (count, took) = (longest(turns), Sample::new(took));
    let reads = format!("{}, {missed} unmatched", took.text(2, "ms"));
    rows.row(&format!("a turn of {count} points on a map"), took.median(), &reads, goals[0]);
    let most = took.at(0.99);
    rows.row("  of a hundred 99 take at most", most, &format!("{most:.2} ms"), goals[1]);
    rows.row("  the first one, looked around for", first_ms, &format!("{first_ms:.1} ms"), Goal::None);
}

/// Scan-to-scan odometry.
fn odometry(rows: &mut Rows, turns: &[Turn], rounds: usize) {
    let (sweep, motion) = (Sweep::steady(&motion()), motion());
    let took = fastest(rounds, || {
        let mut odometry = Odometry::new();
        let take = |turn: &Turn| {
            let began = now();
            black_box(odometry.take_moved(&turn.points, &sweep, &motion));
            ms(began)
        };
        turns.iter().map(take).collect()
    });
    let (count, took) = (longest(turns), Sample::new(took));
    let reads = format!("{}, 99 %: {:.1} ms", took.text(1, "ms"), took.at(0.99));
    rows.row(&format!("lidar odometry, a turn of {count} points"), took.median(), &reads, Goal::None);
}

fn longest(turns: &[Turn]) -> usize {
    turns.iter().map(|turn| turn.points.len()).max().unwrap_or(0)
}

/// Milliseconds of small_gicp in this run, by task; empty if this Python (`SWERVE_PYTHON`) does not have it.
fn of_small_gicp(folder: &Path) -> BTreeMap<String, f64> {
    named(&python("localization/speed.py", &[folder]))
}

/// Result of a match and its times: thinning and mapping, then the match.
fn matched(source: &[Vector3<f64>], target: &[Vector3<f64>]) -> Option<(Matched, [f64; 2])> {
    let began = now();
    let scan = downsampled(source, 0.25);
    let mut sums = VoxelSums::new(2.0);
    target.iter().for_each(|point| sums.add(point));
    let voxels = sums.voxels();
    let (fine, coarse) = (VoxelMap::new(2.0, &voxels), VoxelMap::new(4.0, &coarser(&voxels, 2.0, 2)));
    let prepared = ms(began);
    let began = now();
    let found = ndt::align(&[&coarse, &fine], &scan, &Isometry3::identity(), &Limits::default())?;
    Some((found, [prepared, ms(began)]))
}

fn pair(rows: &mut Rows) {
    let what = "pair of scans, the match";
    let Some(folder) = swerve_tests::data("localization/registration_pair") else {
        return rows.skipped(what, "needs localization/registration_pair among the test data");
    };
    let cloud = |name: &str| {
        ply::read(&std::fs::read(folder.join(name)).expect("the folder is there")).expect("a cloud")
    };
    let (source, target) = (cloud("source.ply"), cloud("target.ply"));
    let text = std::fs::read_to_string(folder.join("T_target_source.txt")).expect("the folder is there");
    let numbers: Vec<f64> = text.split_ascii_whitespace().filter_map(|word| word.parse().ok()).collect();
    let reference = ndt::pose_of(&numbers.try_into().expect("4 x 4 numbers")).expect("a pose");
    let all: Vec<_> = (0..ROUNDS).map(|_| matched(&source, &target).expect("they match")).collect();
    let off = reference.inverse() * all[0].0.map_from_scan;
    let (off_cm, off_deg) = (100.0 * off.translation.vector.norm(), off.rotation.angle().to_degrees());
    let alone = Sample::new(all.iter().map(|(_, [_, ms])| *ms).collect());
    let all_in = Sample::new(all.iter().map(|(_, [before, ms])| before + ms).collect());
    rows.row("pair of scans, off the reference", off_cm, &format!("{off_cm:.1} cm"), Goal::Most(2.0));
    rows.row("  its heading and tilt", off_deg, &format!("{off_deg:.2}°"), Goal::Most(0.4));
    rows.row(what, alone.median(), &alone.text(2, "ms"), Goal::Most(17.5));
    let theirs = of_small_gicp(&folder);
    let beside = |rows: &mut Rows, what: &str, name: &str, took: &Sample, goal: Goal| match theirs.get(name) {
        Some(theirs) => {
            let share = took.median() / theirs;
            rows.row(what, share, &format!("{share:.2} ({theirs:.1} ms)"), goal);
        }
        None => rows.skipped(what, "needs a Python with small_gicp (SWERVE_PYTHON)"),
    };
    beside(rows, "  over small_gicp's VGICP", "vgicp", &alone, Goal::Most(1.5));
    rows.row("pair of scans, thinned and mapped too", all_in.median(), &all_in.text(2, "ms"), Goal::None);
    beside(rows, "  over small_gicp's, with what goes before", "vgicp_all_in", &all_in, Goal::None);
}

fn main() {
    let is_measured = is_asked_to_measure();
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "localization");
    filter(&mut rows, if is_measured { 60 } else { 1 });
    let steps = if is_measured { 150 } else { 3 };
    let turns = turns(steps, if is_measured { u32::MAX } else { 200 });
    let map = map(&turns);
    let rounds = if is_measured { 9 } else { 1 };
    let [few, many] = [30_000, 54_000].map(|count| thinned(&turns, count));
    on_a_map(&mut rows, &map, &few, [Goal::Most(10.0), Goal::Most(20.0)], rounds);
    on_a_map(&mut rows, &map, &many, [Goal::None; 2], rounds);
    odometry(&mut rows, &many, rounds.min(3));
    if is_measured {
        pair(&mut rows);
    }
    rows.finish();
}
