//! `swerve dataset`: labelled images and point clouds of scenarios, in the formats of KITTI and COCO.
//!
//! Each frame of one camera is a sample: colour, depth, classes and instances, the newest turn of one lidar, and all
//! actors with a visible pixel. Labels are the simulator's ground truth. With `--tracks`, the tracks of all road users
//! are written instead.
//!
//! Samples are written drive by drive, each with its line of the index. COCO's list is written at intervals, after each
//! drive and on Ctrl-C. The same call continues an interrupted one after the last finished drive; the result is
//! byte-identical to that of an uninterrupted call.

mod coco;
mod kitti;
mod sample;
mod state;
#[cfg(test)]
mod tests;
mod tracks;

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context as _, anyhow, bail};
use swerve_core::Hasher;
use swerve_drive::interrupt::on_interrupt;
use swerve_drive::program::Program;
use swerve_drive::trust::CodeArgs;
use swerve_drive::{drive_observed, load_config, read_scenario};
use swerve_geom::{Ego, Lidar, Transform};
use swerve_gpu as gpu;
use swerve_report::files::{claim, write_whole};
use swerve_report::progress::Progress;
use swerve_scenario::Scenario;
use swerve_scene::WeatherPreset;
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::camera::{CameraConfig, Output, RenderBackend};
use swerve_stack::config::sensors::LidarConfig;
use swerve_text::{FILE_MAX, read_bytes, read_string};

use coco::Coco;
use kitti::Kitti;
use sample::{Collector, Sample};
pub(crate) use state::{INDEX, is_complete};
use state::{SAMPLES, State};

/// `swerve dataset`.
#[derive(clap::Args, Debug)]
pub struct DatasetArgs {
    /// Scenario files (TOML)
    #[arg(required_unless_present = "crossing")]
    pub(crate) scenarios: Vec<PathBuf>,
    /// Output folder: empty, absent, or with an unfinished data set of the same call, which is continued
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// Configuration file with one camera and at most one lidar; several: the later over the earlier [default: a camera
    /// and a lidar like KITTI's]
    #[arg(short, long)]
    pub(crate) config: Vec<PathBuf>,
    /// Set a configuration key
    #[arg(long, value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    #[command(flatten)]
    pub(crate) code: CodeArgs,
    /// Tracks of all road users at 10 Hz instead of images: CSV like CommonRoad's recorded scenarios
    #[arg(long, conflicts_with = "weathers")]
    pub(crate) tracks: bool,
    /// With --tracks, add for each seed one minute at a generated crossing with traffic lights, cars that keep their
    /// distance, and this many pedestrians who give way
    #[arg(long, value_name = "PEOPLE", requires = "tracks", value_parser = clap::value_parser!(u16).range(0..=200))]
    pub(crate) crossing: Option<u16>,
    /// Seeds; every scenario is driven once with each
    #[arg(long, value_delimiter = ',', default_value = "1")]
    pub(crate) seeds: Vec<u32>,
    /// Weathers, such as clear_noon,hard_rain_sunset,clear_night
    #[arg(long, value_delimiter = ',', default_value = "clear_noon")]
    pub(crate) weathers: Vec<WeatherPreset>,
}

/// A camera and a lidar like those of the KITTI car.
const KITTI_LIKE: (&str, &str) = ("camera", "lidar");

/// Runs `swerve dataset`.
pub fn run(args: &DatasetArgs, registry: &Registry) -> anyhow::Result<()> {
    // Without a handler a signal ends the program at once; the next call then continues after the last finished drive.
    let _handled = on_interrupt(|| {
        let writer = lock(&CURRENT).clone();
        if let Some(writer) = writer {
            let writer = lock(&writer);
            let written = writer.write_lists();
            let at = writer.out.display();
            match written {
                Ok(()) => eprintln!("\n{at}: interrupted, {} samples; the same call continues", writer.count),
                Err(error) => eprintln!("\n{error:#}"),
            }
        }
        std::process::exit(130);
    });
    swerve_report::output::print(&make(args, registry)?)
}

