//! The pipeline's own text, part by part, with the changes of a configuration.

use std::borrow::Cow;
use std::sync::LazyLock;

use swerve_pylot::Preset;
use swerve_scenario::{Course, Road};
use toml::de::DeTable;

use crate::config::execution::Runtime;
use crate::config::{OperatorConfig, PlanningConfig};
use crate::kind::{Role, Scheduled, Settings};
use crate::setup::Setup;

/// A part of the pipeline: its operators, in order.
struct Part(LazyLock<Vec<(String, OperatorConfig)>>);

macro_rules! part {
    ($file:literal) => {
        Part(LazyLock::new(|| read(include_str!(concat!("base/", $file)))))
    };
}

static WORLD: Part = part!("world.toml");
static STACK: Part = part!("stack.toml");
static PAPER: Part = part!("paper.toml");
static CAR: Part = part!("car.toml");
static OUTSIDE: Part = part!("outside.toml");
static VEHICLE: Part = part!("vehicle.toml");
static OBJECTS: Part = part!("objects.toml");
static GATE: Part = part!("gate.toml");
static LIGHTS: Part = part!("lights.toml");
static CLOSURES: Part = part!("closures.toml");

/// Operators of a text, in the order of the text.
fn read(text: &str) -> Vec<(String, OperatorConfig)> {
    #[derive(serde::Deserialize)]
    struct File {
        operator: std::collections::BTreeMap<String, OperatorConfig>,
    }
    let file: File = swerve_text::built_in(text);
    let spans = DeTable::parse(text).expect("it was just read");
    let place = |name: &str| {
        let tables = spans.get_ref().get("operator").and_then(|tables| tables.get_ref().as_table());
        tables
            .and_then(|tables| tables.iter().find(|(key, _)| key.get_ref() == name))
            .map(|(key, _)| key.span().start)
    };
    let mut operators: Vec<(String, OperatorConfig)> = file.operator.into_iter().collect();
    operators.sort_by_key(|(name, _)| place(name));
    operators
}

/// All operators that a configuration may have: the pipeline's own, then sensors with named tables after the other
/// sensors, then those that `[operator.NAME]` adds, by name.
pub(crate) fn entries(setup: &Setup) -> Vec<(String, OperatorConfig)> {
    let (before, behind): (&[&Part], &[&Part]) = if setup.live.is_some() {
        (&[&VEHICLE], &[&OBJECTS, &STACK, &GATE])
    } else if setup.is_driven_over_ros2() {
        (&[&OUTSIDE, &WORLD], &[&CAR])
    } else {
        (&[&WORLD], &[&STACK, &CAR])
    };
    let of = |parts: &[&Part]| -> Vec<(String, OperatorConfig)> {
        parts.iter().flat_map(|part| part.0.iter().cloned()).collect()
    };
    let mut entries = [of(before), sensors(setup), of(behind)].concat();
    let paper = if setup.planning.preset == Preset::Paper { of(&[&PAPER]) } else { Vec::new() };
    for (name, own) in &mut entries {
        if let Some((_, set)) = paper.iter().find(|(known, _)| known == name) {
            *own = changed(own, set);
        }
        if let Some(set) = setup.operator.get(name) {
            *own = changed(own, set);
        }
        if setup.localization.replaces(name) && own.enabled.is_none() {
            own.enabled = Some(false);
        }
    }
    let mut new = setup.operator.clone();
    for (name, localizer) in setup.localization.operators(&setup.registry) {
        let own = new.get(&name).map_or_else(|| localizer.clone(), |set| changed(&localizer, set));
        new.insert(name, own);
    }
    new.retain(|name, _| !entries.iter().any(|(known, _)| known == name));
    entries.extend(new);
    entries
}

/// The configuration on this road. On a road with traffic lights the simulated stack sees them, unless an operator of
/// kind `traffic_lights` does; on a map with closed places it reads reports of them.
pub(crate) fn on_road<'a>(setup: &'a Setup, road: &Road) -> Cow<'a, Setup> {
    let has = |kind: &str| setup.operator.values().any(|own| own.kind.as_deref() == Some(kind));
    let is_simulated = setup.live.is_none() && !setup.is_driven_over_ros2();
    let plans =
        setup.operator.get("planner").is_none_or(|own| own.kind.is_none() && own.enabled != Some(false));
    let sees_lights = !road.lights.is_empty() && setup.stops_at_lights() && !has("traffic_lights");
    let has_closures = matches!(&road.course, Course::Map(course) if !course.closures.is_empty());
    let parts = [(&LIGHTS, sees_lights && plans), (&CLOSURES, has_closures)];
    let mut setup = Cow::Borrowed(setup);
    for (part, _) in parts.into_iter().filter(|(_, is_there)| is_simulated && *is_there) {
        for (name, own) in part.0.iter() {
            let set = setup.operator.get(name).map_or_else(|| own.clone(), |set| changed(own, set));
            setup.to_mut().operator.insert(name.clone(), set);
        }
    }
    setup
}

