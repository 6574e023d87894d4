//! When results are judged.

use clap::ValueEnum;
use swerve_core::{Span, Time};
use swerve_eval::timely::{Finished, Snap, end_anchored, start_anchored};

/// What is asked about time.
#[derive(clap::Args, Debug)]
pub(super) struct TimelyArgs {
    /// Judge results when they can be used and not against their own frame
    #[arg(long, value_enum, requires = "runtime_ms")]
    anchor: Option<Anchor>,
    /// From each frame until its result, ms
    #[arg(long, value_name = "MS", requires = "anchor", value_parser = milliseconds)]
    runtime_ms: Option<Span>,
    /// From frame to frame, ms
    #[arg(long, value_name = "MS", default_value = "100", value_parser = period)]
    period_ms: Span,
    /// Which frame stands for an instant between two
    #[arg(long, value_enum, default_value = "ceil")]
    snap: SnapName,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Anchor {
    /// Each result against the frame at which it is finished
    Start,
    /// Each frame by the newest result that is finished by then
    End,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum SnapName {
    /// The later one
    Ceil,
    /// The nearer one
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
    /// Of so many frames those that are judged, each with the frame whose result it is judged by.
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
