//! Crops that show the head of a light, against crops of anything else.
//!
//! A head is a bright lamp in a housing that is darker than its lamp and its surroundings. The crop is divided into three
//! rows, in order from the lit lamp, and three columns: mean brightness and votes of these nine fields, relative to the
//! brightest pixels and to the votes of the lamp, are the features of a logistic regression (Cox 1958).

use swerve_geom::math;

use super::{Lamp, brightness, lit, vote_of};
use crate::Rgb;

/// Rows of the highest, middle and lowest lamp, as shares of the height.
const ROWS: [[f64; 2]; 3] = [[0.08, 0.34], [0.36, 0.64], [0.66, 0.92]];
/// Columns left of the lamps, of the lamps and right of them, as shares of the width.
const COLUMNS: [[f64; 2]; 3] = [[0.0, 0.18], [0.25, 0.75], [0.82, 1.0]];
/// Weights of brightness and votes: rows from the lit lamp outwards, columns from the left.
///
/// Fitted to 1,178 crops of heads and to 2,933 windows of 28 photographs without a light, weighted four to one, by
/// `tests/reference/vision/lamp_heads.py`, which prints these lines.
const BRIGHTNESS: [[f64; 3]; 3] = [[-4.4, 15.55, -3.43], [7.21, -17.4, 6.7], [8.67, -18.65, 8.09]];
const VOTES: [[f64; 3]; 3] = [[-2.37, 5.0, -2.2], [-1.08, 1.14, -1.63], [-0.91, -2.42, 0.48]];
const BIAS: f64 = -5.18;
/// Quantile of brightness to which fields are related, and its least value, grey levels.
const BRIGHT: f64 = 0.98;
const BRIGHT_MIN: f64 = 13.0;
/// Least votes of the lamp to which fields are related, per pixel.
const VOTES_MIN: f64 = 1e-4;
/// Largest feature.
const FEATURE_MAX: f64 = 2.0;
/// Largest width of an upright head with its margins, relative to its height; 0.94 in the crops.
const ASPECT_MAX: f64 = 1.1;

/// Lit lamp in a crop, its share of all votes, and the probability that the crop shows the head of a light, where four of
/// five crops do; `None` if no pixel is bright and coloured.
pub fn lit_head(crop: Rgb<'_>) -> Option<(Lamp, f64, f64)> {
    let (lamp, share) = lit(crop)?;
    Some((lamp, share, probability(crop, lamp)))
}

fn probability(crop: Rgb<'_>, lamp: Lamp) -> f64 {
    if crop.width() as f64 > ASPECT_MAX * crop.height() as f64 {
        return 0.0;
    }
    let rows = match lamp {
        Lamp::Red => [0, 1, 2],
        Lamp::Yellow => [1, 0, 2],
        Lamp::Green => [2, 1, 0],
    };
    let fields = rows.map(|row| COLUMNS.map(|columns| field(crop, lamp, ROWS[row], columns)));
    let bright = bright(crop).max(BRIGHT_MIN);
    let most = fields[0][1][1].max(VOTES_MIN);
    let mut sum = BIAS;
    for (field, weights) in
        fields.iter().flatten().zip(BRIGHTNESS.iter().flatten().zip(VOTES.iter().flatten()))
    {
        sum += weights.0 * (field[0] / bright).min(FEATURE_MAX);
        sum += weights.1 * (field[1] / most).sqrt().min(FEATURE_MAX);
    }
    1.0 / (1.0 + math::exp(-sum))
}

/// Mean brightness, grey levels, and mean votes for a lamp in a part of a crop.
fn field(crop: Rgb<'_>, lamp: Lamp, rows: [f64; 2], columns: [f64; 2]) -> [f64; 2] {
    let within = |part: [f64; 2], size: usize| {
        let [from, to] = part.map(|share| (share * size as f64).round() as usize);
        from.min(size - 1)..to.clamp(from.min(size - 1) + 1, size)
    };
    let columns = within(columns, crop.width());
    let (mut sums, mut count) = ([0.0; 2], 0_usize);
    for y in within(rows, crop.height()) {
        for rgb in crop.row(y)[3 * columns.start..3 * columns.end].chunks_exact(3) {
            let (lamps, vote) = vote_of(rgb);
            sums[0] += f64::from(brightness(rgb));
            sums[1] += if lamps.contains(&lamp) { vote } else { 0.0 };
            count += 1;
        }
    }
    sums.map(|sum| sum / count as f64)
}

/// Quantile of brightness, grey levels.
fn bright(crop: Rgb<'_>) -> f64 {
    let mut counts = [0_usize; 256];
    crop.bytes().chunks_exact(3).for_each(|rgb| counts[brightness(rgb) as usize] += 1);
    let above = ((1.0 - BRIGHT) * (crop.width() * crop.height()) as f64) as usize;
    let mut seen = 0;
    let level = (0..256).rev().find(|level| {
        seen += counts[*level];
        seen > above
    });
    level.unwrap_or(0) as f64
}
