//! Safety gate before a simulated or real vehicle.
//!
//! ```text
//!  controller --MotionCommand--> gate --GateOutput--> pedals --Command--> world
//!  pose > report --VehicleReport---^  ^--Switch-- switch
//! ```

use swerve_control::safety_gate::{GateInput, SafetyGate};
use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer, every};
use swerve_msg::{EgoState, GateOutput, MotionCommand, Plan, PoseQuality, Switch, VehicleReport, WireAlarm};

use crate::config::execution::span_of_ms;
use crate::config::gate::GateConfig;
use crate::kind::{Kind, Node, Settings};
use crate::section::Section;
use crate::site::Site;

/// Runs the gate's state machine at its period, on the newest inputs.
pub(super) struct Gate(SafetyGate);

/// Newest inputs, at each tick.
#[derive(Inputs)]
pub(super) struct In {
    /// Period of the gate.
    tick: Every,
    /// Command of the stack.
    command: Latest<MotionCommand>,
    /// Report of the vehicle.
    report: Latest<VehicleReport>,
    /// Switches: all of them have to enable, and each alone may stop. Without a switch nothing is ever enabled.
    switches: Vec<Latest<Switch>>,
    /// Alarms of the connections by which commands arrive, if any.
    alarms: Vec<Latest<WireAlarm>>,
    /// Quality of the pose, if localization reports it.
    quality: Vec<Latest<PoseQuality>>,
    /// Pose that the stack uses.
    pose: Option<Latest<EgoState>>,
    /// Newest plan: the path of a stop.
    plan: Option<Latest<Plan>>,
}

impl Kind for Gate {
    const NODE: Node = Node::new("safety_gate", "what may reach a vehicle: limits, time-outs, stops")
        .only_with("gate.enabled = true")
        .stays("it is the safety gate");
    type Table = GateConfig;
    const SECTION: Section<GateConfig> = GateConfig::SECTION;

    fn is_there(settings: &Settings<'_>) -> bool {
        settings.setup.gate.enabled || settings.setup.live.is_some()
    }

    fn new(_: GateConfig, site: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self(SafetyGate::new(site.resolved().gate)?))
    }

    fn timer(gate: &GateConfig, _: &Settings<'_>) -> Option<Timer> {
        Some(every(span_of_ms(gate.period_ms)))
    }
}

impl Operator for Gate {
    type In = In;
    type Out = Port<GateOutput>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let In { command, report, switches, alarms, quality, pose, plan, .. } = input;
        let switch = |of: fn(&Switch) -> bool| move |s: &Latest<Switch>| s.get().is_some_and(|s| of(s));
        out.loan().send(self.0.step(&GateInput {
            now: cx.now(),
            command: command.get().map(|command| **command),
            origin: command.get().and_then(|command| command.header().origin),
            report: report.get().map(|report| **report),
            enable: !switches.is_empty() && switches.iter().all(switch(|s| s.enable)),
            emergency: switches.iter().any(switch(|s| s.emergency)),
            alarm: alarms.iter().find_map(|alarm| alarm.get()?.cause),
            quality:
                quality.iter().filter_map(|quality| Some(**quality.get()?)).max_by_key(|q| q.mode.rank()),
            plan: plan.as_ref().and_then(|plan| Some(&**plan.get()?)),
            pose: pose.as_ref().and_then(|pose| Some(**pose.get()?)),
        }));
    }
}
