//! Labelled images: made where they are absent, and read.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use swerve_core::digest_of;
use swerve_report::files::write_whole;
use swerve_stack::Registry;
use swerve_vision::Rgb;
use swerve_vision::acf::iou;

use super::recipe::{Camera, Class, ImageSet, Recipe};
use super::street::street;
use crate::dataset::{self, DatasetArgs};

/// More hidden than this (KITTI's level) or beyond the image's edge is not counted.
const OCCLUDED_MAX: u32 = 1;
const TRUNCATED_MAX: f64 = 0.3;

/// An image and what is in it.
pub(super) struct Labelled {
    pub(super) size: [usize; 2],
    rgb: Vec<u8>,
    truths: Vec<Truth>,
}

/// A line of KITTI's labels.
struct Truth {
    kind: String,
    truncated: f64,
    occluded: u32,
    /// Left, top, width, height.
    bbox: [f64; 4],
    /// Along the optical axis.
    depth_m: f64,
}

impl Labelled {
    /// A noisy image of cars, all of them whole, none behind another: grey boxes with dark wheels.
    #[cfg(test)]
    pub(super) fn drawn(size: [usize; 2], seed: u64) -> Self {
        let mut rng = swerve_core::Rng::keyed(seed, "drawn", &[]);
        let mut rgb: Vec<u8> = (0..3 * size[0] * size[1]).map(|_| 90 + rng.below(40) as u8).collect();
        let mut truths = Vec::new();
        for k in 0..3 {
            let [left, top] = [10 + 50 * k + rng.below(8), 20 + rng.below(30)];
            for (x, y) in (0..23).flat_map(|x| (0..20).map(move |y| (x, y))) {
                let shade = if y > 15 && x % 16 < 7 { 10 } else { 200 };
                rgb[3 * ((top + y) * size[0] + left + x)..][..3].fill(shade);
            }
            let bbox = [left as f64, top as f64, 23.0, 20.0];
            truths.push(Truth { kind: "Car".into(), truncated: 0.0, occluded: 0, bbox, depth_m: 20.0 });
        }
        Self { size, rgb, truths }
    }

    pub(super) fn rgb(&self) -> Rgb<'_> {
        Rgb::new(self.size[0], self.size[1], &self.rgb).expect("the size was that of the file")
    }

    /// Boxes of a class, with whether they are to be found: they are if they are near and enough of them is visible.
    /// What is near to the class is among them, and is not to be found.
    pub(super) fn wanted(&self, class: Class, within_m: f64) -> Vec<([f64; 4], bool)> {
        let one = |truth: &Truth| {
            let visible = truth.occluded <= OCCLUDED_MAX && truth.truncated <= TRUNCATED_MAX;
            match class.is(&truth.kind) {
                Some(false) => None,
                Some(true) => Some((truth.bbox, visible && truth.depth_m <= within_m)),
                None => Some((truth.bbox, false)),
            }
        };
        self.truths.iter().filter_map(one).collect()
    }

    /// Boxes of a class that are to be learnt: whole ones, nearly.
    pub(super) fn examples(&self, class: Class, within_m: f64) -> impl Iterator<Item = [f64; 4]> {
        let clean = move |truth: &&Truth| {
            let visible = truth.occluded == 0 && truth.truncated <= 0.1;
            class.is(&truth.kind) == Some(true) && visible && truth.depth_m <= within_m
        };
        self.truths.iter().filter(clean).map(|truth| truth.bbox)
    }

    /// The largest overlap of a box with any of a class, or near to it.
    pub(super) fn overlap(&self, class: Class, bbox: [f64; 4]) -> f64 {
        let own = self.truths.iter().filter(|truth| class.is(&truth.kind) != Some(false));
        own.map(|truth| iou(truth.bbox, bbox)).fold(0.0, f64::max)
    }
}

