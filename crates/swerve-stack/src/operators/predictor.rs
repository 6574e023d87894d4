//! Predictions of the other road users: straight lines through past sightings, along the road, or by another predictor.
//!
//! The predictor `truth` gets its data from the simulated world, as an emulated detector does: it reads every state of
//! it.

use std::sync::Arc;

use swerve_core::Time;
use swerve_flow::{
    At, Context, Inputs, Latest, Message, NamedInputs, NamedOutputs, Operator, OutputInfo, Port, PortInfo,
    Window,
};
use swerve_geom::{Point2, Pose2};
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorId, PredictionList, Route, Track, TrackList};
use swerve_prediction::{Ground, Horizon, LaneFollowing, Predictor, Telling, foretold};
use swerve_scenario::Course;
use swerve_sim::{Ahead, SimParams};
use swerve_text::{KeyProblem, in_one_line};

use crate::config::PredictionConfig;
use crate::config::execution::span_of_ms;
use crate::kind::{Node, OperatorKind, Settings};
use crate::predictors::{NamedPredictor as _, Truth};
use crate::site::Site;

/// States of the world that are kept: as many as arrive during a step of one second, at 400 Hz.
const STATES: usize = 400;
/// Largest distance from a track to its actor, which is the nearest one, metres.
const SAME_M: f64 = 3.0;

/// Predictors: from tracks only, or from the simulator's truth.
pub(super) struct Predictors;

/// Predicts from tracks alone.
struct ByTracks {
    predictor: Box<dyn Predictor>,
    horizon: Horizon,
    /// True if covariances are published.
    covariances: bool,
    /// True if vehicles are predicted along the road.
    follows_road: bool,
    /// Ways of those that do not follow the road, on a map.
    ways: Option<LaneFollowing>,
}

/// Tracks for a predictor.
#[derive(Inputs)]
struct In {
    /// Tracks with their past sightings.
    tracks: At<TrackList>,
    /// Route of the ego, along which vehicles on it are predicted.
    route: Latest<Route>,
}

/// Predicts from the simulated world's future.
struct Oracle {
    ahead: Ahead,
    telling: Telling,
    horizon: Horizon,
    /// True if covariances are published.
    covariances: bool,
    /// Number of world states taken.
    taken: u64,
}

/// Tracks, and the states of the world.
#[derive(Inputs)]
struct OracleIn {
    /// Tracks to predict.
    tracks: At<TrackList>,
    /// States of the world so far.
    worlds: Window<WorldState, STATES>,
}

fn is_told(settings: &Settings<'_>) -> bool {
    settings.setup.prediction.predictor.as_str() == Truth::NAME
}

impl OperatorKind for Predictors {
    fn node(&self) -> Node {
        Node::new("predictor", "predicted motions of tracks, by the predictor that the configuration names")
            .section(&PredictionConfig::SECTION)
            .on_ladder()
    }

    fn stays(&self, settings: &Settings<'_>) -> Option<&'static str> {
        is_told(settings).then_some("it reads the simulated world")
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        <Port<PredictionList> as NamedOutputs>::ports()
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        if is_told(settings) { OracleIn::ports() } else { In::ports() }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let config = site.setup();
        let prediction = &config.prediction;
        let (horizon, covariances) = (prediction.horizon(), prediction.covariances);
        if is_told(&site.settings()) {
            let params = SimParams { dt: span_of_ms(config.sim.dt_ms), vehicle: config.sim.vehicle.clone() };
            let telling = Telling {
                horizon: prediction.truth_horizon_ms.map(span_of_ms),
                noise_mps: prediction.truth_noise_mps,
                seed: config.seed,
            };
            let ahead = Ahead::new(&site.surroundings().scenario, &params);
            let oracle = Oracle { ahead, telling, horizon, covariances, taken: 0 };
            return site.add_carrying(oracle, None, Oracle::carry);
        }
        let follows_road = prediction.follows_road(&config.registry);
        let wrong = |message| anyhow::anyhow!("prediction.weights: {message}");
        let weights = prediction.file_weights().map_err(wrong)?;
        let wrong = |found: Vec<KeyProblem>| anyhow::anyhow!("prediction: {}", in_one_line(&found));
        let predictor = prediction.built(&config.registry, weights.as_ref()).map_err(wrong)?;
        let map = match &site.surroundings().scenario.road.course {
            Course::Map(course) => Some(Arc::clone(&course.map)),
            Course::Strip(_) => None,
        };
        let ways = map.filter(|_| follows_road).map(LaneFollowing::new);
        site.add(ByTracks { predictor, horizon, covariances, follows_road, ways }, None)
    }
}

/// Removes covariances unless they are to be published, and with them whether modes are joint.
fn published(mut list: PredictionList, covariances: bool) -> PredictionList {
    if !covariances {
        list.joint = false;
        list.predictions.iter_mut().for_each(|one| one.covariances_m2 = Vec::new());
    }
    list
}

impl Operator for ByTracks {
    type In = In;
    type Out = Port<PredictionList>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(tracks) = input.tracks.get() {
            let (predictor, horizon) = (&mut *self.predictor, &self.horizon);
            let road = input.route.get().filter(|_| self.follows_road).map(|route| &**route);
            let list = match (&mut self.ways, road) {
                (Some(ways), Some(road)) => ways.predict(predictor, tracks, horizon, road),
                (_, road) => predictor.predict(tracks, horizon, Ground::road(road)),
            };
            out.loan().send(published(list, self.covariances));
        }
    }
}

impl Operator for Oracle {
    type In = OracleIn;
    type Out = Port<PredictionList>;

    fn step(&mut self, _: &mut Context<'_>, input: &OracleIn, out: &mut Self::Out) {
        let worlds: &[Message<WorldState>] = input.worlds.get();
        worlds
            .iter()
            .filter(|world| world.header().seq >= self.taken)
            .for_each(|world| self.ahead.watch(world));
        self.taken = worlds.last().map_or(self.taken, |newest| newest.header().seq + 1);
        if let Some(tracks) = input.tracks.get() {
            let now: Vec<_> = self.ahead.all_at(tracks.stamp).collect();
            let told = |track: &Track, instants: &[Time]| self.places(&now, track, instants);
            let list = foretold(tracks, &self.horizon, &self.telling, &told);
            out.loan().send(published(list, self.covariances));
        }
    }
}

impl Oracle {
    /// Carries the states of the world over to another rung.
    fn carry(from: &mut Self, to: &mut Self) {
        core::mem::swap(&mut from.ahead, &mut to.ahead);
        core::mem::swap(&mut from.taken, &mut to.taken);
    }

    /// Future positions of the actor of a track, found by the poses of all actors `now`.
    fn places(&self, now: &[(ActorId, Pose2)], track: &Track, instants: &[Time]) -> Option<Vec<Point2>> {
        let off = |(_, pose): &&(ActorId, Pose2)| pose.point().distance(track.pose.point());
        let nearest = now.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
        let (id, _) = nearest.filter(|one| off(one) <= SAME_M)?;
        let place = |at: &Time| Some(self.ahead.pose(*id, *at)?.point());
        instants.iter().map(place).collect()
    }
}