/// Writer to flush when a signal arrives.
static CURRENT: Mutex<Option<Arc<Mutex<Writer>>>> = Mutex::new(None);

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Creates a data set, or continues an unfinished one. Returns the line for the terminal.
pub(crate) fn make(args: &DatasetArgs, registry: &Registry) -> anyhow::Result<String> {
    if args.tracks {
        return tracks::write(args, registry);
    }
    let mut base = base(args, registry)?;
    if base.render.backend == RenderBackend::Auto {
        (base.render.backend, _) = RenderBackend::Auto.on_this_machine(&gpu::probe());
    }
    let (camera, lidar) = sensors(&base)?;
    let scenarios: Vec<_> =
        args.scenarios.iter().map(|path| read_scenario(path)).collect::<anyhow::Result<_>>()?;
    let state = State::open(&args.out, &call(args, &base, &scenarios)?)?;
    let _held = claim(&args.out)?;
    let weathers = |seed: u32| args.weathers.iter().map(move |weather| (seed, *weather));
    let runs: Vec<(&Scenario, u32, WeatherPreset)> = scenarios
        .iter()
        .flat_map(|scenario| {
            args.seeds.iter().flat_map(|&seed| weathers(seed)).map(move |(s, w)| (scenario, s, w))
        })
        .collect();
    let progress = Progress::drives(runs.len());
    let writer = Writer::new(&args.out, &base, &camera, lidar.as_ref().map(|(_, mount)| *mount), state)?;
    let done = writer.state.drives;
    let writer = Arc::new(Mutex::new(writer));
    *lock(&CURRENT) = Some(Arc::clone(&writer));
    (0..done).for_each(|_| progress.one_done());
    for (k, (scenario, seed, weather)) in runs.iter().enumerate().skip(done) {
        let mut config = base.clone();
        (config.seed, config.render.weather) = (u64::from(*seed), *weather);
        let origin = format!("{},{seed},{}", scenario.name, weather.name());
        let mut write = |sample: &Sample<'_>| lock(&writer).add(sample, &origin);
        let mut collector = Collector::new(&camera, lidar.clone(), &mut write);
        drive_observed(&config, scenario, 1, &mut [&mut collector])?;
        collector.finish()?;
        lock(&writer).end_drive(k + 1 == runs.len())?;
        progress.one_done();
    }
    *lock(&CURRENT) = None;
    progress.finish();
    let count = lock(&writer).count;
    Ok(format!("{count} samples of {} drives in {}\n", runs.len(), args.out.display()))
}

/// Digest of all inputs that determine the bytes of a data set.
fn call(args: &DatasetArgs, config: &Setup, scenarios: &[Scenario]) -> anyhow::Result<String> {
    let mut hasher = Hasher::new();
    hasher.value(&(
        Program::digest()?,
        config.to_text(),
        format!("{scenarios:?}"),
        args.tracks,
        args.crossing,
    ));
    for file in config.files() {
        let bytes = read_bytes(file, FILE_MAX).with_context(|| format!("reading {}", file.display()))?;
        hasher.bytes(&bytes);
    }
    let weathers: Vec<&str> = args.weathers.iter().map(|weather| weather.name()).collect();
    hasher.value(&(&args.seeds, weathers));
    Ok(hasher.digest().to_string())
}

fn configured(args: &DatasetArgs, registry: &Registry) -> anyhow::Result<Setup> {
    load_config(registry, &args.config, &args.set, args.code)
}

fn base(args: &DatasetArgs, registry: &Registry) -> anyhow::Result<Setup> {
    let mut config = configured(args, registry)?;
    if args.config.is_empty() && config.camera.is_empty() {
        let (camera, lidar) = KITTI_LIKE;
        config.camera.insert(camera.into(), kitti_camera());
        config.lidar.insert(lidar.into(), LidarConfig::default());
    }
    config.log.sensors = config.camera.keys().chain(config.lidar.keys()).cloned().collect();
    Ok(config)
}

/// Camera with 1242 x 375 pixels, 1.65 m above the ground, one frame every 100 ms.
fn kitti_camera() -> CameraConfig {
    CameraConfig {
        at_m: [1.68, 0.0, 1.65],
        width_px: 1242,
        height_px: 375,
        fov_deg: Some(81.5),
        outputs: Output::ALL.to_vec(),
        period_ms: 100.0,
        ..CameraConfig::default()
    }
}

/// Name and mounting pose of a lidar.
type Mounted = (String, Transform<Ego, Lidar>);

