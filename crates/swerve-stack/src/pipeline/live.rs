//! The parts of the pipeline that drive a real vehicle as they drive the simulated one.

use swerve_core::Span;
use swerve_flow::{Graph, Source, Stream, every};
use swerve_msg::{
    EgoState, GateOutput, Image, MotionCommand, ObstacleList, Plan, PointCloud, Route, Supervision, Switch,
    VehicleReport,
};
use swerve_scenario::Scenario;

use super::{controller, gate, monitor, perception, planner};
use crate::config::Config;

/// A stream that monitors watch.
pub enum Monitored {
    /// Of a camera.
    Image(Stream<Image>),
    /// Of a lidar.
    Cloud(Stream<PointCloud>),
}

/// Adds the monitors of a sensor.
pub fn monitors(graph: &mut Graph, config: &Config, sensor: &str, stream: Monitored) {
    for (name, _) in config.monitor.iter().filter(|(_, monitor)| monitor.sensor == sensor) {
        match stream {
            Monitored::Image(images) => {
                graph.add(name, monitor::ImageMonitor::default(), (images,)).out();
            }
            Monitored::Cloud(clouds) => {
                graph.add(name, monitor::CloudMonitor::default(), (clouds,)).out();
            }
        }
    }
}

/// Adds tracker, predictor, planner and controller, for a vehicle that is told motion.
pub fn drive(
    graph: &mut Graph,
    config: &Config,
    scenario: &Scenario,
    route: &Route,
    (obstacles, pose): (Stream<ObstacleList>, Stream<EgoState>),
) -> anyhow::Result<(Stream<Plan>, Stream<MotionCommand>)> {
    let tracks = graph.add("tracker", perception::Tracker::new(config), (obstacles,)).out();
    let predictions = graph.add("predictor", perception::Predictor::new(config), (tracks,)).out();
    let planner = planner::PlannerOperator::new(config, scenario, route)?;
    let plan = graph.add("planner", planner, (predictions, pose)).out();
    let controller = controller::MotionController(controller::Driver::new(config, route));
    let period = every(Span::from_secs(config.control.period_ms * 1e-3));
    let processes = Vec::<Source<Supervision>>::new();
    let wishes = graph.add("controller", controller, (period, pose, plan, processes)).out();
    Ok((plan, wishes))
}

/// Adds the gate before a vehicle at the other end of a wire.
pub fn live_gate(
    graph: &mut Graph,
    config: &Config,
    commands: Stream<MotionCommand>,
    report: Stream<VehicleReport>,
    switch: Stream<Switch>,
) -> anyhow::Result<Stream<GateOutput>> {
    let params = config.gate_params().map_err(|message| anyhow::anyhow!("gate.params: {message}"))?;
    let inputs = gate::GateInputs { commands, report, switches: vec![switch.into()] };
    gate::gate(graph, params, Span::from_secs(config.gate.period_ms * 1e-3), inputs)
}
