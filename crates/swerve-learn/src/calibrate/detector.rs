//! `swerve calibrate detector`: fits a detector's emulation to a published accuracy over frames of the scenarios.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, ensure};
use rayon::prelude::*;
use swerve_core::{Rng, Span, Time};
use swerve_drive::shipped::Kind;
use swerve_drive::{CodeArgs, OverwriteArgs, drive_observed, load_config, read_scenario};
use swerve_eval::{AveragePrecision, Found, ground_iou, image_iou, volume_iou};
use swerve_flow::{Event, Observer};
use swerve_geom::{Point2, math};
use swerve_measure::labels::{VISIBLE_SHARE_MIN, true_box};
use swerve_msg::truth::{Surroundings, WorldState};
use swerve_msg::{ActorKind, DetectedBox};
use swerve_perception::Detector;
use swerve_perception::detector::{Params, Sensing};
use swerve_perception::image_box::ImageCamera;
use swerve_report::progress::Progress;
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::config::detectors::{Fit, Kinds, Measure, Overlap, Published, find, published};
use swerve_stack::config::perception::{CUSTOM, TRUTH, image_camera};
use swerve_stack::{ObstacleSight, Registry};
use swerve_text::did_you_mean;

/// `swerve calibrate detector`.
#[derive(clap::Args, Debug)]
pub(crate) struct DetectorArgs {
    /// Published detector to emulate, such as efficientdet-d3@v100
    #[arg(required_unless_present_any = ["all", "ap"], conflicts_with_all = ["all", "ap"])]
    name: Option<String>,
    /// Fit all published detectors and write the table of their fits
    #[arg(long, conflicts_with = "ap")]
    all: bool,
    /// Average precision to meet, for a custom camera detector
    #[arg(long, value_name = "0..1", value_parser = share)]
    ap: Option<f64>,
    /// Configurations to drive the scenarios with, the later over the earlier; the result is written into them
    #[arg(short, long)]
    config: Vec<PathBuf>,
    /// Set a configuration key
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    code: CodeArgs,
    /// Folder of the scenarios; subfolders are ignored [default: the built-in scenarios]
    #[arg(long)]
    scenarios: Option<PathBuf>,
    /// Seeds to drive each scenario with
    #[arg(long, value_delimiter = ',', default_value = "1,2")]
    seeds: Vec<u32>,
    /// Seed of the detector's draws
    #[arg(long, default_value_t = 1)]
    draws_seed: u32,
    /// Range limit: only nearer objects count, m
    #[arg(long, default_value_t = 50.0, value_parser = distance)]
    within_m: f64,
    /// Write to this file instead of standard output
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteArgs,
}

fn share(text: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(ap) if (0.01..=0.99).contains(&ap) => Ok(ap),
        _ => Err("expected 0.01 to 0.99".to_owned()),
    }
}

fn distance(text: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(m) if (1.0..=1000.0).contains(&m) => Ok(m),
        _ => Err("expected 1 to 1000 m".to_owned()),
    }
}

/// Time between two frames: consecutive frames add little information.
const EVERY: Span = Span::from_ms(200);

/// Number of error draws over the same frames. Their mean precision is fitted, as that of a single draw jumps.
const DRAWS: u32 = 16;

/// Deviation of the precision at which the fit stops; 0.02 is required.
const CLOSE: f64 = 0.002;

/// Runs `swerve calibrate detector`.
pub(crate) fn run(args: &DetectorArgs, registry: &Registry) -> anyhow::Result<()> {
    let base = load_config(registry, &args.config, &args.set, args.code)?;
    args.overwrite.check(args.out.as_deref())?;
    let targets = targets(args)?;
    let scenarios = scenarios(args.scenarios.as_deref())?;
    let frames = BySensing::gather(&base, &scenarios, &args.seeds, &targets)?;
    let unlike = unlike(&targets);
    let progress = Progress::fits(unlike.len());
    let fit = |target: &Target| {
        let fitted = fit(target, frames.of(target.sensing), args.draws_seed, args.within_m);
        let fitted = fitted.with_context(|| format!("fitting {}", target.name))?;
        progress.tell(&format!(
            "{:>38}: to meet {:.3}, met {:.3} (held out {:.3}) at error level {:.4}",
            target.name, target.ap, fitted.fit.ap, fitted.fit.ap_held_out, fitted.fit.error_level
        ));
        progress.one_done();
        Ok(fitted)
    };
    let fitted: anyhow::Result<Vec<Fitted>> = unlike.par_iter().map(|target| fit(target)).collect();
    progress.finish();
    let fitted = fitted?;
    let text = match (&targets[..], &fitted[..]) {
        ([target], [fitted]) if !args.all => {
            let scenarios = scenarios.iter().map(|scenario| scenario.name.clone()).collect();
            frozen(&base, target, fitted, scenarios, args)?
        }
        _ => {
            let of = |target: &Target| unlike.iter().position(|first| first.is_like(target));
            let all = targets.iter().filter_map(|target| Some((target, &fitted[of(target)?])));
            table(args, &all.collect::<Vec<_>>())
        }
    };
    match &args.out {
        Some(path) => swerve_report::files::write_whole(path, text.as_bytes()),
        None => swerve_report::output::print(&text),
    }
}

