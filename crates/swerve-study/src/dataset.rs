//! `swerve dataset`: labelled images and point clouds of scenarios, in the forms of KITTI and COCO.
//!
//! Each frame of one camera is a sample: colour, depth, classes and instances, the newest turn of one lidar, and
//! every actor that has a pixel in it. Labels are the simulator's truth. With `--tracks` the ways of everybody instead.

mod coco;
mod kitti;
mod sample;
#[cfg(test)]
mod tests;
mod tracks;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, bail};
use swerve_drive::trust::CodeArgs;
use swerve_drive::{drive_observed, load_config, read_scenario};
use swerve_geom::{Ego, Lidar, Transform};
use swerve_gpu as gpu;
use swerve_report::files::{claim, write_whole};
use swerve_report::progress::Progress;
use swerve_scene::WeatherPreset;
use swerve_stack::Registry;
use swerve_stack::config::Config;
use swerve_stack::config::camera::{CameraConfig, Output, RenderBackend};
use swerve_stack::config::sensors::LidarConfig;

use coco::Coco;
use kitti::Kitti;
use sample::{Collector, Sample};

/// `swerve dataset`.
#[derive(clap::Args, Debug)]
pub struct DatasetArgs {
    /// Scenario files (TOML)
    #[arg(required_unless_present = "crossing")]
    pub(crate) scenarios: Vec<PathBuf>,
    /// Output folder; must be empty or absent
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// Configuration file with one camera, and a lidar or none; several: the later over the earlier [default: a camera
    /// and a lidar as KITTI's]
    #[arg(short, long)]
    pub(crate) config: Vec<PathBuf>,
    /// Set a configuration key
    #[arg(long, value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    #[command(flatten)]
    pub(crate) code: CodeArgs,
    /// Where everybody goes, ten times a second, in place of images: CSV as CommonRoad's recorded scenarios
    #[arg(long, conflicts_with = "weathers")]
    pub(crate) tracks: bool,
    /// With --tracks, for each seed also a minute at a made crossing with lights, cars that keep their distance, and so many
    /// people who make way
    #[arg(long, value_name = "PEOPLE", requires = "tracks", value_parser = clap::value_parser!(u16).range(0..=200))]
    pub(crate) crossing: Option<u16>,
    /// Seeds: every scenario is driven once with each
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
    if args.tracks {
        refuse_occupied(&args.out)?;
        return swerve_report::output::print(&tracks::write(args, registry)?);
    }
    let mut base = base(args, registry)?;
    if base.render.backend == RenderBackend::Auto {
        (base.render.backend, _) = RenderBackend::Auto.on_this_machine(&gpu::probe());
    }
    let (camera, lidar) = sensors(&base)?;
    refuse_occupied(&args.out)?;
    let _held = claim(&args.out)?;
    let scenarios: Vec<_> =
        args.scenarios.iter().map(|path| read_scenario(path)).collect::<anyhow::Result<_>>()?;
    let drives = scenarios.len() * args.seeds.len() * args.weathers.len();
    let progress = Progress::drives(drives);
    let mut writer = Writer::new(&args.out, &base, &camera, lidar.as_ref().map(|(_, mount)| *mount))?;
    for scenario in &scenarios {
        for &seed in &args.seeds {
            for &weather in &args.weathers {
                let mut config = base.clone();
                (config.seed, config.render.weather) = (u64::from(seed), weather);
                let origin = format!("{},{seed},{}", scenario.name, weather.name());
                let mut write = |sample: &Sample<'_>| writer.add(sample, &origin);
                let mut collector = Collector::new(&camera, lidar.clone(), &mut write);
                drive_observed(&config, scenario, 1, &mut [&mut collector])?;
                collector.finish()?;
                progress.one_done();
            }
        }
    }
    progress.finish();
    let count = writer.finish()?;
    swerve_report::output::print(&format!("{count} samples of {drives} drives in {}\n", args.out.display()))
}

fn refuse_occupied(out: &Path) -> anyhow::Result<()> {
    let occupied = std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some());
    if occupied {
        bail!(
            "{}: expected an empty folder, or none: samples are never mixed (those of an interrupted call lack `index.csv`)",
            out.display()
        );
    }
    Ok(())
}

fn configured(args: &DatasetArgs, registry: &Registry) -> anyhow::Result<Config> {
    load_config(registry, &args.config, &args.set, args.code)
}

fn base(args: &DatasetArgs, registry: &Registry) -> anyhow::Result<Config> {
    let mut config = configured(args, registry)?;
    if args.config.is_empty() && config.camera.is_empty() {
        let (camera, lidar) = KITTI_LIKE;
        config.camera.insert(camera.into(), kitti_camera());
        config.lidar.insert(lidar.into(), LidarConfig::default());
    }
    config.log.sensors = config.camera.keys().chain(config.lidar.keys()).cloned().collect();
    Ok(config)
}

/// 1242 x 375 pixels, 1.65 m up, a frame every 100 ms.
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

/// A lidar's name, and where it sits.
type Mounted = (String, Transform<Ego, Lidar>);

/// The name of the camera, and the lidar.
fn sensors(config: &Config) -> anyhow::Result<(String, Option<Mounted>)> {
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

/// Both forms, and which drive each sample is of.
struct Writer {
    out: PathBuf,
    kitti: Kitti,
    coco: Coco,
    index: String,
    count: usize,
}

impl Writer {
    fn new(
        out: &Path,
        config: &Config,
        camera: &str,
        ego_from_lidar: Option<Transform<Ego, Lidar>>,
    ) -> anyhow::Result<Self> {
        let missing = || anyhow!("the camera is not in the configuration");
        let camera = config.camera.get(camera).ok_or_else(missing)?;
        let kitti = Kitti::new(&out.join("kitti/training"), camera, ego_from_lidar)?;
        let index = "sample,scenario,seed,weather,stamp_s,cloud_stamp_s\n".to_owned();
        Ok(Self { out: out.to_owned(), kitti, coco: Coco::default(), index, count: 0 })
    }

    fn add(&mut self, sample: &Sample<'_>, origin: &str) -> anyhow::Result<()> {
        let name = format!("{:06}", self.count);
        self.kitti.add(&name, sample)?;
        self.coco.add(&name, self.count, sample);
        let cloud = sample.cloud.map_or_else(String::new, |cloud| format!("{:.3}", cloud.stamp.as_secs()));
        self.index += &format!("{name},{origin},{:.3},{cloud}\n", sample.rgb.stamp.as_secs());
        self.count += 1;
        Ok(())
    }

    fn finish(self) -> anyhow::Result<usize> {
        let folder = self.out.join("coco");
        std::fs::create_dir_all(&folder).with_context(|| format!("making {}", folder.display()))?;
        write_whole(&folder.join("instances.json"), self.coco.json()?.as_bytes())?;
        write_whole(&self.out.join("index.csv"), self.index.as_bytes())?;
        Ok(self.count)
    }
}
