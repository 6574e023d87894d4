//! Records the calls of the MPC in drives: `cargo bench -p swerve-benches --bench control -- record`.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::{Arc, Mutex};

use swerve_control::mpc::{Knot, State};
use swerve_control::{Controller as _, Input, Law, LawController, Params};
use swerve_drive::{RunInput, drive_observed, load};
use swerve_flow::{Event, Observer, Publication};
use swerve_msg::{Command, EgoState, Plan, Route};
use swerve_stack::Registry;
use swerve_stack::pipeline::controller;

use super::DRIVES;
use super::control_ticks::Tick;

/// Number of instants of a drive, and of consecutive calls at each.
const INSTANTS: usize = 16;
const CALLS: usize = 4;

/// Scenario, assignments, true for an emergency.
const RECORDED: [(&str, &[&str], bool); 6] = [
    ("lane", &[], false),
    ("street", &[], false),
    ("person_behind_truck", &["scenario.ego.target_speed_mps=12"], true),
    ("person_behind_truck", &["scenario.ego.target_speed_mps=16"], true),
    ("person_behind_truck", &[], true),
    ("person_behind_truck", &["scenario.ego.target_speed_mps=24"], true),
];

/// A controller with the inputs of the one in the drive, in the same order.
struct Repeated {
    controller: LawController,
    route: Route,
    ego: Option<EgoState>,
    plan: Option<Plan>,
    ticks: Vec<Tick>,
}

impl Repeated {
    fn publication(&mut self, publication: &Publication<'_>) {
        let Some(payload) = publication.payload else { return };
        if let Some(ego) = payload.downcast_ref::<EgoState>() {
            self.ego = Some(*ego);
        } else if let Some(plan) = payload.downcast_ref::<Plan>() {
            self.plan = Some(plan.clone());
        } else if payload.downcast_ref::<Command>().is_some()
            && let Some(ego) = &self.ego
        {
            let now = publication.visible_at;
            self.controller.step(&Input { now, ego, plan: self.plan.as_ref(), route: &self.route });
            if let Some((start, knots)) = self.controller.posed() {
                self.ticks.push(Tick { start, knots: knots.to_vec() });
            }
        }
    }
}

/// Drives once. Returns the selected calls.
fn record(scenario: &str, sets: &[&str]) -> anyhow::Result<Vec<Tick>> {
    let mut set: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    set.push("control.controller=mpc".to_owned());
    let input = RunInput { scenario: scenario.into(), config: vec![], set, seed: None, allow_code: false };
    let (config, scenario) = load(&Registry::default(), &input)?;
    let repeated = Arc::new(Mutex::new(Repeated {
        controller: controller(&config.sim.vehicle, Params { law: Law::Mpc, ..Params::default() }),
        route: scenario.road.route(),
        ego: None,
        plan: None,
        ticks: vec![],
    }));
    let seen = Arc::clone(&repeated);
    let mut observer = move |event: &Event<'_>| {
        if let Event::Publication(publication) = event {
            seen.lock().expect("one thread").publication(publication);
        }
    };
    drive_observed(&config, &scenario, 1, &mut [&mut observer as &mut dyn Observer])?;
    let mut ticks = std::mem::take(&mut repeated.lock().expect("one thread").ticks);
    let every = (ticks.len() / INSTANTS).max(1);
    let mut k = 0;
    ticks.retain(|_| {
        k += 1;
        (k - 1) % every < CALLS
    });
    ticks.truncate(INSTANTS * CALLS);
    Ok(ticks)
}

fn numbers(out: &mut String, numbers: &[f64]) {
    let texts: Vec<String> = numbers
        .iter()
        .map(|x| {
            let rounded = (x * 1e5).round() / 1e5;
            format!("{}", if rounded == 0.0 { 0.0 } else { rounded })
        })
        .collect();
    let _infallible = write!(out, "[{}]", texts.join(","));
}

fn state(s: &State) -> [f64; 6] {
    [s.pose.x_m, s.pose.y_m, s.pose.heading_rad, s.speed_mps, s.steering_rad, s.accel_mps2]
}

fn knot(knot: &Knot) -> [f64; 10] {
    let [x, y, heading, speed, steering, _] = state(&knot.state);
    let wanted = [knot.wanted_along_m, knot.wanted_speed_mps, knot.wanted_accel_mps2];
    let [along, wanted_speed, accel] = wanted;
    [x, y, heading, speed, steering, along, wanted_speed, accel, knot.left_m, knot.right_m]
}

/// Writes the calls of all drives.
pub(crate) fn write() -> anyhow::Result<()> {
    let mut drives = Vec::new();
    for (scenario, sets, emergency) in RECORDED {
        let name = [&[scenario][..], sets].concat().join(" ");
        let mut calls = Vec::new();
        for tick in record(scenario, sets)? {
            let mut call = "{\"start\":".to_owned();
            numbers(&mut call, &state(&tick.start));
            call += ",\"knots\":[";
            for (k, each) in tick.knots.iter().enumerate() {
                call += if k == 0 { "" } else { "," };
                numbers(&mut call, &knot(each));
            }
            calls.push(call + "]}");
        }
        let calls = calls.join(",\n");
        drives.push(format!("{{\"name\":\"{name}\",\"emergency\":{emergency},\"calls\":[\n{calls}\n]}}"));
    }
    Ok(std::fs::write(Path::new(DRIVES), format!("[\n{}\n]\n", drives.join(",\n")))?)
}