/// Accuracy to fit.
#[derive(Clone, PartialEq, Debug)]
struct Target {
    name: String,
    ap: f64,
    sensing: Sensing,
    measure: Measure,
}

impl Target {
    fn of(detector: &Published) -> Self {
        let Published { name, ap, sensing, measure, .. } = detector;
        Self { name: name.clone(), ap: *ap, sensing: *sensing, measure: *measure }
    }
}

impl Target {
    /// True if the same fit meets both targets.
    fn is_like(&self, other: &Self) -> bool {
        (self.ap, self.sensing, self.measure) == (other.ap, other.sensing, other.measure)
    }
}

/// One target of each group with the same fit.
fn unlike(targets: &[Target]) -> Vec<&Target> {
    let is_first = |k: usize| !targets[..k].iter().any(|earlier| earlier.is_like(&targets[k]));
    (0..targets.len()).filter(|k| is_first(*k)).map(|k| &targets[k]).collect()
}

fn targets(args: &DetectorArgs) -> anyhow::Result<Vec<Target>> {
    if let Some(ap) = args.ap {
        let measure = Measure::default();
        return Ok(vec![Target { name: CUSTOM.into(), ap, sensing: Sensing::Camera, measure }]);
    }
    let Some(name) = &args.name else { return Ok(published().iter().map(Target::of).collect()) };
    let unknown = || {
        let near = did_you_mean(name, published().iter().map(|d| d.name.as_str()));
        anyhow!("unknown detector `{name}`{near}")
    };
    Ok(vec![Target::of(find(name).ok_or_else(unknown)?)])
}

/// Scenarios with actors: those directly in a folder, or the built-in ones.
fn scenarios(folder: Option<&Path>) -> anyhow::Result<Vec<Scenario>> {
    let all: Vec<Scenario> = match folder {
        Some(folder) => {
            let mut files = swerve_report::files::toml_files(folder)?;
            files.retain(|file| file.parent() == Some(folder));
            files.iter().map(|file| read_scenario(file)).collect::<Result<_, _>>()?
        }
        None => {
            let shipped = Kind::Scenario.all().filter(|(name, _)| !name.contains('/'));
            shipped.map(|(_, file)| file.scenario()).collect::<Result<_, _>>()?
        }
    };
    let peopled: Vec<Scenario> = all.into_iter().filter(|scenario| !scenario.actors.is_empty()).collect();
    let of = folder.map_or_else(|| "the program".to_owned(), |folder| folder.display().to_string());
    ensure!(!peopled.is_empty(), "{of}: no scenarios with actors");
    Ok(peopled)
}

/// Frames with the visible obstacles, and the camera if there is one.
#[derive(Default)]
pub(crate) struct Frames {
    camera: Option<ImageCamera>,
    /// Frames, each with the index of its drive.
    frames: Vec<(u64, Surroundings)>,
}

impl Frames {
    /// Drives the scenarios with perfect perception and collects what a detector with this sensor could see.
    pub(crate) fn gather(
        base: &Setup,
        sensing: Sensing,
        scenarios: &[Scenario],
        seeds: &[u32],
        done: impl Fn(),
    ) -> anyhow::Result<Self> {
        let camera = base.detector_camera(sensing);
        let mut frames = Vec::new();
        for (k, scenario) in scenarios.iter().enumerate() {
            for (n, &seed) in seeds.iter().enumerate() {
                let mut config = base.clone();
                (config.seed, config.perception.detector) = (u64::from(seed), TRUTH.into());
                let sensor = ObstacleSight::new(&config, camera.as_ref());
                let mut watch = Watch { sensor, next: Time::ZERO, frames: Vec::new() };
                drive_observed(&config, scenario, 1, &mut [&mut watch])?;
                let drive = (k * seeds.len() + n) as u64;
                frames.extend(watch.frames.into_iter().map(|seen| (drive, seen)));
                done();
            }
        }
        Ok(Self { camera: camera.as_ref().and_then(image_camera), frames })
    }
}

/// Frames for camera detectors and for lidar detectors.
#[derive(Default)]
struct BySensing {
    camera: Frames,
    lidar: Frames,
}

