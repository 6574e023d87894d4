//! Content of a red field: the word of a stop sign or the bar of a no-entry sign, by the position of their white.

use super::Meaning;
use crate::Rgb;
use crate::regions::Region;

/// Columns of four letters, as shares of the width.
const LETTERS: [[f64; 2]; 4] = [[0.14, 0.3], [0.32, 0.49], [0.51, 0.68], [0.7, 0.86]];
/// Rows of a word and of the middle of a bar, as shares of the height.
const WORD: [f64; 2] = [0.33, 0.67];
const BAR: [f64; 2] = [0.44, 0.56];
/// Rows and columns that are red above and below either.
const ABOVE: [f64; 2] = [0.12, 0.27];
const BELOW: [f64; 2] = [0.73, 0.88];
const ACROSS: [f64; 2] = [0.32, 0.68];
/// Smallest whiteness of all parts of a bar, and in excess of the red field; a word has gaps.
const BAR_MIN: [f64; 2] = [0.62, 0.4];
/// Smallest whiteness of the inner letters in excess of the red field; a T has little white.
const INNER_MIN: f64 = 0.08;
/// Smallest whiteness of the outer letters in excess of the red field, relative to that of the field, and its range. The glow
/// of a red lamp decreases to all sides, so that its outer columns are little whiter than what is above it, which is whiter
/// than paint.
const OUTER_MIN: f64 = 0.8;
const OUTER_RANGE: [f64; 2] = [0.12, 0.2];
/// Excess of whiteness on a clean sign: of the outer letters, and of a bar.
const CLEAN: [f64; 2] = [0.3, 0.75];

/// Meaning of a red field and its score, 0 to 1; `None` if it is neither a stop nor a no-entry sign.
pub(super) fn read(image: Rgb<'_>, region: &Region) -> Option<(Meaning, f64)> {
    let part = |columns, rows| whiteness(image, region, columns, rows);
    let red = part(ACROSS, ABOVE).max(part(ACROSS, BELOW));
    let score = |excess: f64, clean: f64| (excess / clean).min(1.0);
    let bar = LETTERS.map(|columns| part(columns, BAR)).into_iter().fold(f64::INFINITY, f64::min);
    if bar >= BAR_MIN[0] {
        return (bar - red >= BAR_MIN[1]).then(|| (Meaning::NoEntry, score(bar - red, CLEAN[1])));
    }
    let [first, second, third, last] = LETTERS.map(|columns| part(columns, WORD) - red);
    let [inner, outer] = [second.min(third), first.min(last)];
    let outer_min = (OUTER_MIN * red).clamp(OUTER_RANGE[0], OUTER_RANGE[1]);
    (inner >= INNER_MIN && outer >= outer_min).then(|| (Meaning::Stop, score(outer, CLEAN[0])))
}

/// Mean of the smallest over the largest colour value in a part of a region: 1 for white and grey, near 0 for red paint.
fn whiteness(image: Rgb<'_>, region: &Region, columns: [f64; 2], rows: [f64; 2]) -> f64 {
    let within = |[from, to]: [f64; 2], first: usize, size: usize| {
        let [from, to] = [from, to].map(|share| (share * size as f64).round() as usize);
        first + from..first + to.max(from + 1).min(size)
    };
    let (columns, rows) =
        (within(columns, region.left, region.width()), within(rows, region.top, region.height()));
    let (mut sum, mut count) = (0.0, 0_usize);
    for y in rows {
        for rgb in image.row(y)[3 * columns.start..3 * columns.end].chunks_exact(3) {
            let (most, least) = (rgb[0].max(rgb[1]).max(rgb[2]), rgb[0].min(rgb[1]).min(rgb[2]));
            sum += f64::from(least) / f64::from(most.max(1));
            count += 1;
        }
    }
    sum / count.max(1) as f64
}
