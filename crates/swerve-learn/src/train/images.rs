//! Sets of labelled images: their description in recipes, and the rendering of random streets.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use swerve_core::digest_of;
use swerve_drive::problems_error;
use swerve_report::files::write_whole;
use swerve_scene::WeatherPreset;
use swerve_stack::Registry;
use swerve_text::{Document, Problem};

use super::detector::Pictures;
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
        self.focal_of(f64::from(self.width_px))
    }

    /// Focal length in images of another width, pixels.
    pub(in crate::train) fn focal_of(&self, width_px: f64) -> f64 {
        0.5 * width_px / swerve_geom::math::tan(0.5 * self.fov_deg.to_radians())
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

/// Images of a range of random streets, or labelled pictures.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ImageSet {
    pub(in crate::train) name: String,
    pub(in crate::train) purpose: Purpose,
    /// First street, and the one after the last.
    streets: Option<[u32; 2]>,
    /// Seed of the drives.
    seed: Option<u32>,
    weather: Option<WeatherPreset>,
    /// Labelled pictures in place of streets, for detectors.
    pub(in crate::train) pictures: Option<Pictures>,
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

/// Error at a key of a recipe, with its file and line.
pub(super) fn error_at(recipe: &Path, key: &str, error: &anyhow::Error) -> anyhow::Error {
    let problem = Document::read(recipe).map(|document| document.problem(key, format!("{error:#}")));
    problems_error(&[problem.unwrap_or_else(|problem| problem)])
}

/// Checks the camera and the sets; each purpose needs at least one set.
pub(super) fn check(
    camera: Option<&Camera>,
    sets: &[ImageSet],
    purposes: &[Purpose],
    ensure: &mut dyn FnMut(bool, String, &str),
) {
    if let Some(camera) = camera {
        check_camera(camera, ensure);
    }
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
        let held_out: Vec<&ImageSet> = sets
            .iter()
            .filter(|other| (other.purpose == Purpose::Training) != (set.purpose == Purpose::Training))
            .collect();
        match &set.pictures {
            Some(pictures) => {
                let rendered = set.streets.is_some() || set.seed.is_some() || set.weather.is_some();
                let either = "expected either `pictures`, or `streets`, `seed` and `weather`";
                ensure(!rendered, format!("set[{k}].pictures"), either);
                pictures.check(k, ensure);
                let mut others = held_out.iter().filter_map(|other| other.pictures.as_ref());
                ensure(
                    !others.any(|other| other.shares_with(pictures)),
                    format!("set[{k}].pictures"),
                    "expected pictures that are not both trained on and held out: another folder, or a `share` apart",
                );
            }
            None => check_streets((k, set), camera, &held_out, ensure),
        }
    }
    for purpose in purposes {
        let has = sets.iter().any(|set| set.purpose == *purpose);
        ensure(has, "set".into(), "expected sets for all purposes");
    }
}

fn check_camera(camera: &Camera, ensure: &mut dyn FnMut(bool, String, &str)) {
    ensure((64..=4096).contains(&camera.width_px), "camera.width_px".into(), "expected 64 to 4096");
    ensure((64..=4096).contains(&camera.height_px), "camera.height_px".into(), "expected 64 to 4096");
    ensure(camera.fov_deg > 1.0 && camera.fov_deg < 170.0, "camera.fov_deg".into(), "expected 1 to 170");
    let height = camera.height_m > 0.0 && camera.height_m <= 100.0;
    ensure(height, "camera.height_m".into(), "expected more than 0, at most 100");
    let period = (1.0..=60_000.0).contains(&camera.period_ms);
    ensure(period, "camera.period_ms".into(), "expected 1 to 60000");
}

/// Checks a set to be rendered.
fn check_streets(
    (k, set): (usize, &ImageSet),
    camera: Option<&Camera>,
    held_out: &[&ImageSet],
    ensure: &mut dyn FnMut(bool, String, &str),
) {
    let given = [
        ("streets", set.streets.is_some()),
        ("seed", set.seed.is_some()),
        ("weather", set.weather.is_some()),
    ];
    for (key, given) in given {
        let expected = format!("expected `{key}`: a set has `streets`, `seed` and `weather`, or `pictures`");
        ensure(given, format!("set[{k}].{key}"), &expected);
    }
    let key = format!("set[{k}].streets");
    ensure(camera.is_some(), key.clone(), "expected the table `[camera]`: streets are rendered");
    let Some(streets) = set.streets else { return };
    ensure(streets[0] < streets[1], key.clone(), "expected the first, and one more than the last");
    let mut others = held_out.iter().filter_map(|other| other.streets);
    let shared = others.any(|other| streets[0] < other[1] && other[0] < streets[1]);
    ensure(!shared, key, "expected streets that are not both trained on and held out");
}

/// Folder of a set's images in KITTI format, below a data folder; rendered if missing.
pub(super) fn rendered(
    camera: &Camera,
    set: &ImageSet,
    data: &Path,
    registry: &Registry,
) -> anyhow::Result<PathBuf> {
    let (Some(range), Some(seed), Some(weather)) = (set.streets, set.seed, set.weather) else {
        bail!("set `{}`: expected `streets`, `seed` and `weather`", set.name);
    };
    let camera = camera_text(camera);
    let streets: Vec<(u32, String)> = (range[0]..range[1]).map(|k| (k, street(k))).collect();
    let key = digest_of(&(&camera, &streets, seed, weather.name()));
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
        let (seeds, weathers) = (vec![seed], vec![weather]);
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
