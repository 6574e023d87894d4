//! Cut-outs: a folder of pictures of one object for each class, and `background` with pictures without objects.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use rayon::prelude::*;
use swerve_measure::picture::images_in;
use swerve_report::files::entries;
use swerve_text::{did_you_mean, list};

use super::{everywhere, part};
use crate::train::detector::labelled::{Labelled, Truth};
use crate::train::detector::recipe::Class;

/// Folder of pictures without objects.
const BACKGROUND: &str = "background";

/// Pictures of the folders in a folder: by class, then by name. `margin` is the share of the width at the left and
/// right of an object, and of the height above and below.
pub(super) fn read(folder: &Path, margin: [f64; 2], share: [f64; 2]) -> anyhow::Result<Vec<Labelled>> {
    let mut folders = entries(folder).with_context(|| format!("reading {}", folder.display()))?;
    folders.retain(|path| path.is_dir());
    let names: Vec<&str> = Class::ALL.iter().map(|class| class.name()).chain([BACKGROUND]).collect();
    ensure!(!folders.is_empty(), "{}: expected folders named {}", folder.display(), list(&names));
    let mut pictures: Vec<(PathBuf, Option<Class>)> = Vec::new();
    for path in folders {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let class = Class::ALL.into_iter().find(|class| class.name() == name);
        if class.is_none() && name != BACKGROUND {
            let near = did_you_mean(&name, names.iter().copied());
            bail!("{}: expected folders named {}{near}", path.display(), list(&names));
        }
        pictures.extend(part(images_in(&path)?, share).into_iter().map(|picture| (picture, class)));
    }
    let one = |(path, class): (PathBuf, Option<Class>)| {
        Labelled::checked(path, |size| {
            let Some(class) = class else { return Ok(Vec::new()) };
            let [width, height] = size.map(|px| px as f64);
            let [across, down] = [margin[0] * width, margin[1] * height];
            let bbox = [across, down, width - 2.0 * across, height - 2.0 * down];
            // Objects beside this one have no label.
            Ok(vec![Truth::visible(class.kind(), bbox), everywhere(size)])
        })
    };
    pictures.into_par_iter().map(one).collect()
}
