//! Writer of recordings in the form of CommonRoad's recorded scenarios.

use std::fmt::Write as _;

use swerve_core::Span;
use swerve_geom::Vector2;
use swerve_msg::ActorKind;

use super::{COMMONROAD_STEP_S, HEAD, RecordedTrack, Recording};

/// Error of writing a recording.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
#[error("a step of {0} in place of 0.1 s")]
pub struct StepError(Span);

/// Writes recordings by name as rows after a header, as read by [`commonroad_csv`](super::commonroad_csv). Static
/// objects are omitted. Commas in names become blanks.
///
/// # Errors
/// If a recording's step is not 0.1 s.
pub fn commonroad_text(recordings: &[(String, Recording)]) -> Result<String, StepError> {
    let mut text = format!("{HEAD}\n");
    for (name, recording) in recordings {
        if recording.step != Span::from_secs(COMMONROAD_STEP_S) {
            return Err(StepError(recording.step));
        }
        let name = name.replace([',', '\n', '\r'], " ");
        for track in &recording.tracks {
            if let Some(kind) = word(track.kind) {
                rows(&mut text, &format!("{name},{},{kind}", track.id.0), track);
            }
        }
    }
    Ok(text)
}

fn rows(text: &mut String, who: &str, track: &RecordedTrack) {
    let mut heading_rad = 0.0;
    for (k, (step, place)) in track.samples.iter().enumerate() {
        let next = track.samples.get(k + 1).or(track.samples.get(k.wrapping_sub(1)));
        let velocity_mps = next.map_or(Vector2::default(), |(at, there)| {
            (*there - *place) * (1.0 / ((at - step) as f64 * COMMONROAD_STEP_S))
        });
        let speed_mps = velocity_mps.norm();
        if speed_mps > 0.05 {
            heading_rad = velocity_mps.heading();
        }
        let (length_m, width_m) = (track.extent.length_m, track.extent.width_m);
        let _infallible = writeln!(
            text,
            "{who},{length_m:.2},{width_m:.2},{step},{:.4},{:.4},{heading_rad:.4},{speed_mps:.3}",
            place.x_m, place.y_m
        );
    }
}

fn word(kind: ActorKind) -> Option<&'static str> {
    match kind {
        ActorKind::Car => Some("car"),
        ActorKind::Truck => Some("truck"),
        ActorKind::Motorcycle => Some("motorcycle"),
        ActorKind::Cyclist => Some("bicycle"),
        ActorKind::Pedestrian => Some("pedestrian"),
        ActorKind::Static => None,
    }
}
