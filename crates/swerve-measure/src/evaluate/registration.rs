//! `swerve eval registration`: pose of one point cloud in another.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{anyhow, bail};
use clap::ValueEnum;
use serde::Serialize;
use swerve_eval::median;
use swerve_localization::centred::Centred;
use swerve_localization::ndt::{self, Agreement, Isometry3, Limits, Neighbours, Vector3};
use swerve_localization::voxels::{VoxelMap, VoxelSums, coarser};
use swerve_localization::{downsampled, icp, ply};
use swerve_report::files::read_whole;

use super::input::{self, number, wrong};

/// Two point clouds and the matching method.
#[derive(clap::Args, Debug)]
pub(super) struct RegistrationArgs {
    /// Point cloud to be moved (.ply)
    source: PathBuf,
    /// Fixed point cloud (.ply)
    target: PathBuf,
    /// Matching method
    #[arg(long, value_enum, default_value = "ndt")]
    method: Method,
    /// Voxel size of the target's map, metres [default: 2, point to point 1]
    #[arg(long, value_name = "M")]
    resolution_m: Option<f64>,
    /// Voxel size for thinning the source to one point each, metres
    #[arg(long, value_name = "M", default_value_t = 0.25)]
    thin_m: f64,
    /// Initial pose of the source: a text of 4 x 4 numbers [default: that of the target]
    #[arg(long, value_name = "FILE")]
    guess: Option<PathBuf>,
    /// True pose of the source: a text of 4 x 4 numbers, for reporting the error
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Number of repetitions; the reported times are medians
    #[arg(long, value_name = "N", default_value_t = 1)]
    repeat: u16,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
}

impl RegistrationArgs {
    fn resolution_m(&self) -> f64 {
        self.resolution_m.unwrap_or(if self.method == Method::Icp { 1.0 } else { RESOLUTION_M })
    }
}

/// Default voxel size of the normal distributions, metres.
const RESOLUTION_M: f64 = 2.0;

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Method {
    /// Normal distributions transform, each point matched with the voxel that contains it (DIRECT1)
    Ndt,
    /// Normal distributions transform, also matched with the six adjacent voxels (DIRECT7)
    Ndt7,
    /// Point to point
    Icp,
}

/// Result of `swerve eval registration`.
#[derive(Serialize)]
struct Report {
    target_from_source: [[f64; 4]; 4],
    /// Reason why the pose is unusable; absent for a usable pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<String>,
    /// Time of the matching alone.
    time_ms: f64,
    /// Time of thinning the source and building the target's map.
    prepare_ms: f64,
    iterations: u32,
    converged: bool,
    overlap: f64,
    points: [usize; 2],
    points_thinned: usize,
    likelihood: f64,
    min_eigenvalue_per_m2: f64,
    degenerate: u32,
    informed: f64,
    /// Error at the centre of the source, metres; far from it, a heading error would dominate.
    #[serde(skip_serializing_if = "Option::is_none")]
    error_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error_deg: Option<f64>,
}

/// Result of a match.
struct Found {
    pose: Isometry3<f64>,
    iterations: u32,
    converged: bool,
    /// Agreement with the target's normal distributions, for every method.
    agreement: Agreement,
    points_thinned: usize,
    ms: [f64; 2],
}

/// Minimum share of their own information that two clouds have on each other, along every direction of the pose.
/// Measured: at least 0.32 at correct poses of whole clouds and 0.22 of halves; at most 0.23 at local optima 1 to 30 m
/// away (two scenes, three methods, 230 starts).
const INFORMED_MIN: f64 = 0.25;
/// Minimum number of points that determine a pose.
const POINTS_MIN: u32 = 10;

impl Found {
    /// True if the last step was short and, as far as the surfaces constrain it, the pose is correct.
    fn has_converged(&self) -> bool {
        self.converged && (self.agreement.degenerate > 0 || self.agreement.informed >= INFORMED_MIN)
    }

