//! `swerve look --signs`: stop signs and speed limits.

use anyhow::Context as _;
use serde::Serialize;
use swerve_report::output;
use swerve_vision::signs::{Meaning, Sign, SignFinder};

use super::LookArgs;
use super::images::{Picture, make_folder};

/// Of the frames around signs.
const COLOUR: [u8; 3] = [60, 230, 120];

/// What is printed of an image.
#[derive(Serialize)]
struct Seen {
    image: String,
    signs: Vec<Found>,
}

#[derive(Serialize)]
struct Found {
    sign: &'static str,
    /// Of a speed limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    kmh: Option<u8>,
    /// Left, top, width, height, pixels.
    #[serde(rename = "box")]
    bbox: [f64; 4],
    score: f64,
}

impl Found {
    fn new(sign: &Sign) -> Self {
        let (name, kmh) = match sign.meaning {
            Meaning::Stop => ("stop", None),
            Meaning::SpeedLimit(kmh) => ("speed_limit", Some(kmh)),
        };
        Self { sign: name, kmh, bbox: sign.bbox, score: (sign.score * 1000.0).round() / 1000.0 }
    }
}

/// Runs it.
pub(super) fn run(args: &LookArgs) -> anyhow::Result<()> {
    make_folder(args.out.as_deref())?;
    let mut finder = SignFinder::default();
    for path in &args.images {
        let mut picture = Picture::read(path)?;
        let mut found = Vec::new();
        finder.find(picture.rgb().with_context(|| path.display().to_string())?, &mut found);
        let seen = Seen { image: path.display().to_string(), signs: found.iter().map(Found::new).collect() };
        tell(&seen, args.json)?;
        if let Some(out) = &args.out {
            seen.signs.iter().for_each(|sign| frame(&mut picture, sign.bbox));
            picture.write(out, path)?;
        }
    }
    Ok(())
}

/// Draws a frame around a box.
fn frame(picture: &mut Picture, [left, top, width, height]: [f64; 4]) {
    let around = |k: f64, from: f64| (0..=k as usize).map(move |step| from + step as f64);
    for x in around(width, left) {
        picture.dot([x, top], 1, COLOUR);
        picture.dot([x, top + height], 1, COLOUR);
    }
    for y in around(height, top) {
        picture.dot([left, y], 1, COLOUR);
        picture.dot([left + width, y], 1, COLOUR);
    }
}

fn tell(seen: &Seen, json: bool) -> anyhow::Result<()> {
    if json {
        return output::print(&(serde_json::to_string(seen)? + "\n"));
    }
    let mut lines =
        vec![["sign", "km/h", "left", "top", "width", "height", "score"].map(str::to_owned).to_vec()];
    lines.extend(seen.signs.iter().map(|one| {
        let kmh = one.kmh.map_or_else(|| "-".to_owned(), |kmh| kmh.to_string());
        let numbers = one.bbox.iter().map(|px| format!("{px:.0}")).chain([format!("{:.3}", one.score)]);
        [one.sign.to_owned(), kmh].into_iter().chain(numbers).collect()
    }));
    output::print(&format!("{}\n{}", seen.image, output::align(&lines)))
}
