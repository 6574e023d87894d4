//! What a page that is shown while the run goes on does not have yet.

use super::run::{Actor, Commands, Ego, RunPage};
use super::{Collector, Photo, Plan, Predictions, Tracks};

/// How many rows of each table a page has.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Have {
    /// States of the ego.
    pub ego: usize,
    /// Commands.
    pub commands: usize,
    /// Messages of tracks.
    pub tracks: usize,
    /// Messages of predictions.
    pub predictions: usize,
    /// Plans.
    pub plans: usize,
    /// Pictures.
    pub photos: usize,
    /// The last instant of all actors' ways, microseconds; none before the first.
    pub actors: Option<i64>,
}

/// The rows that came since; columns as in [`RunPage`].
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
    /// What is known by now beyond what a page has.
    pub fn rows(&self, have: &Have) -> Rows {
        let RunPage { end, ego, actors, commands, tracks, predictions, plans, photos, .. } = self.so_far();
        Rows {
            end: *end,
            ego: ego_since(ego, have.ego),
            actors: actors.iter().map(|actor| actor_since(actor, have.actors)).collect(),
            commands: commands_since(commands, have.commands),
            tracks: since(tracks, have.tracks),
            predictions: since(predictions, have.predictions),
            plans: since(plans, have.plans),
            photos: since(photos, have.photos),
        }
    }
}

fn since<T: Clone>(column: &[T], from: usize) -> Vec<T> {
    column.get(from..).unwrap_or_default().to_vec()
}

fn ego_since(ego: &Ego, from: usize) -> Ego {
    let [t, x, y, h] = [&ego.t, &ego.x, &ego.y, &ego.h].map(|column| since(column, from));
    let [v, a, lat, steer] = [&ego.v, &ego.a, &ego.lat, &ego.steer].map(|column| since(column, from));
    Ego { t, x, y, h, v, a, lat, steer }
}

fn commands_since(all: &Commands, from: usize) -> Commands {
    let [t, steer, throttle, brake] =
        [&all.t, &all.steer, &all.throttle, &all.brake].map(|column| since(column, from));
    Commands { t, steer, throttle, brake }
}

/// An actor's way beyond an instant: those of all actors grow by the same messages.
fn actor_since(actor: &Actor, last: Option<i64>) -> Actor {
    let from = last.map_or(0, |last| actor.t.partition_point(|t| *t <= last));
    let [t, x, y, h] = [&actor.t, &actor.x, &actor.y, &actor.h].map(|column| since(column, from));
    Actor { t, x, y, h, name: actor.name.clone(), kind: actor.kind.clone(), ..*actor }
}