impl BySensing {
    fn gather(
        base: &Setup,
        scenarios: &[Scenario],
        seeds: &[u32],
        targets: &[Target],
    ) -> anyhow::Result<Self> {
        let asked = |sensing| targets.iter().any(|target| target.sensing == sensing);
        let kinds = usize::from(asked(Sensing::Camera)) + usize::from(asked(Sensing::Lidar));
        let progress = Progress::drives(kinds * scenarios.len() * seeds.len());
        let of = |sensing| match asked(sensing) {
            true => Frames::gather(base, sensing, scenarios, seeds, || progress.one_done()),
            false => Ok(Frames::default()),
        };
        let both = Self { camera: of(Sensing::Camera)?, lidar: of(Sensing::Lidar)? };
        progress.finish();
        Ok(both)
    }

    fn of(&self, sensing: Sensing) -> &Frames {
        match sensing {
            Sensing::Camera => &self.camera,
            Sensing::Lidar => &self.lidar,
        }
    }
}

/// Collects the visible obstacles during a drive.
struct Watch {
    sensor: ObstacleSight,
    next: Time,
    frames: Vec<Surroundings>,
}

impl Observer for Watch {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::Publication(publication) = event
            && let Some(payload) = publication.payload
            && let Some(world) = payload.downcast_ref::<WorldState>()
            && world.stamp >= self.next
        {
            self.next = world.stamp + EVERY;
            self.frames.push(self.sensor.surroundings(world));
        }
    }
}

/// Average precision of the emulation over frames, as the mean over `draws` draws of its errors, and the number of
/// objects that counted. `None` if none did.
pub(crate) fn measured(
    params: Params,
    measure: Measure,
    frames: &Frames,
    draws: core::ops::Range<u32>,
    within_m: f64,
) -> anyhow::Result<Option<(f64, u64)>> {
    let (mut sum, mut wanted, count) = (0.0, 0, f64::from(draws.end - draws.start));
    for draw in draws {
        let mut precision = AveragePrecision::new(0.5);
        let mut detector: Option<(u64, Detector)> = None;
        for (drive, seen) in &frames.frames {
            // Drives share instants and identities, but not draws.
            let detector = match detector.take().filter(|(of, _)| of == drive) {
                Some(same) => detector.insert(same),
                None => {
                    let seed = Rng::keyed(u64::from(draw), "drive", &[*drive as i64]).bits();
                    detector.insert((*drive, Detector::new(params, frames.camera, seed, "detector")?))
                }
            };
            take(&mut precision, &detector.1, frames.camera.as_ref(), seen, measure, within_m);
        }
        let Some(value) = precision.value(measure.recalls) else { return Ok(None) };
        (sum, wanted) = (sum + value, precision.wanted());
    }
    Ok(Some((sum / count, wanted)))
}

fn take(
    precision: &mut AveragePrecision,
    detector: &Detector,
    camera: Option<&ImageCamera>,
    seen: &Surroundings,
    measure: Measure,
    within_m: f64,
) {
    let is_asked = |kind: ActorKind| measure.kinds == Kinds::All || kind == ActorKind::Pedestrian;
    let mut boxes = detector.detect(seen).boxes;
    boxes.retain(|found| is_asked(found.kind));
    let is_near = |b: &DetectedBox| b.pose.point().distance(Point2::default()) <= within_m;
    let found: Vec<Found> = boxes.iter().map(|b| Found { score: b.score, counts: is_near(b) }).collect();
    let there: Vec<(DetectedBox, bool)> = seen
        .obstacles
        .iter()
        .filter(|obstacle| is_asked(obstacle.kind))
        .map(|obstacle| {
            let truth = true_box(obstacle, seen, camera);
            let has_picture = camera.is_none() || truth.image_px.is_some();
            let counts = is_near(&truth) && obstacle.visible_share >= VISIBLE_SHARE_MIN && has_picture;
            (truth, counts)
        })
        .collect();
    let counts: Vec<bool> = there.iter().map(|(_, counts)| *counts).collect();
    precision.frame(&found, &counts, |f, w| overlap(measure.overlap, &boxes[f], &there[w].0));
}

fn overlap(of: Overlap, a: &DetectedBox, b: &DetectedBox) -> f64 {
    if a.kind != b.kind {
        return 0.0;
    }
    match of {
        Overlap::Image => match (a.image_px, b.image_px) {
            (Some(a), Some(b)) => image_iou(a, b),
            _ => 0.0,
        },
        Overlap::Ground => ground_iou(a, b),
        Overlap::Volume => volume_iou(a, b),
    }
}

/// Fit of a target, and the number of frames and objects behind it.
struct Fitted {
    fit: Fit,
    frames: usize,
    wanted: u64,
}

