//! Training cells from images.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use swerve_core::Rng;
use swerve_geom::math;
use swerve_measure::labels::PixelClass;
use swerve_vision::segmentation::{CELL_PX, CLASSES, Class, FEATURES, Samples, Segmenter, Tree, Weights};

use super::recipe::Recipe;
use super::{Labelled, ground};

/// Weight of the mean cell.
const WEIGHT: f64 = 256.0;

/// Untrained weights, which do not distinguish classes.
pub(super) fn untrained(recipe: &Recipe, source: String) -> Weights {
    let class =
        |class: &PixelClass| Class { name: class.name.clone(), id: class.ids().next().unwrap_or_default() };
    let other = Class { name: "other".into(), id: 0 };
    let classes: Vec<Class> = recipe.class.iter().map(class).chain([other]).collect();
    let tree = Tree { features: vec![0], thresholds: Vec::new(), leaves: vec![0; classes.len()] };
    Weights { source, focal_px: recipe.camera.focal_px(), classes, trees: vec![tree] }
}

/// Samples from one image: random cells of each class, and the number of cells present.
#[derive(Default)]
struct Drawn {
    rows: Vec<u8>,
    labels: Vec<u8>,
    there: [usize; CLASSES],
    taken: [usize; CLASSES],
}

/// Cells of all images, weighted so that the weight of a class is its share of all cells to the configured power,
/// whatever number was drawn.
pub(super) fn samples(recipe: &Recipe, paths: &[PathBuf]) -> anyhow::Result<Samples> {
    let draw = |(k, path): (usize, &PathBuf)| draw(recipe, path, k as i64);
    let drawn: Vec<Drawn> = paths.par_iter().enumerate().map(draw).collect::<anyhow::Result<_>>()?;
    let total =
        |of: fn(&Drawn) -> &[usize; CLASSES], class: usize| drawn.iter().map(|d| of(d)[class]).sum::<usize>();
    let there: [usize; CLASSES] = core::array::from_fn(|class| total(|d| &d.there, class));
    let all: usize = there.iter().sum();
    let heaviness =
        there.map(|n| math::pow(n.max(1) as f64 / all.max(1) as f64, recipe.learning.power - 1.0));
    let count: usize = drawn.iter().map(|d| d.labels.len()).sum();
    let mass: f64 = (0..CLASSES).map(|class| there[class] as f64 * heaviness[class]).sum();
    let unit = WEIGHT * count as f64 / mass.max(1.0);
    let (mut rows, mut labels, mut weights) = (Vec::with_capacity(count * FEATURES), Vec::new(), Vec::new());
    for one in drawn {
        let weight =
            |class: usize| unit * heaviness[class] * one.there[class] as f64 / one.taken[class] as f64;
        weights.extend(one.labels.iter().map(|label| weight(usize::from(*label)).max(1.0) as u32));
        rows.extend(one.rows);
        labels.extend(one.labels);
    }
    Ok(Samples::new(&rows, labels, weights))
}

fn draw(recipe: &Recipe, path: &Path, number: i64) -> anyhow::Result<Drawn> {
    let image = Labelled::read(recipe, path)?;
    let mut rng = Rng::keyed(recipe.seed, "cells", &[number]);
    let tilt_rad = (recipe.learning.tilt_deg * rng.uniform(-1.0, 1.0)).to_radians();
    let ground = ground(recipe, image.size, tilt_rad);
    let mut segmenter = Segmenter::new(untrained(recipe, String::new()), image.size, ground);
    segmenter.fill(image.rgb())?;
    let [columns, lines] = segmenter.cells();
    let mut cells: [Vec<usize>; CLASSES] = Default::default();
    for cell in 0..columns * lines {
        cells[usize::from(most(&image, [cell % columns, cell / columns]))].push(cell);
    }
    let mut drawn = Drawn::default();
    for (class, cells) in cells.iter_mut().enumerate() {
        let take = recipe.learning.cells.min(cells.len());
        (drawn.there[class], drawn.taken[class]) = (cells.len(), take);
        for k in 0..take {
            let other = k + rng.below(cells.len() - k);
            cells.swap(k, other);
            segmenter.describe([cells[k] % columns, cells[k] / columns], &mut drawn.rows);
            drawn.labels.push(class as u8);
        }
    }
    Ok(drawn)
}

/// Most frequent class in a cell; the first of equal ones.
fn most(image: &Labelled, [x, y]: [usize; 2]) -> u8 {
    let mut counts = [0; CLASSES];
    for row in 0..CELL_PX {
        let start = (y * CELL_PX + row) * image.size[0] + x * CELL_PX;
        image.classes[start..start + CELL_PX].iter().for_each(|class| counts[usize::from(*class)] += 1);
    }
    (0..CLASSES as u8).rev().max_by_key(|class| counts[usize::from(*class)]).unwrap_or(0)
}