    /// Reason why the pose must not be used.
    fn problem(&self) -> Option<String> {
        let Agreement { hits, degenerate, informed, .. } = self.agreement;
        if hits < POINTS_MIN {
            Some(format!(
                "degenerate: {hits} points on surfaces of the target, at least {POINTS_MIN} are needed"
            ))
        } else if !self.converged {
            Some(format!("not converged after {} iterations", self.iterations))
        } else if degenerate > 0 {
            Some(format!("degenerate: the surfaces leave {degenerate} of 6 directions of the pose open"))
        } else if !self.has_converged() {
            Some(format!(
                "not converged: a local optimum, where the clouds have {:.0} % of their information on the pose, at least {:.0} % \
                 are needed; a better --guess may help",
                100.0 * informed,
                100.0 * INFORMED_MIN
            ))
        } else {
            None
        }
    }
}

/// Report as text, and the reason why its pose must not be used.
///
/// # Errors
/// If a file cannot be read or has another format, or if the clouds have nothing in common.
pub(super) fn told(args: &RegistrationArgs) -> anyhow::Result<(String, Option<String>)> {
    for (name, value) in [("--resolution-m", args.resolution_m()), ("--thin-m", args.thin_m)] {
        if !(0.01..=100.0).contains(&value) {
            bail!("{name}: expected 0.01 to 100, found {value}");
        }
    }
    if !(1..=1000).contains(&args.repeat) {
        bail!("--repeat: expected 1 to 1000, found {}", args.repeat);
    }
    let [source, target] = [&args.source, &args.target].map(|path| cloud(path));
    let (source, target) = (Centred::new(&source?), Centred::new(&target?));
    let guess = args.guess.as_deref().map(pose).transpose()?.unwrap_or_else(Isometry3::identity);
    let guess = source.pose_in(&target, &guess);
    let reference = args.reference.as_deref().map(pose).transpose()?;
    let nothing = || {
        let (source, target) = (args.source.display(), args.target.display());
        anyhow!("{source}: degenerate, no match: too few of its points lie on surfaces of {target}")
    };
    let mut found = matched(args, &source.points, &target.points, &guess).ok_or_else(nothing)?;
    let mut ms = vec![found.ms];
    for _ in 1..args.repeat {
        ms.push(matched(args, &source.points, &target.points, &guess).ok_or_else(nothing)?.ms);
    }
    found.ms = [0, 1].map(|k| median(ms.iter().map(|ms| ms[k])).unwrap_or(f64::NAN));
    let problem = found.problem();
    let off = reference.map(|reference| source.pose_in(&target, &reference).inverse() * found.pose);
    let m = source.pose_of(&target, &found.pose).to_homogeneous();
    let report = Report {
        target_from_source: [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| m[(i, j)])),
        problem: problem.clone(),
        time_ms: found.ms[1],
        prepare_ms: found.ms[0],
        iterations: found.iterations,
        converged: found.has_converged(),
        overlap: found.agreement.overlap,
        points: [source.points.len(), target.points.len()],
        points_thinned: found.points_thinned,
        likelihood: found.agreement.likelihood,
        min_eigenvalue_per_m2: found.agreement.min_eigenvalue_per_m2,
        degenerate: found.agreement.degenerate,
        informed: found.agreement.informed,
        error_m: off.map(|off| off.translation.vector.norm()),
        error_deg: off.map(|off| off.rotation.angle().to_degrees()),
    };
    let text = if args.json { serde_json::to_string_pretty(&report)? + "\n" } else { text(&report) };
    let problem =
        problem.map(|problem| format!("{} in {}: {problem}", args.source.display(), args.target.display()));
    Ok((text, problem))
}