/// An operator of the pipeline with the settings of a configuration. An operator of another kind does not keep its
/// inputs.
fn changed(base: &OperatorConfig, set: &OperatorConfig) -> OperatorConfig {
    let same_kind = set.kind.is_none() || set.kind == base.kind;
    let mut reads = if same_kind { base.reads.clone() } else { Default::default() };
    reads.extend(set.reads.clone());
    OperatorConfig { kind: set.kind.clone().or_else(|| base.kind.clone()), reads, ..set.clone() }
}

/// Cameras, radars and lidars, each followed by its monitors.
fn sensors(setup: &Setup) -> Vec<(String, OperatorConfig)> {
    let of = |kind: &str| OperatorConfig { kind: Some(kind.to_owned()), ..OperatorConfig::default() };
    let mut entries = Vec::new();
    let radars = setup.radar.keys().map(|name| (name, "radar"));
    let cameras = setup.camera.keys().map(|name| (name, "camera"));
    let lidars = setup.lidar.keys().map(|name| (name, "lidar"));
    for (name, kind) in radars.chain(cameras).chain(lidars) {
        entries.push((name.clone(), of(kind)));
        let watching = setup.monitor.iter().filter(|(_, monitor)| monitor.sensor == *name);
        entries.extend(watching.map(|(name, _)| (name.clone(), of("sensor_monitor"))));
    }
    entries
}

/// Names of the pipeline's own operators, under any settings.
pub(crate) fn pipeline_names() -> impl Iterator<Item = &'static str> {
    let parts: [&'static Part; 10] =
        [&OUTSIDE, &VEHICLE, &WORLD, &OBJECTS, &STACK, &PAPER, &CAR, &GATE, &LIGHTS, &CLOSURES];
    parts.into_iter().flat_map(|part| part.0.iter().map(|(name, _)| name.as_str()))
}

/// Returns true if only a vehicle of `swerve live` feeds this kind.
pub(crate) fn is_fed_by_vehicle(kind: &str) -> bool {
    let has = |part: &Part| part.0.iter().any(|(_, own)| own.kind.as_deref() == Some(kind));
    has(&VEHICLE) && !has(&WORLD) && !has(&OUTSIDE)
}

/// First enabled operator that the models of `[execution]` schedule as `scheduled`: its usual run time, ms, where that
/// is known.
pub(crate) fn scheduled_operator(setup: &Setup, scheduled: Scheduled) -> Option<Option<f64>> {
    entries(setup).into_iter().filter(|(_, own)| own.enabled != Some(false)).find_map(|(name, own)| {
        let kind = setup.registry.kind(own.kind.as_deref()?)?;
        let settings = Settings { name: &name, setup, offered: &[] };
        let is_meant = kind.node().scheduled == Some(scheduled) && kind.is_there(&settings);
        let said_ms = own.runtime.as_ref().map(Runtime::typical_ms);
        is_meant.then(|| said_ms.or_else(|| kind.takes_ms(&settings).map(|[usual_ms, _]| usual_ms)))
    })
}

/// Names of all sensors, running or not.
pub(crate) fn sensor_operators(setup: &Setup) -> Vec<String> {
    let of = |own: &OperatorConfig| setup.registry.kind(own.kind.as_deref()?).map(|kind| kind.node());
    let is_sensor = |own: &OperatorConfig| of(own).is_some_and(|node| node.role == Role::Sensor);
    entries(setup).into_iter().filter(|(_, own)| is_sensor(own)).map(|(name, _)| name).collect()
}

impl Setup {
    /// Expected time from a sensor frame to its plan's first effect, ms: the sum of the detector's and the planner's.
    pub fn expected_ms(&self) -> f64 {
        let PlanningConfig { expected_ms, .. } = self.planning;
        let detector_ms = scheduled_operator(self, Scheduled::Detector).flatten().unwrap_or(0.0);
        expected_ms.unwrap_or_else(|| self.planning.expected_ms() + detector_ms)
    }
}
