//! Fault injection on streams: `[fault.NAME]`.

use core::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Span, Time};

use super::execution::MS_MAX;
use crate::config::execution::span_of_ms;

/// A fault on a stream: exactly one effect on its messages, and its time window.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct FaultConfig {
    /// Stream, by its name in the log. Its readers get the faulty messages; of two faults on one stream the first by
    /// name comes first.
    #[serde(default)]
    pub stream: String,
    /// `drop = true`: the message is lost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drop: Option<bool>,
    /// Delay of the message, ms; later messages on the edge wait, so that their order is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = MS_MAX))]
    pub delay_ms: Option<f64>,
    /// Delay of the message, drawn uniformly from 0 to this, ms; later messages on the edge wait, so that their order
    /// is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = MS_MAX))]
    pub jitter_ms: Option<f64>,
    /// Repeats the message under new stamps in place of the messages that follow within this time, ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = MS_MAX))]
    pub freeze_ms: Option<f64>,
    /// Standard deviation of normal noise on the message's numbers, in metres, m/s, m/s², degrees, degrees per second,
    /// hundredths of a pedal, or grey levels of an image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub noise: Option<f64>,
    /// `nan = true`: one number of the message becomes NaN.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nan: Option<bool>,
    /// Number of bits of an image or a point cloud to flip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub flip_bits: Option<u32>,
    /// Probability that a message is affected, 0 to 1.
    #[serde(default = "always")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub probability: f64,
    /// First stamp affected, ms.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = MS_MAX))]
    pub from_ms: f64,
    /// Last stamp affected (inclusive), ms; the end of the run when absent. A freeze that has begun by then continues
    /// to its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = MS_MAX))]
    pub until_ms: Option<f64>,
    /// Seed of the fault's random numbers; the run's when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
}

fn always() -> f64 {
    1.0
}

/// Effect of a fault on a message.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum FaultKind {
    /// The message is lost.
    Drop,
    /// The message is late by this.
    Delay(Span),
    /// The message is late by up to this.
    Jitter(Span),
    /// The message is repeated for this time.
    Freeze(Span),
    /// The message's numbers change.
    Corrupt(Corruption),
}

/// Change of a message's numbers.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Corruption {
    /// Normal noise of this standard deviation, see [`FaultConfig::noise`].
    Noise(f64),
    /// One number becomes NaN.
    Nan,
    /// This many bits are flipped.
    FlipBits(u32),
}

impl FaultKind {
    /// Name in the log.
    pub fn name(self) -> &'static str {
        match self {
            Self::Drop => "drop",
            Self::Delay(_) => "delay",
            Self::Jitter(_) => "jitter",
            Self::Freeze(_) => "freeze",
            Self::Corrupt(Corruption::Noise(_)) => "noise",
            Self::Corrupt(Corruption::Nan) => "nan",
            Self::Corrupt(Corruption::FlipBits(_)) => "flip_bits",
        }
    }
}

/// Contents of a stream, as far as faults distinguish them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Carries {
    /// Numbers with a meaning each.
    Numbers,
    /// An image of integers (colours or ids), which cannot be NaN.
    Levels,
    /// An image of distances, or points.
    Floats,
}

impl fmt::Display for Carries {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Numbers => "measured or computed numbers",
            Self::Levels => "an image of whole numbers",
            Self::Floats => "an image of distances or a point cloud",
        })
    }
}

