//! `swerve look --segmentation`: labels the pixels of images.

use std::collections::BTreeMap;

use anyhow::{Context as _, anyhow};
use serde::Serialize;
use swerve_drive::frames::overlay;
use swerve_measure::picture::{Picture, Pictures};
use swerve_report::output;
use swerve_stack::config::camera_detectors;
use swerve_vision::segmentation::{Class, Segmenter};

use super::LookArgs;
use super::objects::ground;

/// Printed result for an image.
#[derive(Serialize)]
struct Report<'a> {
    image: String,
    /// Share of all pixels, by class.
    shares: BTreeMap<&'a str, f64>,
}

/// Labels the pixels of each image.
pub(super) fn run(args: &LookArgs, name: &str) -> anyhow::Result<()> {
    let weights = camera_detectors::segmentation(name).map_err(|message| anyhow!(message))?;
    let mut segmenter: Option<([usize; 2], Segmenter)> = None;
    for (path, drawing) in Pictures::new(&args.images, args.out.as_deref(), args.overwrite)?.iter() {
        let mut picture = Picture::read(path, args.megapixels)?;
        let size = picture.size;
        let ground = ground(args, size).context("--segmentation needs the camera: expected --fov")?;
        if segmenter.as_ref().is_none_or(|(of, _)| *of != size) {
            segmenter = Some((size, Segmenter::new(weights.clone(), size, ground)));
        }
        let mut labels = vec![0; size[0] * size[1]];
        if let Some((_, segmenter)) = &mut segmenter {
            segmenter.segment(picture.rgb()?, &mut labels)?;
        }
        let seen = Report { image: path.display().to_string(), shares: shares(&weights.classes, &labels) };
        tell(&seen, args.json)?;
        if let Some(drawing) = drawing {
            let names: Vec<(&str, u8)> =
                weights.classes.iter().map(|class| (class.name.as_str(), class.id)).collect();
            overlay(&mut picture.bytes, size, &labels, &names);
            picture.write(drawing)?;
        }
    }
    Ok(())
}

/// Share of the pixels for each class, in units of 1/10,000.
fn shares<'a>(classes: &'a [Class], labels: &[u8]) -> BTreeMap<&'a str, f64> {
    let mut counts = [0_usize; 256];
    labels.iter().for_each(|id| counts[usize::from(*id)] += 1);
    let share = |class: &Class| 1e4 * counts[usize::from(class.id)] as f64 / labels.len() as f64;
    classes.iter().map(|class| (class.name.as_str(), share(class).round() / 1e4)).collect()
}

fn tell(seen: &Report<'_>, json: bool) -> anyhow::Result<()> {
    if json {
        return output::print(&(serde_json::to_string(seen)? + "\n"));
    }
    let mut lines = vec![["class", "share"].map(str::to_owned).to_vec()];
    lines.extend(seen.shares.iter().map(|(name, share)| vec![(*name).to_owned(), format!("{share:.4}")]));
    output::print(&format!("{}\n{}", seen.image, output::align(&lines)))
}
