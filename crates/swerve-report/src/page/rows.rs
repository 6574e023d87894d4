//! Updates for a page that is shown during the run.

use super::run::{Actor, Commands, Ego, RunPage};
use super::{Collector, Photo, Plan, Predictions, Tracks};

/// Last instant of each table that a page has, microseconds; `None` before the first.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Have {
    /// States of the ego.
    pub ego: Option<i64>,
    /// Commands.
    pub commands: Option<i64>,
    /// Messages of tracks.
    pub tracks: Option<i64>,
    /// Messages of predictions.
    pub predictions: Option<i64>,
    /// Plans.
    pub plans: Option<i64>,
    /// Number of pictures received, including dropped ones.
    pub photos: usize,
    /// Poses of all actors.
    pub actors: Option<i64>,
}

/// New rows since then; columns as in [`RunPage`].
#[derive(Clone, PartialEq, Debug, Default, serde::Serialize)]
pub struct Rows {
    end: i64,
    ego: Ego,
    actors: Vec<Actor>,
    commands: Commands,
    tracks: Vec<Tracks>,
    predictions: Vec<Predictions>,
    plans: Vec<Plan>,
    photos: Vec<Photo>,
}

impl Collector {
    /// Rows that a page does not have yet.
    pub fn rows(&self, have: &Have) -> Rows {
        let RunPage { end, ego, actors, commands, tracks, predictions, plans, photos, photos_before, .. } =
            self.so_far();
        Rows {
            end: *end,
            ego: ego_since(ego, have.ego),
            actors: actors.iter().map(|actor| actor_since(actor, have.actors)).collect(),
            commands: commands_since(commands, have.commands),
            tracks: beyond(tracks, have.tracks, |row| row.t),
            predictions: beyond(predictions, have.predictions, |row| row.t),
            plans: beyond(plans, have.plans, |row| row.t),
            photos: since(photos, have.photos.saturating_sub(*photos_before)),
        }
    }
}

fn since<T: Clone>(column: &[T], from: usize) -> Vec<T> {
    column.get(from..).unwrap_or_default().to_vec()
}

/// Rows after an instant.
fn beyond<T: Clone>(rows: &[T], last: Option<i64>, t: impl Fn(&T) -> i64) -> Vec<T> {
    since(rows, last.map_or(0, |last| rows.partition_point(|row| t(row) <= last)))
}

/// Index of the first instant after `last`.
fn after(t: &[i64], last: Option<i64>) -> usize {
    last.map_or(0, |last| t.partition_point(|t| *t <= last))
}

fn ego_since(ego: &Ego, last: Option<i64>) -> Ego {
    let from = after(&ego.t, last);
    let [t, x, y, h] = [&ego.t, &ego.x, &ego.y, &ego.h].map(|column| since(column, from));
    let [v, a, lat, steer] = [&ego.v, &ego.a, &ego.lat, &ego.steer].map(|column| since(column, from));
    Ego { t, x, y, h, v, a, lat, steer }
}

fn commands_since(all: &Commands, last: Option<i64>) -> Commands {
    let from = after(&all.t, last);
    let [t, steer, throttle, brake] =
        [&all.t, &all.steer, &all.throttle, &all.brake].map(|column| since(column, from));
    Commands { t, steer, throttle, brake }
}

/// Poses of an actor after an instant. One instant is enough for all actors, as each message has the poses of all of
/// them.
fn actor_since(actor: &Actor, last: Option<i64>) -> Actor {
    let from = after(&actor.t, last);
    let [t, x, y, h] = [&actor.t, &actor.x, &actor.y, &actor.h].map(|column| since(column, from));
    Actor { t, x, y, h, name: actor.name.clone(), kind: actor.kind.clone(), ..*actor }
}
