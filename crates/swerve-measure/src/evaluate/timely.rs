//! Timing of the evaluation: against which frame a late result is compared.

use clap::ValueEnum;
use swerve_core::{Span, Time};
use swerve_eval::timely::{Finished, Snap, end_anchored, start_anchored};

/// Timing of the results.
#[derive(clap::Args, Debug)]
pub(super) struct TimelyArgs {
    /// Compare results with the ground truth at the time of their availability, not with that of their own frame
    #[arg(long, value_enum, requires = "runtime_ms")]
    anchor: Option<Anchor>,
    /// Time from each frame to its result, ms
    #[arg(long, value_name = "MS", requires = "anchor", value_parser = milliseconds)]
    runtime_ms: Option<Span>,
    /// Time between frames, ms
    #[arg(long, value_name = "MS", default_value = "100", value_parser = period)]
    period_ms: Span,
    /// Frame used for an instant between two frames
    #[arg(long, value_enum, default_value = "ceil")]
    snap: SnapName,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Anchor {
    /// Each result is compared with the frame at which it is finished
    Start,
    /// Each frame is compared with the newest result finished by then
    End,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum SnapName {
    /// The later frame
    Ceil,
    /// The nearer frame
    Round,
}

fn milliseconds(text: &str) -> Result<Span, String> {
    match text.trim().parse::<f64>() {
        Ok(ms) if (0.0..=1e6).contains(&ms) => Ok(Span::from_secs(ms / 1e3)),
        _ => Err("expected ms from 0 to 1000000".to_owned()),
    }
}

fn period(text: &str) -> Result<Span, String> {
    let span = milliseconds(text)?;
    if span > Span::ZERO { Ok(span) } else { Err("expected ms above 0".to_owned()) }
}

impl TimelyArgs {
    /// Pairs of an evaluated frame and the frame whose result is compared with it, out of `frames` frames.
    pub(super) fn judged(&self, frames: usize) -> Vec<(usize, Option<usize>)> {
        let (Some(anchor), Some(after)) = (self.anchor, self.runtime_ms) else {
            return (0..frames).map(|k| (k, Some(k))).collect();
        };
        let stamps: Vec<Time> = (0..frames).map(|k| Time::from_ns(k as i64 * self.period_ms.ns())).collect();
        let results: Vec<Finished> = stamps.iter().map(|&stamp| Finished { stamp, after }).collect();
        let snap = match self.snap {
            SnapName::Ceil => Snap::Ceil,
            SnapName::Round => Snap::Round,
        };
        match anchor {
            Anchor::Start => {
                let pairs = start_anchored(&stamps, &results, snap);
                pairs.into_iter().map(|(result, frame)| (frame, Some(result))).collect()
            }
            Anchor::End => end_anchored(&stamps, &results, snap).into_iter().enumerate().collect(),
        }
    }
}