/// Name of the camera, and the lidar if there is one.
fn sensors(config: &Setup) -> anyhow::Result<(String, Option<Mounted>)> {
    let mut cameras = config.camera.iter();
    let (Some((name, camera)), None) = (cameras.next(), cameras.next()) else {
        bail!("a data set is of one camera, the configuration has {}", config.camera.len());
    };
    if let Some(missing) = Output::ALL.into_iter().find(|output| !camera.outputs.contains(output)) {
        bail!(
            "camera.{name}.outputs: expected all of rgb, depth, semantic, instance; `{}` is missing",
            missing.name()
        );
    }
    if !camera.distortion.is_none() {
        bail!("camera.{name}.distortion: expected none: KITTI's images are rectified");
    }
    if camera.m_per_px.is_some() {
        bail!("camera.{name}.m_per_px: expected none: a data set is of a camera with a lens");
    }
    if config.lidar.len() > 1 {
        bail!("a data set is of one lidar at most, the configuration has {}", config.lidar.len());
    }
    let shape = &config.sim.vehicle.shape;
    let lidar = config.lidar.iter().next().map(|(name, lidar)| (name.clone(), lidar.ego_from_lidar(shape)));
    Ok((name.clone(), lidar))
}

/// Writer of both formats and of the index.
struct Writer {
    out: PathBuf,
    kitti: Kitti,
    coco: Coco,
    index: String,
    count: usize,
    /// Number of samples at which the lists are written next within a drive.
    listed_next: usize,
    state: State,
}

impl Writer {
    fn new(
        out: &Path,
        config: &Setup,
        camera: &str,
        ego_from_lidar: Option<Transform<Ego, Lidar>>,
        state: State,
    ) -> anyhow::Result<Self> {
        let missing = || anyhow!("the camera is not in the configuration");
        let camera = config.camera.get(camera).ok_or_else(missing)?;
        let kitti = Kitti::new(&out.join(SAMPLES).join("training"), camera, ego_from_lidar)?;
        let mut index = "sample,scenario,seed,weather,stamp_s,cloud_stamp_s\n".to_owned();
        let mut coco = Coco::default();
        let count = state.samples;
        if count > 0 {
            // The lists may contain samples of the interrupted drive, which is driven again.
            let path = out.join(INDEX);
            let text = read_string(&path, FILE_MAX).with_context(|| format!("reading {}", path.display()))?;
            index = text.split_inclusive('\n').take(1 + count).collect();
            coco = Coco::read(&coco_file(out), count)?;
        }
        state.write(out)?;
        write_whole(&out.join(INDEX), index.as_bytes())?;
        Ok(Self { out: out.to_owned(), kitti, coco, index, count, listed_next: count + 1, state })
    }

    fn add(&mut self, sample: &Sample<'_>, origin: &str) -> anyhow::Result<()> {
        let name = format!("{:06}", self.count);
        self.kitti.add(&name, sample)?;
        self.coco.add(&name, self.count, sample);
        let cloud = sample.cloud.map_or_else(String::new, |cloud| format!("{:.3}", cloud.stamp.as_secs()));
        let line = format!("{name},{origin},{:.3},{cloud}\n", sample.rgb.stamp.as_secs());
        let path = self.out.join(INDEX);
        let appended = std::fs::OpenOptions::new().append(true).open(&path);
        appended
            .and_then(|mut file| file.write_all(line.as_bytes()))
            .with_context(|| format!("writing {}", path.display()))?;
        self.index += &line;
        self.count += 1;
        if self.count < self.listed_next {
            return Ok(());
        }
        // Written at growing intervals, since writing it every time would take quadratic time: after a kill it has at
        // least four fifths of the samples.
        self.listed_next = self.count + self.count / 4 + 1;
        self.write_lists()
    }

    /// Writes the index and COCO's list of the samples so far.
    fn write_lists(&self) -> anyhow::Result<()> {
        let file = coco_file(&self.out);
        let folder = file.parent().unwrap_or(&self.out);
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
        write_whole(&file, self.coco.json()?.as_bytes())?;
        write_whole(&self.out.join(INDEX), self.index.as_bytes())
    }

    fn end_drive(&mut self, is_last: bool) -> anyhow::Result<()> {
        self.write_lists()?;
        (self.state.drives, self.state.samples) = (self.state.drives + 1, self.count);
        self.state.is_complete = is_last;
        self.state.write(&self.out)
    }
}

fn coco_file(out: &Path) -> PathBuf {
    out.join("coco/instances.json")
}
