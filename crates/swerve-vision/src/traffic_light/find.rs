//! Traffic light heads in an image: classified at known map positions, or detected by colour and shape.

use super::{COLUMNS, Lamp, brightness, lit_within, vote_of};
use crate::Rgb;
use crate::regions::{Region, Regions};

/// Head with three lamps in a column, one of them lit.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Head {
    /// The lit lamp.
    pub lamp: Lamp,
    /// Left, top, right and bottom edge, pixels.
    pub edges_px: [f64; 4],
    /// Confidence, 0 to 1: the lamp's share of all votes times the dark share of the housing.
    pub score: f64,
}

/// Size of the crop around a known head, relative to the head.
const AROUND: f64 = 1.5;
/// Smallest lamp, pixels.
const LAMP_MIN_PX: usize = 3;
/// Smallest vote of a pixel of a lit lamp: when searching, and at a known head.
const VOTE_MIN: f64 = 0.25;
const SHINES_MIN: f64 = 0.1;
/// Range of width over height of a lit lamp; hoods hide part of its top.
const ASPECT: [f64; 2] = [0.6, 1.8];
/// Smallest share of its box that a disc fills: 0.785 minus losses at its edge.
const FILLED_MIN: f64 = 0.6;
/// Height and width of a head, in lamp diameters.
const HEAD: [f64; 2] = [3.5, 1.2];
/// Largest brightness of a housing relative to its lamp; heavy rain brightens black.
const DARK: f64 = 0.6;
/// Smallest dark share of a housing, and smallest score.
const SURE: [f64; 2] = [0.7, 0.5];

/// Classifies lights in parts of an image; reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Looker {
    bytes: Vec<u8>,
}

impl Looker {
    /// Lit lamp ([`lit`](super::lit)) of the head between left, top, right and bottom edge, pixels, with a margin for
    /// position errors. `None` if the head is outside the image or no pixel shines.
    pub fn lit(&mut self, image: Rgb<'_>, [left, top, right, bottom]: [f64; 4]) -> Option<(Lamp, f64)> {
        let more = 0.5 * (AROUND - 1.0);
        let (across, down) = (more * (right - left), more * (bottom - top));
        let crop = self.crop(image, [left - across, top - down, right + across, bottom + down])?;
        let shines = |rgb: &[u8]| shines(rgb, SHINES_MIN);
        lit_within(crop, AROUND).filter(|_| crop.bytes().chunks_exact(3).any(shines))
    }

    fn crop(&mut self, image: Rgb<'_>, [left, top, right, bottom]: [f64; 4]) -> Option<Rgb<'_>> {
        let within = |edge: f64, size: usize| edge.round().clamp(0.0, size as f64) as usize;
        let [left, right] = [left, right].map(|edge| within(edge, image.width()));
        let [top, bottom] = [top, bottom].map(|edge| within(edge, image.height()));
        if left >= right || top >= bottom {
            return None;
        }
        self.bytes.clear();
        (top..bottom).for_each(|y| self.bytes.extend_from_slice(&image.row(y)[3 * left..3 * right]));
        Rgb::new(right - left, bottom - top, &self.bytes).ok()
    }
}

/// Detects heads; reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct LightFinder {
    regions: Regions,
    looker: Looker,
}

impl LightFinder {
    /// Appends the heads in an image, from top to bottom: bright discs of a lamp's colour at that lamp's position in a
    /// dark housing.
    pub fn find(&mut self, image: Rgb<'_>, found: &mut Vec<Head>) {
        self.regions.find(image, |rgb| shines(rgb, VOTE_MIN), LAMP_MIN_PX);
        for region in self.regions.regions() {
            let aspect = region.width() as f64 / region.height() as f64;
            if !(ASPECT[0]..=ASPECT[1]).contains(&aspect) {
                continue;
            }
            found.extend(head(image, &self.regions, region, &mut self.looker));
        }
    }
}

/// Head around a lit region: the most confident of the possible lamps; `None` if there is no head.
fn head(image: Rgb<'_>, regions: &Regions, region: &Region, looker: &mut Looker) -> Option<Head> {
    let (mut votes, mut filled, mut bright) = ([0.0; 3], 0_usize, 0_u32);
    for y in region.top..region.bottom {
        for x in (region.left..region.right).filter(|x| regions.row(y)[*x] == region.label) {
            let rgb = &image.row(y)[3 * x..3 * x + 3];
            filled += 1;
            bright = bright.max(brightness(rgb));
            let (lamps, vote) = vote_of(rgb);
            lamps.iter().for_each(|lamp| votes[*lamp as usize] += vote);
        }
    }
    if (filled as f64) < FILLED_MIN * (region.width() * region.height()) as f64 {
        return None;
    }
    let most = votes.into_iter().fold(0.0, f64::max);
    let may_be = Lamp::ALL.into_iter().filter(|lamp| votes[*lamp as usize] > 0.5 * most);
    let heads = may_be.filter_map(|lamp| head_of(image, region, (lamp, bright), looker));
    heads.max_by(|a, b| a.score.total_cmp(&b.score))
}

/// Head around a lamp of this type and brightness.
fn head_of(
    image: Rgb<'_>,
    region: &Region,
    (lamp, bright): (Lamp, u32),
    looker: &mut Looker,
) -> Option<Head> {
    let (width, height) = (region.width() as f64, region.height() as f64);
    // A hood hides the top of a lamp but not its sides.
    let [tall, wide] = HEAD.map(|diameters| diameters * width.max(height));
    let (left, top) =
        (region.left as f64 + 0.5 * (width - wide), region.top as f64 + 0.5 * height - lamp.place() * tall);
    let edges_px = [left, top, left + wide, top + tall];
    if left < 0.0 || top < 0.0 || edges_px[2] > image.width() as f64 || edges_px[3] > image.height() as f64 {
        return None;
    }
    let crop = looker.crop(image, edges_px)?;
    let (shown, share) = lit_within(crop, 1.0)?;
    let dark = dark_share(crop, lamp, DARK * f64::from(bright));
    let score = share * dark;
    let is_sure = shown == lamp && dark >= SURE[0] && score >= SURE[1];
    is_sure.then_some(Head { lamp, edges_px, score })
}

/// Share of a head's pixels away from its lit lamp that are darker than `bright`.
fn dark_share(crop: Rgb<'_>, lamp: Lamp, bright: f64) -> f64 {
    let (mut dark, mut all) = (0_usize, 0_usize);
    // The margins show the background.
    let [from, to] = COLUMNS.map(|part| (part * crop.width() as f64).round() as usize);
    for y in 0..crop.height() {
        let place = (y as f64 + 0.5) / crop.height() as f64;
        if (place - lamp.place()).abs() > 0.2 && (0.05..0.95).contains(&place) {
            let housing = crop.row(y)[3 * from..3 * to].chunks_exact(3);
            all += housing.len();
            dark += housing.filter(|rgb| f64::from(brightness(rgb)) < bright).count();
        }
    }
    if all == 0 { 0.0 } else { dark as f64 / all as f64 }
}

/// Returns true if a pixel's vote for any lamp is at least `least`.
fn shines(rgb: &[u8], least: f64) -> bool {
    let (lamps, vote) = vote_of(rgb);
    !lamps.is_empty() && vote >= least
}
