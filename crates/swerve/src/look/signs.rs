//! `swerve look --signs`: finds stop signs, no-entry signs and speed limits.

use anyhow::Context as _;
use serde::Serialize;
use swerve_measure::picture::{Picture, Pictures};
use swerve_report::output;
use swerve_vision::signs::{Meaning, Sign, SignFinder};

use super::LookArgs;

/// Colour of the frames around signs.
const COLOUR: [u8; 3] = [60, 230, 120];

/// Printed result for an image.
#[derive(Serialize)]
struct Report {
    image: String,
    signs: Vec<Found>,
}

#[derive(Serialize)]
struct Found {
    sign: &'static str,
    /// Speed limit, km/h; `None` for another sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    kmh: Option<u8>,
    /// Left, top, width and height, pixels.
    #[serde(rename = "box")]
    bbox: [f64; 4],
    score: f64,
}

impl Found {
    fn new(sign: &Sign) -> Self {
        let (name, kmh) = match sign.meaning {
            Meaning::Stop => ("stop", None),
            Meaning::NoEntry => ("no_entry", None),
            Meaning::SpeedLimit(kmh) => ("speed_limit", Some(kmh)),
        };
        Self { sign: name, kmh, bbox: sign.bbox, score: (sign.score * 1000.0).round() / 1000.0 }
    }
}

/// Finds the signs in each image.
pub(super) fn run(args: &LookArgs) -> anyhow::Result<()> {
    let mut finder = SignFinder::default();
    for (path, drawing) in Pictures::new(&args.images, args.out.as_deref(), args.overwrite)?.iter() {
        let mut picture = Picture::read(path, args.megapixels)?;
        let mut found = Vec::new();
        finder.find(picture.rgb().with_context(|| path.display().to_string())?, &mut found);
        let seen =
            Report { image: path.display().to_string(), signs: found.iter().map(Found::new).collect() };
        tell(&seen, args.json)?;
        if let Some(drawing) = drawing {
            seen.signs.iter().for_each(|sign| picture.frame(sign.bbox, COLOUR));
            picture.write(drawing)?;
        }
    }
    Ok(())
}

fn tell(seen: &Report, json: bool) -> anyhow::Result<()> {
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
