//! Straight lines through past sightings, and along the road.

use swerve_flow::{At, Context, Inputs, Operator, Port};
use swerve_msg::{PredictionList, Route, TrackList};
use swerve_prediction::{linear, road};

use crate::kind::{Kind, NoKeys, Node};
use crate::site::Site;

/// Straight lines through past sightings.
pub(super) struct Predictor {
    params: linear::Params,
    /// What vehicles follow.
    road: Option<Route>,
}

/// What is tracked.
#[derive(Inputs)]
pub(super) struct In {
    /// Tracks with their past sightings.
    tracks: At<TrackList>,
}

impl Kind for Predictor {
    const NODE: Node = Node::new("linear_predictor", "a straight line through each actor's past sightings")
        .sections(&["prediction"]);
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let prediction = &site.config().prediction;
        let params = linear::Params {
            past_steps: prediction.past_steps,
            future_steps: (prediction.horizon_ms / prediction.step_ms).round() as usize,
            step_s: prediction.step_ms * 1e-3,
            ..prediction.preset.linear()
        };
        let road = prediction.along_road.then(|| site.surroundings().route.clone());
        Ok(Self { params, road })
    }
}

impl Operator for Predictor {
    type In = In;
    type Out = Port<PredictionList>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(tracks) = input.tracks.get() {
            let mut list = linear::predict(tracks, &self.params);
            if let Some(route) = &self.road {
                road::follow(&mut list.predictions, route);
            }
            out.loan().send(list);
        }
    }
}
