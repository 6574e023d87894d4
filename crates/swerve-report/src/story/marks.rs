//! Events of a story in the bird's-eye view: first sight, closest approach or collision.

use swerve_core::Time;
use swerve_geom::Obb;

use super::labels::Labels;
use super::moments::{closest_at, first_sight, left_road};
use super::record::Story;
use super::shapes::{outline, shape};
use super::view::View;
use swerve_draw::{Canvas, Style, color};

/// Seconds as in metrics and pages: the nearest double, so that all of them round alike.
fn seconds(at: Time) -> f64 {
    at.ns() as f64 / 1e9
}

pub(super) fn sight(canvas: &mut Canvas, labels: &mut Labels, story: &Story, view: &View) -> Option<()> {
    let (at, hero) = (first_sight(story)?, story.protagonist()?);
    let (ego, actor) = (story.ego_at(at)?, story.actor(hero.actor)?);
    let pose = actor.pose_at(at)?;
    let paint = color::SIGHT;
    let footprint = story.outline.footprint(ego.pose);
    let dashed = Style::line(paint, 2.0).dashed(6.0, 4.0);
    outline(canvas, view, &footprint, dashed);
    let (from, to) = (view.at(footprint.center.point()), view.at(pose.point()));
    canvas.line(from, to, dashed);
    labels.keep_off_line([from, to]);
    shape(canvas, view, &actor.shape(pose), Style::line(paint, 2.0));
    let (on_ego, on_actor) = actor.shape(pose).nearest(&footprint);
    let away_m = on_ego.distance(on_actor);
    let end = if view.holds(from) { "" } else { ", outside this view" };
    let label = format!("{} first visible {:.2} s, {away_m:.1} m away{end}", hero.name, seconds(at));
    // On the side away from the actor, clear of the line of sight.
    labels.event((from.0, label_height(view, &footprint, to.1 < from.1)), label, color::SIGHT_TEXT);
    Some(())
}

pub(super) fn closest(canvas: &mut Canvas, labels: &mut Labels, story: &Story, view: &View) -> Option<()> {
    let (at, hero) = (closest_at(story)?, story.protagonist()?);
    let impact = story.metrics.as_ref()?.impact;
    let (ego, actor) = (story.ego_at(at)?, story.actor(hero.actor)?);
    let pose = actor.pose_at(at)?;
    let footprint = story.outline.footprint(ego.pose);
    let paint = color::ALARM;
    let strong = Style::line(paint, 1.8);
    outline(canvas, view, &footprint, strong);
    shape(canvas, view, &actor.shape(pose), strong);
    let (on_ego, on_actor) = actor.shape(pose).nearest(&footprint);
    let (from, to) = (view.at(on_ego), view.at(on_actor));
    let label = match impact {
        Some(i) => {
            canvas.star(to, 9.0, Style::fill(paint).outlined(color::PAPER, 1.0));
            format!("collision with {} {:.2} s, at {:.1} m/s", hero.name, i.at_s, i.ego_speed_mps)
        }
        None => {
            canvas.line(from, to, Style::line(paint, 3.0));
            labels.keep_off_line([from, to]);
            [from, to].into_iter().for_each(|end| canvas.circle(end, 2.5, Style::fill(paint)));
            format!("closest to {} {:.2} s, {:.2} m", hero.name, seconds(at), hero.min_distance_m)
        }
    };
    let middle = view.at(footprint.center.point());
    labels.event((middle.0, label_height(view, &footprint, to.1 < middle.1)), label, paint);
    Some(())
}

pub(super) fn off_road(canvas: &mut Canvas, labels: &mut Labels, story: &Story, view: &View) -> Option<()> {
    let ego = left_road(story)?;
    let footprint = story.outline.footprint(ego.pose);
    let style = Style::line(color::LEFT_ROAD, 1.8);
    outline(canvas, view, &footprint, style);
    let place = view.at(footprint.center.point());
    let label = format!("left the road {:.2} s", seconds(ego.stamp));
    labels.event((place.0, label_height(view, &footprint, false)), label, color::LEFT_ROAD);
    Some(())
}

/// Height of a label just below an outline, or just above it.
pub(super) fn label_height(view: &View, footprint: &Obb, is_below: bool) -> f64 {
    let ys = footprint.corners().map(|corner| view.at(corner).1);
    let (high, low) = (ys.into_iter().fold(f64::INFINITY, f64::min), ys.into_iter().fold(0.0, f64::max));
    let bottom = view.corner.1 + view.size.1;
    if is_below && low + 13.0 < bottom - 3.0 { low + 13.0 } else { high - 5.0 }
}
