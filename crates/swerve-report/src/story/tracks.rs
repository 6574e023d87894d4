//! Tracks and predictions of the stack.

use super::changes::changes;
use super::labels::Labels;
use super::record::Story;
use super::view::View;
use swerve_draw::{At, Canvas, Style, color};

/// Half the size of a track sign, pixels.
const SIGN: f64 = 3.0;

/// True if a track within the view is stale.
pub(super) fn has_stale(story: &Story, view: &View) -> bool {
    within(story, view).any(|track| track.is_stale)
}

/// True if predictions are drawn.
pub(super) fn has_predictions(story: &Story, view: &View) -> bool {
    changes(story, view).shown.iter().any(|mark| mark.predicted.iter().any(|way| way.len() > 1))
}

fn within<'a>(story: &'a Story, view: &View) -> impl Iterator<Item = &'a super::TrackMark> {
    let (from, to) = view.span;
    story.tracks.iter().filter(move |track| track.at >= from && track.at <= to)
}

/// Draws tracks as diamonds, stale ones as crosses, and the predictions recorded with the plans shown.
pub(super) fn draw(canvas: &mut Canvas, labels: &mut Labels, story: &Story, view: &View) {
    let style = Style::line(color::TRACK, 1.0).dashed(1.0, 3.0);
    for way in changes(story, view).shown.iter().flat_map(|mark| &mark.predicted) {
        canvas.path(way.iter().map(|p| view.at(*p)), false, style);
    }
    for track in within(story, view) {
        let (x, y) = view.at(track.point);
        sign(canvas, (x, y), track.is_stale);
        labels.keep_off([x - SIGN, y - SIGN, x + SIGN, y + SIGN]);
    }
}

/// Draws the sign of a track.
pub(super) fn sign(canvas: &mut Canvas, (x, y): At, is_stale: bool) {
    let r = SIGN;
    if is_stale {
        let style = Style::line(color::ALARM, 1.6);
        canvas.line((x - r, y - r), (x + r, y + r), style);
        canvas.line((x - r, y + r), (x + r, y - r), style);
    } else {
        let style = Style::fill(color::PAPER).outlined(color::TRACK, 1.0);
        canvas.path([(x - r, y), (x, y - r), (x + r, y), (x, y + r)], true, style);
    }
}
