//! Sets of labelled images of random streets: their description in recipes, and their rendering.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use swerve_core::digest_of;
use swerve_drive::problems_error;
use swerve_report::files::write_whole;
use swerve_scene::WeatherPreset;
use swerve_stack::Registry;
use swerve_text::{Document, Problem};

use super::street::street;
use crate::dataset::{self, DatasetArgs};

/// Camera of the images, level and facing straight ahead.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Camera {
    pub(in crate::train) width_px: u32,
    pub(in crate::train) height_px: u32,
    pub(in crate::train) fov_deg: f64,
    /// Height above the ground, metres.
    pub(in crate::train) height_m: f64,
    pub(in crate::train) period_ms: f64,
}

impl Camera {
    /// Focal length, pixels.
    pub(in crate::train) fn focal_px(&self) -> f64 {
        0.5 * f64::from(self.width_px) / swerve_geom::math::tan(0.5 * self.fov_deg.to_radians())
    }
}

/// Purpose of an image set.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Purpose {
    Training,
    /// Calibration of scores to probabilities.
    Calibration,
    Test,
}

/// Images of a range of streets.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ImageSet {
    pub(in crate::train) name: String,
    pub(in crate::train) purpose: Purpose,
    /// First street, and the one after the last.
    pub(in crate::train) streets: [u32; 2],
    /// Seed of the drives.
    pub(in crate::train) seed: u32,
    pub(in crate::train) weather: WeatherPreset,
}

/// Reads and checks a recipe. Returns it with its text.
pub(super) fn read<T: DeserializeOwned>(
    path: &Path,
    problems: impl Fn(&T, &Document) -> Vec<Problem>,
) -> anyhow::Result<(T, String)> {
    let text =
        swerve_text::read_text(path).map_err(|e| problems_error(&[swerve_text::unreadable(path, &e)]))?;
    let document =
        Document::parse(&path.display().to_string(), &text).map_err(|problem| problems_error(&[problem]))?;
    let recipe: T = document.to().map_err(|problems| problems_error(&problems))?;
    let problems = problems(&recipe, &document);
    if problems.is_empty() { Ok((recipe, text)) } else { Err(problems_error(&problems)) }
}

/// Checks the camera and the sets; each purpose needs at least one set.
pub(super) fn check(
    camera: &Camera,
    sets: &[ImageSet],
    purposes: &[Purpose],
    ensure: &mut dyn FnMut(bool, String, &str),
) {
    ensure((64..=4096).contains(&camera.width_px), "camera.width_px".into(), "expected 64 to 4096");
    ensure((64..=4096).contains(&camera.height_px), "camera.height_px".into(), "expected 64 to 4096");
    ensure(camera.fov_deg > 1.0 && camera.fov_deg < 170.0, "camera.fov_deg".into(), "expected 1 to 170");
    let height = camera.height_m > 0.0 && camera.height_m <= 100.0;
    ensure(height, "camera.height_m".into(), "expected more than 0, at most 100");
    let period = (1.0..=60_000.0).contains(&camera.period_ms);
    ensure(period, "camera.period_ms".into(), "expected 1 to 60000");
    for (k, set) in sets.iter().enumerate() {
        let is_name = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        let named =
            set.name.starts_with(|c: char| c.is_ascii_alphanumeric()) && set.name.chars().all(is_name);
        ensure(
            named,
            format!("set[{k}].name"),
            "expected letters, digits, `-`, `_` and `.`: a folder is named so",
        );
        let first = sets[..k].iter().all(|other| other.name != set.name);
        ensure(first, format!("set[{k}].name"), "expected a name that no other set has");
        ensure(
            set.streets[0] < set.streets[1],
            format!("set[{k}].streets"),
            "expected the first, and one more than the last",
        );
        let others = sets
            .iter()
            .filter(|other| (other.purpose == Purpose::Training) != (set.purpose == Purpose::Training));
        let shared = others
            .into_iter()
            .any(|other| set.streets[0] < other.streets[1] && other.streets[0] < set.streets[1]);
        ensure(
            !shared,
            format!("set[{k}].streets"),
            "expected streets that are not both trained on and held out",
        );
    }
    for purpose in purposes {
        let has = sets.iter().any(|set| set.purpose == *purpose);
        ensure(has, "set".into(), "expected sets for all purposes");
    }
}

/// Folder of a set's images in KITTI format, below a data folder; rendered if missing.
pub(super) fn rendered(
    camera: &Camera,
    set: &ImageSet,
    data: &Path,
    registry: &Registry,
) -> anyhow::Result<PathBuf> {
    let camera = camera_text(camera);
    let streets: Vec<(u32, String)> = (set.streets[0]..set.streets[1]).map(|k| (k, street(k))).collect();
    let key = digest_of(&(&camera, &streets, set.seed, set.weather.name()));
    let out = data.join(format!("{}-{key}", set.name));
    if !dataset::is_complete(&out) {
        let texts = data.join("streets");
        std::fs::create_dir_all(&texts).with_context(|| format!("making {}", texts.display()))?;
        let config = data.join("camera.toml");
        write_whole(&config, camera.as_bytes())?;
        let file = |(k, text): &(u32, String)| -> anyhow::Result<PathBuf> {
            let path = texts.join(format!("street_{k}.toml"));
            write_whole(&path, text.as_bytes())?;
            Ok(path)
        };
        let scenarios = streets.iter().map(file).collect::<anyhow::Result<_>>()?;
        let (seeds, weathers) = (vec![set.seed], vec![set.weather]);
        dataset::make(
            &DatasetArgs {
                code: Default::default(),
                scenarios,
                out: out.clone(),
                config: vec![config],
                set: Vec::new(),
                seeds,
                weathers,
                tracks: false,
                crossing: None,
            },
            registry,
        )?;
    }
    Ok(out.join("kitti/training"))
}

pub(super) fn camera_text(camera: &Camera) -> String {
    format!(
        "[camera.front]\nat_m = [1.75, 0.0, {:?}]\nwidth_px = {}\nheight_px = {}\nfov_deg = {:?}\nperiod_ms = {:?}\n\
         outputs = [\"rgb\", \"depth\", \"semantic\", \"instance\"]\n",
        camera.height_m, camera.width_px, camera.height_px, camera.fov_deg, camera.period_ms
    )
}