/// Fits the error level at which the emulation meets the target. Precision falls with the error level: the regula falsi
/// over its logarithm, kept away from both ends of the bracket.
fn fit(target: &Target, frames: &Frames, draws_seed: u32, within_m: f64) -> anyhow::Result<Fitted> {
    let measure = |error_level: f64, first: u32| {
        let params = Params::of_error_level(target.sensing, error_level);
        measured(params, target.measure, frames, first..first + DRAWS, within_m)?
            .context("nothing was to be found in any frame")
    };
    // Bracket between a perfect and a useless detector: logarithm of the error level, and precision.
    let (mut good, mut bad) = ((-3.0, 1.0), (3.0, 0.0));
    let mut best: Option<(f64, f64, u64)> = None;
    for _ in 0..20 {
        let part = ((good.1 - target.ap) / (good.1 - bad.1)).clamp(0.15, 0.85);
        let middle = good.0 + part * (bad.0 - good.0);
        let error_level = round(math::exp(middle));
        let (ap, wanted) = measure(error_level, draws_seed)?;
        if best.is_none_or(|(_, before, _)| (ap - target.ap).abs() < (before - target.ap).abs()) {
            best = Some((error_level, ap, wanted));
        }
        if (ap - target.ap).abs() <= CLOSE {
            break;
        }
        if ap > target.ap { good = (middle, ap) } else { bad = (middle, ap) }
    }
    let (error_level, ap, wanted) = best.context("nothing was measured")?;
    let (other, _) = measure(error_level, draws_seed + DRAWS)?;
    let fit = Fit { error_level, ap: round(ap), ap_held_out: round(other) };
    Ok(Fitted { fit, frames: frames.frames.len(), wanted })
}

/// Rounds to four decimal places, as written to files.
fn round(x: f64) -> f64 {
    (x * 1e4).round() / 1e4
}

/// Configuration with the emulation in it and all its parameters written out.
fn frozen(
    base: &Setup,
    target: &Target,
    fitted: &Fitted,
    scenarios: Vec<String>,
    args: &DetectorArgs,
) -> anyhow::Result<String> {
    let mut config = base.clone();
    let params = Params::of_error_level(target.sensing, fitted.fit.error_level);
    let perception = &mut config.perception;
    perception.detector.clone_from(&target.name);
    perception.params = toml::Table::try_from(params)?;
    Ok(provenance(target, fitted, &scenarios, args)? + &config.to_text())
}

/// Comment that documents a calibration: accuracy, conditions and drives.
fn provenance(
    target: &Target,
    fitted: &Fitted,
    scenarios: &[String],
    args: &DetectorArgs,
) -> anyhow::Result<String> {
    let Fit { error_level, ap, ap_held_out } = fitted.fit;
    let seeds: Vec<String> = args.seeds.iter().map(u32::to_string).collect();
    Ok(format!(
        "# perception.params emulate {}, written by `swerve calibrate detector`.\n\
         # Average precision: target {:?}, reached {ap:?}, {ap_held_out:?} with random numbers that were held out.\n\
         # Error level {error_level:?}; measure {}; objects within {} m.\n\
         # Scenarios {}; seeds {}; draws from seed {}; {} frames with {} objects.\n\n",
        target.name,
        target.ap,
        toml::Value::try_from(target.measure)?,
        args.within_m,
        scenarios.join(", "),
        seeds.join(", "),
        args.draws_seed,
        fitted.frames,
        fitted.wanted
    ))
}

/// File of the built-in fits.
fn table(args: &DetectorArgs, fitted: &[(&Target, &Fitted)]) -> String {
    let seeds: Vec<String> = args.seeds.iter().map(u32::to_string).collect();
    let frames: BTreeMap<String, usize> =
        fitted.iter().map(|(t, f)| (format!("{:?}", t.sensing), f.frames)).collect();
    let frames: Vec<String> = frames.iter().map(|(sensing, n)| format!("{n} by {sensing}")).collect();
    let mut text = format!(
        "# Written by `swerve calibrate detector --all`: which member of the family meets each published accuracy,\n\
         # and the average precision that it has. Drives with seeds {}, {DRAWS} draws from seed {}, everything within\n\
         # {} m. Frames: {}.\n",
        seeds.join(", "),
        args.draws_seed,
        args.within_m,
        frames.join(", ").to_lowercase()
    );
    for (name, fit) in fitted.iter().map(|(t, f)| (&t.name, f.fit)).collect::<BTreeMap<_, _>>() {
        text += &format!(
            "\"{name}\" = {{ error_level = {:?}, ap = {:?}, ap_held_out = {:?} }}\n",
            fit.error_level, fit.ap, fit.ap_held_out
        );
    }
    text
}

#[cfg(test)]
mod tests;