/// The images of a set below a folder; rendered first, where they are not there.
pub(super) fn images(
    recipe: &Recipe,
    set: &ImageSet,
    data: &Path,
    registry: &Registry,
) -> anyhow::Result<Vec<Labelled>> {
    let camera = camera_text(&recipe.camera);
    let streets: Vec<(u32, String)> = (set.streets[0]..set.streets[1]).map(|k| (k, street(k))).collect();
    let key = digest_of(&(&camera, &streets, set.seed, set.weather.name()));
    let out = data.join(format!("{}-{key}", set.name));
    // The index is what a data set ends with.
    if !out.join("index.csv").exists() {
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
        dataset::run(
            &DatasetArgs {
                scenarios,
                out: out.clone(),
                config: Some(config),
                set: Vec::new(),
                seeds,
                weathers,
            },
            registry,
        )?;
    }
    read(&out.join("kitti/training"))
}

pub(super) fn camera_text(camera: &Camera) -> String {
    format!(
        "[camera.front]\nat_m = [1.75, 0.0, {:?}]\nwidth_px = {}\nheight_px = {}\nfov_deg = {:?}\nperiod_ms = {:?}\n\
         outputs = [\"rgb\", \"depth\", \"semantic\", \"instance\"]\n[render]\nthreads = 1\n",
        camera.height_m, camera.width_px, camera.height_px, camera.fov_deg, camera.period_ms
    )
}

/// All samples of a folder in KITTI's form, in order of their names.
fn read(folder: &Path) -> anyhow::Result<Vec<Labelled>> {
    let labels = folder.join("label_2");
    let entries = std::fs::read_dir(&labels).with_context(|| format!("reading {}", labels.display()))?;
    let mut paths: Vec<PathBuf> = entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
    paths.sort();
    let sample = |path: &PathBuf| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let image = folder.join("image_2").join(name + ".png");
        let ([width, height], rgb) = read_png(&image)?;
        let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
        let line = |(k, line): (usize, &str)| {
            truth(line)
                .ok_or_else(|| anyhow!("{}:{}: expected a label as KITTI has them", path.display(), k + 1))
        };
        let truths = text.lines().enumerate().map(line).collect::<anyhow::Result<_>>()?;
        Ok(Labelled { size: [width, height], rgb, truths })
    };
    paths.iter().map(sample).collect()
}

/// Width, height and bytes of an image of 8 bits a colour.
pub fn read_png(path: &Path) -> anyhow::Result<([usize; 2], Vec<u8>)> {
    let reading = || format!("reading {}", path.display());
    let file = std::io::BufReader::new(std::fs::File::open(path).with_context(reading)?);
    let mut decoder = png::Decoder::new(file);
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info().with_context(reading)?;
    let size = reader.output_buffer_size().with_context(|| format!("{}: too large", path.display()))?;
    let mut bytes = vec![0; size];
    let info = reader.next_frame(&mut bytes).with_context(reading)?;
    bytes.truncate(info.buffer_size());
    let rgb = match info.color_type {
        png::ColorType::Rgb => bytes,
        png::ColorType::Rgba => bytes.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect(),
        png::ColorType::Grayscale => bytes.iter().flat_map(|v| [*v; 3]).collect(),
        png::ColorType::GrayscaleAlpha => bytes.chunks_exact(2).flat_map(|p| [p[0]; 3]).collect(),
        png::ColorType::Indexed => anyhow::bail!("{}: expected an image in colours", path.display()),
    };
    Ok(([info.width as usize, info.height as usize], rgb))
}

fn truth(line: &str) -> Option<Truth> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let number = |k: usize| fields.get(k).and_then(|field| field.parse::<f64>().ok());
    let [left, top, right, bottom] = [number(4)?, number(5)?, number(6)?, number(7)?];
    Some(Truth {
        kind: (*fields.first()?).to_owned(),
        truncated: number(1)?,
        occluded: fields.get(2)?.parse().ok()?,
        bbox: [left, top, right - left, bottom - top],
        depth_m: number(13)?,
    })
}