fn text(report: &Report) -> String {
    let rows = report.target_from_source.map(|row| row.map(|x| format!("{x:12.6}")).join(" "));
    format!(
        "{}\n{} iterations, {:.1} ms, {:.1} ms to prepare; {:.1} % of {} points on surfaces\n{}{}",
        rows.join("\n"),
        report.iterations,
        report.time_ms,
        report.prepare_ms,
        100.0 * report.overlap,
        report.points_thinned,
        match (report.error_m, report.error_deg) {
            (Some(m), Some(deg)) => format!("{m:.4} m, {deg:.3}° from the reference\n"),
            _ => String::new(),
        },
        report.problem.as_ref().map_or_else(String::new, |problem| format!("{problem}\n")),
    )
}

#[expect(
    clippy::disallowed_methods,
    reason = "what is measured is how long a match takes; no result depends on it"
)]
fn now() -> Instant {
    Instant::now()
}

fn matched(
    args: &RegistrationArgs,
    source: &[Vector3<f64>],
    target: &[Vector3<f64>],
    guess: &Isometry3<f64>,
) -> Option<Found> {
    let begun = now();
    let scan = downsampled(source, args.thin_m);
    let since = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
    let points_thinned = scan.len();
    // Results of point-to-point matching are evaluated on surfaces, too.
    let voxels_m = if args.method == Method::Icp { RESOLUTION_M } else { args.resolution_m() };
    let mut sums = VoxelSums::new(voxels_m);
    target.iter().for_each(|point| sums.add(point));
    let voxels = sums.voxels();
    let fine = VoxelMap::new(voxels_m, &voxels);
    let coarse = VoxelMap::new(2.0 * voxels_m, &coarser(&voxels, voxels_m, 2));
    let (pose, iterations, converged, ready) = if args.method == Method::Icp {
        let mut map = icp::PointMap::new(args.resolution_m(), 20);
        map.add(&downsampled(target, args.thin_m));
        let ready = now();
        let found = icp::align(&map, &scan, guess, [args.resolution_m(); 2], 100)?;
        (found.map_from_scan, found.iterations, found.converged, ready)
    } else {
        let ready = now();
        let neighbours = if args.method == Method::Ndt7 { Neighbours::Direct7 } else { Neighbours::Direct1 };
        let limits = Limits { neighbours, ..Limits::default() };
        let found = ndt::align(&[&coarse, &fine], &scan, guess, &limits)?;
        (found.map_from_scan, found.iterations, found.converged, ready)
    };
    let ms = [since(begun, ready), since(ready, now())];
    let mut agreement = ndt::agreement(&coarse, &scan, &pose)?;
    // Also in reverse, so that parts of the target missing in the source are detected.
    let of_source = VoxelMap::of_points(coarse.resolution_m(), &scan);
    let back = ndt::agreement(&of_source, &downsampled(target, args.thin_m), &pose.inverse());
    let informed = agreement.informed.max(0.0) * back.map_or(0.0, |back| back.informed.max(0.0));
    agreement.informed = informed.sqrt();
    Some(Found { pose, iterations, converged, agreement, points_thinned, ms })
}

fn cloud(path: &Path) -> anyhow::Result<Vec<Vector3<f64>>> {
    let at = path.display();
    let bytes = read_whole(path)?;
    ply::read(&bytes).map_err(|error| anyhow!("{at}: {error}"))
}

/// Reads a transform of four rows of four numbers.
fn pose(path: &Path) -> anyhow::Result<Isometry3<f64>> {
    let text = input::text(path)?;
    let mut numbers = Vec::new();
    for (k, line) in text.lines().enumerate() {
        for word in line.split_ascii_whitespace() {
            numbers.push(number("a number of 4 x 4", word).map_err(|what| wrong(path, k + 1, what))?);
        }
    }
    let found = numbers.len();
    let rows: [f64; 16] = numbers
        .try_into()
        .map_err(|_| anyhow!("{}: expected 4 x 4 numbers, found {found}", path.display()))?;
    ndt::pose_of(&rows).ok_or_else(|| {
        anyhow!("{}: expected a rotation and a translation, and 0 0 0 1 in the last row", path.display())
    })
}
