//! Instants of a story that its figures mark.

use swerve_core::{Span, Time};
use swerve_eval::Milestone;
use swerve_msg::EgoState;

use super::record::Story;

/// Instant of the first sight of the protagonist, if after the start of the run.
pub(super) fn first_sight(story: &Story) -> Option<Time> {
    let start = story.ego.first()?.stamp;
    let chain = story.why.as_ref().and_then(|why| why.at_s(Milestone::Visible));
    let at = Time::ZERO + Span::from_secs(chain.or(story.protagonist()?.first_sight_s)?);
    (at > start).then_some(at)
}

/// Instant of the collision, or else of the closest approach.
pub(super) fn closest_at(story: &Story) -> Option<Time> {
    let impact = story.metrics.as_ref()?.impact.map(|impact| impact.at_s);
    let at_s = impact.or_else(|| story.protagonist().map(|hero| hero.min_distance_at_s))?;
    Some(Time::ZERO + Span::from_secs(at_s))
}

/// State of the ego when it first left the road.
pub(super) fn left_road(story: &Story) -> Option<EgoState> {
    story.ego_at(Time::ZERO + Span::from_secs(story.metrics.as_ref()?.left_road_at_s?))
}
