//! Radars on the ego.

use swerve_flow::PortInfo;
use swerve_flow::{
    Context, Every, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs, Port,
};
use swerve_msg::RadarScan;
use swerve_msg::truth::{RadarSources, WorldState};
use swerve_sim::sense::Radar;

use super::camera::on_its_way;
use crate::config::execution::span_of_ms;
use crate::config::sensors::RadarConfig;
use crate::kind::{Node, OnItsWay, OperatorKind, Settings};
use crate::site::Site;
use crate::unseen::Unseen;

/// Radars, `[radar.NAME]`.
pub(super) struct Radars;

/// A radar on the ego: its echoes, and their sources.
struct RadarOperator {
    radar: Radar,
    unseen: Unseen,
    seed: u64,
}

/// The newest state of the world, at each scan.
#[derive(Inputs)]
struct In {
    /// Period of the radar.
    tick: Every,
    /// State of the world to scan.
    world: Latest<WorldState>,
}

/// One scan.
#[derive(Outputs)]
struct Out {
    /// Echoes.
    scan: Port<RadarScan>,
    /// Sources of the echoes.
    truth: Port<RadarSources>,
}

impl OperatorKind for Radars {
    fn node(&self) -> Node {
        Node::sensor("radar", "a radar on the ego: range, range rate and azimuth of echoes")
            .section(&RadarConfig::SECTION)
            .origin()
            .on_demand()
            .follows_from_world()
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        Out::ports()
    }

    fn inputs(&self, _: &Settings<'_>) -> Vec<PortInfo> {
        In::ports()
    }

    fn is_there(&self, settings: &Settings<'_>) -> bool {
        settings.setup.live.is_none()
    }

    fn on_its_way(&self, settings: &Settings<'_>) -> Option<OnItsWay> {
        on_its_way(settings)
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let (settings, vehicle) = (site.settings(), &site.config().sim.vehicle);
        let Some(config) = settings.setup.radar.get(settings.name) else {
            anyhow::bail!("radar.{}: there is no such table", settings.name);
        };
        let wrong = |problems| anyhow::anyhow!("radar.{}: {problems:?}", settings.name);
        let radar = config.radar(vehicle).map_err(wrong)?;
        let unseen = Unseen::new(&settings.setup.sensing, &site.surroundings().scenario)?;
        let operator = RadarOperator { radar, unseen, seed: settings.setup.seed };
        let timer = settings.drawn_timer(span_of_ms(config.period_ms()));
        site.add(operator, Some(timer))
    }
}

impl Operator for RadarOperator {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Out) {
        let Some(world) = input.world.get() else { return };
        let (scan, sources) = self.radar.scan(&self.unseen.seen(world), cx.name(), self.seed);
        out.scan.send(scan);
        out.truth.send(sources);
    }
}
