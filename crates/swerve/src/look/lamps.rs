//! `swerve look --traffic-light`: classifies the lit lamp in a crop.

use anyhow::Context as _;
use serde::Serialize;
use swerve_measure::picture::{Picture, Pictures};
use swerve_report::output;
use swerve_vision::traffic_light::lit_head;

use super::LookArgs;

/// Printed result for a crop.
#[derive(Serialize)]
struct Report {
    image: String,
    /// The lit lamp; `None` where the crop shows no head of a light.
    lamp: Option<&'static str>,
    /// Share of the votes for any lamp that this lamp received, 0 to 1.
    share: f64,
    /// Probability that the crop shows the head of a light.
    probability: f64,
}

/// Classifies the lamp in each image.
pub(super) fn run(args: &LookArgs) -> anyhow::Result<()> {
    let mut rows = vec![["image", "lamp", "share", "probability"].map(str::to_owned).to_vec()];
    for (path, _) in Pictures::new(&args.images, None, args.overwrite)?.iter() {
        let picture = Picture::read(path, args.megapixels)?;
        let found = lit_head(picture.rgb().with_context(|| path.display().to_string())?);
        let (lamp, share, probability) = found.map_or((None, 0.0, 0.0), |(lamp, share, probability)| {
            ((probability >= args.least).then(|| lamp.name()), share, probability)
        });
        let [share, probability] = [share, probability].map(|value| (value * 1000.0).round() / 1000.0);
        let seen = Report { image: path.display().to_string(), lamp, share, probability };
        if args.json {
            output::print(&(serde_json::to_string(&seen)? + "\n"))?;
        } else {
            let numbers = [share, probability].map(|value| format!("{value:.3}"));
            rows.push([seen.image, lamp.unwrap_or("-").to_owned()].into_iter().chain(numbers).collect());
        }
    }
    if args.json { Ok(()) } else { output::print(&output::align(&rows)) }
}