impl FaultConfig {
    /// The fault's effect, or the problem with its key; an empty key is the whole table.
    pub fn kind(&self) -> Result<FaultKind, (&'static str, String)> {
        let mut kinds = Vec::new();
        for (name, given, kind) in
            [("drop", self.drop, FaultKind::Drop), ("nan", self.nan, FaultKind::Corrupt(Corruption::Nan))]
        {
            match given {
                Some(true) => kinds.push(kind),
                Some(false) => return Err((name, "it can only be true; leave it out instead".into())),
                None => {}
            }
        }
        kinds.extend(self.delay_ms.map(|ms| FaultKind::Delay(span_of_ms(ms))));
        kinds.extend(self.jitter_ms.map(|ms| FaultKind::Jitter(span_of_ms(ms))));
        kinds.extend(self.freeze_ms.map(|ms| FaultKind::Freeze(span_of_ms(ms))));
        kinds.extend(self.noise.map(|sigma| FaultKind::Corrupt(Corruption::Noise(sigma))));
        kinds.extend(self.flip_bits.map(|bits| FaultKind::Corrupt(Corruption::FlipBits(bits))));
        match kinds.len() {
            1 => Ok(kinds.remove(0)),
            n => {
                let one =
                    "expected exactly one of drop, delay_ms, jitter_ms, freeze_ms, noise, nan, flip_bits";
                Err(("", format!("{one}; found {n}")))
            }
        }
    }

    /// First and last stamp affected.
    pub fn stamps(&self) -> Result<(Time, Time), (&'static str, String)> {
        let from = Time::ZERO + span_of_ms(self.from_ms);
        let until = self.until_ms.map_or(Time::MAX, |ms| Time::ZERO + span_of_ms(ms));
        if until < from {
            return Err(("until_ms", "expected `from_ms` or later".into()));
        }
        Ok((from, until))
    }
}

#[cfg(test)]
mod tests {
    use swerve_text::Document;

    use crate::Setup;

    fn told(text: &str) -> Vec<String> {
        let document = Document::parse("c.toml", text).unwrap();
        match Setup::from_document(&document, &[]) {
            Ok(_) => Vec::new(),
            Err(problems) => problems.iter().map(ToString::to_string).collect(),
        }
    }

    #[test]
    fn impossible_faults_are_refused_with_their_line() {
        let good = "[fault.late]\nstream = \"obstacles\"\ndelay_ms = 100\nprobability = 0.2\nfrom_ms = 500\nuntil_ms = 900\n";
        assert_eq!(told(good), [] as [&str; 0]);
        let cases = [
            ("stream = \"obstacle\"\ndrop = true", "c.toml:2: fault.f.stream: unknown stream `obstacle`"),
            ("stream = \"pose\"", "c.toml:1: fault.f: expected exactly one of drop"),
            ("stream = \"pose\"\ndrop = true\nnan = true", "c.toml:1: fault.f: expected exactly one of drop"),
            ("stream = \"pose\"\nflip_bits = 3", "c.toml:3: fault.f.flip_bits: `pose` carries measured"),
            (
                "stream = \"pose\"\ndrop = true\nprobability = 1.5",
                "c.toml:4: fault.f.probability: expected 0",
            ),
            ("stream = \"pose\"\ndelay_ms = -1", "c.toml:3: fault.f.delay_ms: expected 0 to 86400000"),
            ("stream = \"pose\"\nnoise = nan", "c.toml:3: fault.f.noise: expected 0 to 1000000, found NaN"),
            ("stream = \"pose\"\ndrop = true\nfrom_ms = 5\nuntil_ms = 4", "c.toml:5: fault.f.until_ms: "),
            ("stream = \"front.rgb\"\ndrop = true", "c.toml:2: fault.f.stream: unknown stream `front.rgb`"),
        ];
        for (fault, expected) in cases {
            let found = told(&format!("[fault.f]\n{fault}\n"));
            assert!(found.iter().any(|line| line.starts_with(expected)), "{fault}: {found:?}");
        }
        let camera = "[log]\nsensors = [\"front\"]\n[camera.front]\n[fault.f]\nstream = \"front.rgb\"\n";
        assert_eq!(told(&format!("{camera}flip_bits = 10\n")), [] as [&str; 0]);
        assert!(told(&format!("{camera}nan = true\n"))[0].contains("an image of whole numbers"));
        assert!(told("[fault.pose]\nstream = \"pose\"\ndrop = true\n")[0].contains("no operator has"));
    }
}
