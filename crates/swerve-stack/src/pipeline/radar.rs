use swerve_flow::{Context, Every, Latest, Operator, Port};
use swerve_msg::RadarScan;
use swerve_msg::truth::{RadarSources, WorldState};
use swerve_sim::sense::Radar;

/// A radar on the ego: its echoes, and what they come from.
pub(super) struct RadarOperator {
    pub(super) radar: Radar,
    pub(super) seed: u64,
}

impl Operator for RadarOperator {
    type In = (Every, Latest<WorldState>);
    type Out = (Port<RadarScan>, Port<RadarSources>);

    fn step(&mut self, cx: &mut Context<'_>, (_, world): &Self::In, out: &mut Self::Out) {
        let Some(world) = world.get() else { return };
        let (scan, sources) = self.radar.scan(world, cx.name(), self.seed);
        out.0.send(scan);
        out.1.send(sources);
    }
}
