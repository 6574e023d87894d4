//! Signals of a map's lights, as a foreign world knows them.

use std::collections::BTreeMap;

use anyhow::bail;
use swerve_msg::{EgoState, Route, Signal, TrafficLight, TrafficLights};
use swerve_text::did_you_mean;

use super::Stack;

impl Stack {
    /// Feeds the signals of traffic lights by their names on the map, as they are at the ego's stamp, to the first input of
    /// [`TrafficLights`]. Lights for other traffic than the ego's are left out, as are inputs of a configuration that reads
    /// no lights from outside. Of a map, the scenario's lights are those with phases, or all with `map.all_lights`.
    ///
    /// # Errors
    /// As [`feed`](Self::feed), or if the scenario has no light of a name.
    pub fn feed_lights(&mut self, ego: &EgoState, signals: &BTreeMap<String, Signal>) -> anyhow::Result<()> {
        let road = &self.scenario.road;
        if let Some(unknown) =
            signals.keys().find(|name| road.lights.iter().all(|light| light.name != **name))
        {
            let near = did_you_mean(unknown, road.lights.iter().map(|light| light.name.as_str()));
            bail!("unknown light `{unknown}`: the scenario has {} lights{near}", road.lights.len());
        }
        let Some(input) = self.inputs.first_of::<TrafficLights>() else { return Ok(()) };
        let name = input.stream.name.clone();
        let newest = self.newest::<Route>("router").ok().flatten();
        let route = newest.map_or(&self.route, |(_, route)| route);
        let lights = road.lights.iter().filter_map(|light| {
            let signal = Some(*signals.get(&light.name)?);
            Some(TrafficLight {
                name: Some(light.name.clone()),
                signal,
                seen: signal,
                score: 1.0,
                distance_m: ego.pose.point().distance(light.pose.point()),
                stop_s_m: Some(road.stop_s_m(light, route)?),
                ..TrafficLight::default()
            })
        });
        let lights = TrafficLights { stamp: ego.stamp, lights: lights.collect() };
        self.feed(&name, lights)
    }
}
