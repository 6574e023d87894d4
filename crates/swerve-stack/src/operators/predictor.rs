//! Where the others will be: straight lines through past sightings, along the road, or as another predictor has it.

use swerve_core::Span;
use swerve_flow::{At, Context, Inputs, Operator, Port};
use swerve_msg::{PredictionList, Route, TrackList};
use swerve_prediction::{Horizon, PredictorName, forecast, linear, road};

use crate::kind::{Kind, NoKeys, Node};
use crate::site::Site;

/// Straight lines through past sightings, or what another predictor makes of them.
pub(super) struct Predictor {
    name: PredictorName,
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
        let name = prediction.predictor;
        let on_road = match name {
            PredictorName::Linear => prediction.along_road,
            _ => name == PredictorName::LaneIdm,
        };
        let road = on_road.then(|| site.surroundings().route.clone());
        Ok(Self { name, params, road })
    }
}

impl Predictor {
    fn lines(&self, tracks: &TrackList) -> PredictionList {
        let mut list = linear::predict(tracks, &self.params);
        if let Some(route) = &self.road {
            road::follow(&mut list.predictions, route);
        }
        list
    }
}

impl Operator for Predictor {
    type In = In;
    type Out = Port<PredictionList>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(tracks) = input.tracks.get() {
            out.loan().send(match self.name {
                PredictorName::Linear => self.lines(tracks),
                name => {
                    let linear::Params { future_steps: steps, step_s, .. } = self.params;
                    let horizon = Horizon { steps, step: Span::from_secs(step_s) };
                    PredictionList::from(&forecast(name, tracks, &horizon, self.road.as_ref()))
                }
            });
        }
    }
}
