//! Summary of a run: `metrics.json`, and the text in the terminal.

use std::collections::BTreeMap;

use serde::Serialize;
use swerve_drive::realtime::Obtained;
use swerve_drive::{Budgets, Outcome, RungCount};
use swerve_eval::score::DrivingScores;
use swerve_eval::score::leaderboard::Version;
use swerve_eval::{BehaviourMetrics, GateMetrics, Metrics, OperatorMetrics, Why};
use swerve_flow::{RunReport, TickReport};
use swerve_ipc::Traffic;
use swerve_live::ros2::Ros2Report;
use swerve_msg::Refusals;
use swerve_report::output::align;
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::pipeline::drawn;

/// Punctuality of an operator's timers under wall clock.
#[derive(Serialize, Clone, Debug)]
struct Timer {
    operator: String,
    #[serde(flatten)]
    ticks: TickReport,
}

/// Result of a run, as written to `metrics.json` and printed by `--json`.
#[derive(Serialize, Debug)]
pub struct Summary {
    scenario: String,
    pipeline: String,
    seed: u64,
    /// Hexadecimal, as everywhere else: JSON readers keep only 53 bits of a number.
    digest: String,
    /// Device that computed images and point clouds: `cpu`, or an adapter; null without such sensors.
    images_by: Option<String>,
    /// True if the digest is the same on every machine; false if only for this adapter and driver.
    digest_is_portable: bool,
    /// Cause of an adapter failure after which the CPU rendered the images.
    adapter_lost: Option<String>,
    /// True if the scenario's `[expect]` for this pipeline is met; null if it has none.
    as_expected: Option<bool>,
    not_as_expected: Vec<String>,
    /// Number of road users of the traffic for which there was no place; null without traffic.
    #[serde(skip_serializing_if = "Option::is_none")]
    road_users_left_out: Option<usize>,
    /// Under recorded run times: number of run times drawn because there was no record.
    unrecorded: u64,
    /// Punctuality of the timers under wall clock, by operator.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    timers: Vec<Timer>,
    /// Processors and priority obtained, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) realtime: Option<Obtained>,
    /// Messages between the run's processes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) traffic: Option<Traffic>,
    /// Statistics of the ROS 2 topics.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ros2: Option<Ros2Report>,
    /// Time that the deadline policy allotted from a frame to its plan.
    #[serde(skip_serializing_if = "Option::is_none")]
    response_budget: Option<Budgets>,
    /// Rungs used by detector and planner.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    rungs: Vec<RungCount>,
    #[serde(skip)]
    rungs_text: String,
    #[serde(flatten)]
    metrics: Metrics,
    /// Metrics of the other egos, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    egos: BTreeMap<String, Metrics>,
    /// Causal chain of the actor that decided the verdict, or the event that did if no actor did; null without a log.
    why: Option<Why>,
    /// Current name of an expected verdict that was renamed.
    #[serde(skip)]
    renamed: Option<String>,
}

impl Summary {
    /// Summarizes a run and the reason for its end.
    pub fn of(config: &Setup, scenario: &Scenario, outcome: &Outcome, why: Option<Why>) -> Self {
        let pipeline = config.pipeline_name();
        let expected = scenario.expectation(&pipeline);
        let broken = expected.map(|e| outcome.broken(e));
        Self {
            scenario: scenario.name.clone(),
            pipeline,
            seed: config.seed,
            digest: outcome.digest.to_string(),
            images_by: outcome.rendered.as_ref().map(|r| r.by.clone()),
            digest_is_portable: outcome.rendered.as_ref().is_none_or(|r| r.is_portable),
            adapter_lost: outcome.rendered.as_ref().and_then(|r| r.fell_back.clone()),
            as_expected: broken.as_ref().map(Vec::is_empty),
            not_as_expected: broken.unwrap_or_default(),
            road_users_left_out: scenario.traffic.map(|_| drawn(config, scenario).left_out()),
            unrecorded: outcome.report.operators.iter().map(|o| o.unrecorded).sum(),
            timers: timers(&outcome.report),
            realtime: None,
            traffic: None,
            ros2: None,
            response_budget: outcome.rungs.budgets(),
            rungs: outcome.rungs.counts(),
            rungs_text: outcome.rungs.text(),
            metrics: outcome.metrics.clone(),
            egos: outcome.others.iter().map(|other| (other.ego.clone(), other.metrics.clone())).collect(),
            why,
            renamed: expected.and_then(|e| e.renamed(outcome.metrics.verdict)),
        }
    }

    /// True if the run is as its scenario expects, or the scenario expects nothing.
    pub fn is_as_expected(&self) -> bool {
        self.as_expected.unwrap_or(true)
    }

    /// Text on timers and traffic between processes; empty if there is nothing to report.
    fn clock_text(&self) -> String {
        let mut text = String::new();
        if !self.timers.is_empty() {
            let head = ["timer", "ticks", "missed", "late p50 ms", "p99 ms", "max ms"];
            let head = head.map(str::to_owned).to_vec();
            let lines = self.timers.iter().map(|Timer { operator, ticks }| {
                let ms = |ns: u64| format!("{:.2}", ns as f64 * 1e-6);
                let counts = [ticks.ticks.to_string(), ticks.missed.to_string()];
                let late = [ticks.p50_ns, ticks.p99_ns, ticks.max_ns].map(ms);
                std::iter::once(operator.clone()).chain(counts).chain(late).collect()
            });
            text += &align(&std::iter::once(head).chain(lines).collect::<Vec<_>>());
        }
        if let Some(realtime) = &self.realtime {
            text += &realtime.text();
        }
        if let Some(Traffic { calls, bytes, copied, in_place }) = self.traffic {
            text += &format!(
                "{calls} steps in other processes: {:.1} MB in messages, {in_place} payload arrays read in shared memory, \
                 {copied} bytes of them copied\n",
                bytes as f64 * 1e-6
            );
        }
        text
    }

    /// Text for the terminal.
    pub fn text(&self) -> String {
        use std::fmt::Write as _;
        let m = &self.metrics;
        let mut text = format!("{}, {}, seed {}\n", self.scenario, self.pipeline, self.seed);
        text += &(outcome(m) + "\n");
        let mut row = |name: &str, value: String| {
            let _ = writeln!(text, "  {name:<20}{value}");
        };
        row("no collision", if m.impact.is_none() { "yes" } else { "no" }.to_owned());
        if let Some(first) = &m.first_collision_of_others {
            let more = match m.collisions_of_others {
                0 | 1 => String::new(),
                count => format!(", the first of {count} collisions"),
            };
            row("others", first.words() + &more);
        }
        if let Some(count) = self.road_users_left_out.filter(|count| *count > 0) {
            row("left out", format!("{count} road users of the traffic, for which there is no place"));
        }
        let left = |at_s: f64| format!("no: left it at {at_s:.2} s");
        row("stayed on the road", m.left_road_at_s.map_or_else(|| "yes".to_owned(), left));
        if m.red_lights_passed > 0 {
            row("red lights passed", m.red_lights_passed.to_string());
        }
        if let (Some(distance), Some(at), Some(to)) =
            (m.min_distance_m, m.min_distance_at_s, &m.min_distance_name)
        {
            row("minimum distance", format!("{distance:.2} m at {at:.2} s, to {to}"));
        }
        traffic_rows(m, &mut row);
        m.scores.iter().for_each(|scores| score_row(scores, &mut row));
        if let Some(stands) = m.behaviour.as_ref().and_then(BehaviourMetrics::standstill) {
            row("behaviour", stands);
        }
        let jerk = |j: Option<f64>| j.map_or_else(|| "-".into(), |j| format!("{j:.1}"));
        let (raw, smooth) = (jerk(m.lateral_jerk.raw_max_mps3), jerk(m.lateral_jerk.smooth_max_mps3));
        row("lateral jerk", format!("{raw} m/s3 raw, {smooth} m/s3 low-passed"));
        if let Some(r) = &m.response {
            let (p50, p90, p99, max) = (r.p50_ms, r.p90_ms, r.p99_ms, r.max_ms);
            row("response time", format!("p50 {p50:.0}  p90 {p90:.0}  p99 {p99:.0}  max {max:.0} ms"));
        }
        m.localization.iter().for_each(|found| row("localization", found.text()));
        if let Some(gate) = &m.gate {
            gate_rows(gate, &mut row);
        }
        row("digest", self.digest.clone());
        if let Some(by) = self.images_by.as_ref().filter(|_| !self.digest_is_portable) {
            row("images by", format!("{by}: the digest holds for this adapter and driver alone"));
        }
        if let Some(why) = &self.adapter_lost {
            row("adapter lost", format!("{why}; the processor went on: the digest is not to be had again"));
        }
        for (ego, metrics) in &self.egos {
            let _ = writeln!(text, "  {:<20}{}", format!("ego {ego}"), outcome(metrics));
        }
        text += &operators(&m.operators);
        text += &without_steps(&m.operators);
        text += &self.why.as_ref().map_or_else(String::new, Why::text);
        text += &self.rungs_text;
        text += &self.clock_text();
        if let Some(ros2) = &self.ros2 {
            text += &ros2.text();
        }
        if self.unrecorded > 0 {
            let _ = writeln!(
                text,
                "{} steps had no record and drew their run time from the recorded ones",
                self.unrecorded
            );
        }
        match self.as_expected {
            Some(true) => text += "as the scenario expects\n",
            Some(false) => {
                let _ = writeln!(text, "not as the scenario expects: {}", self.not_as_expected.join("; "));
            }
            None => {}
        }
        text += &self.renamed.as_ref().map_or_else(String::new, |renamed| format!("{renamed}\n"));
        text
    }
}

/// Verdict of a drive, with the impact if there was one.
fn outcome(m: &Metrics) -> String {
    let verdict = m.verdict.name().to_uppercase();
    match m.impact {
        Some(i) => format!(
            "{verdict} at {:.2} s with {}: ego at {:.1} m/s, closing at {:.1} m/s",
            i.at_s,
            m.impact_name.as_deref().unwrap_or_default(),
            i.ego_speed_mps,
            i.closing_speed_mps
        ),
        None => verdict,
    }
}

/// Table with one line per operator.
fn operators(of: &[OperatorMetrics]) -> String {
    let head = ["operator", "steps", "p50 ms", "p99 ms", "misses", "drops"].map(str::to_owned).to_vec();
    let lines = of.iter().map(|o| {
        let ms = |x: f64| format!("{x:.2}");
        let (steps, misses, drops) = (o.steps.to_string(), o.misses.to_string(), o.drops.to_string());
        vec![o.operator.clone(), steps, ms(o.p50_ms), ms(o.p99_ms), misses, drops]
    });
    align(&std::iter::once(head).chain(lines).collect::<Vec<_>>())
}

/// Line on operators of which no step ended; empty without such operators.
fn without_steps(of: &[OperatorMetrics]) -> String {
    let never: Vec<&str> = of.iter().filter(|o| o.steps == 0).map(|o| &*o.operator).collect();
    if never.is_empty() {
        return String::new();
    }
    format!("no step of {} ended: what they read did not arrive, or they took too long\n", never.join(", "))
}

/// Rows on time to collision, use of the opposite lane, and plans of the comfortable layer.
fn traffic_rows(m: &Metrics, row: &mut impl FnMut(&str, String)) {
    let traffic = &m.safety;
    if let (Some(ttc_s), Some(at_s)) = (traffic.min_ttc_s, traffic.min_ttc_at_s) {
        let to = m.actors.iter().find(|actor| Some(actor.actor) == traffic.min_ttc_actor);
        let to = to.map_or_else(String::new, |actor| format!(", with {}", actor.name));
        row("time to collision", format!("{ttc_s:.2} s at {at_s:.2} s{to}"));
    }
    if let (Some(headway_s), Some(at_s)) = (traffic.min_headway_s, traffic.min_headway_at_s) {
        row("time headway", format!("{headway_s:.2} s at {at_s:.2} s"));
    }
    if let Some(over_m) = traffic.distance_over_line_m.filter(|over_m| *over_m > 0.0) {
        let left_s = traffic.time_in_oncoming_lane_s.unwrap_or(0.0);
        row("over the line", format!("{over_m:.1} m, in the oncoming lane for {left_s:.2} s"));
    }
    let counts = &m.plans.counts;
    if m.plans.refused > 0 {
        let (refused, all) = (m.plans.refused, counts.all());
        row(
            "plans refused",
            format!("{refused} of {all}: without points, with impossible values, or out of order"),
        );
    }
    if let Some(share) = m.plans.comfortable_share.filter(|share| *share > 0.0) {
        let (made, all) = (counts.comfortable, counts.all());
        row("comfortable layer", format!("{made} of {all} plans ({:.0} %)", 100.0 * share));
    }
}

/// Row on the driving score, with the route completion and the penalty.
fn score_row(scores: &DrivingScores, row: &mut impl FnMut(&str, String)) {
    let Some(newest) = scores.leaderboard.get(Version::V2_1.name()) else { return };
    let (completion, penalty) = (newest.route_completion, newest.penalty);
    let nuplan = scores.nuplan.map_or_else(String::new, |nuplan| format!(", nuPlan {:.2}", nuplan.score));
    let score = format!("{:.1} (completion {completion:.1} %, penalty {penalty:.2})", scores.driving_score);
    row("driving score", format!("Leaderboard 2.1 {score}{nuplan}"));
}

/// Rows on the safety gate.
fn gate_rows(gate: &GateMetrics, row: &mut impl FnMut(&str, String)) {
    let GateMetrics { manual_s, driving_s, stopping_s, holding_s, limited_s, refused, .. } = gate;
    let mut modes = format!("driving {driving_s:.2} s, limited for {limited_s:.2} s of it");
    for (mode, seconds) in [("manual", manual_s), ("stopping", stopping_s), ("holding", holding_s)] {
        if *seconds > 0.0 {
            modes += &format!(", {mode} {seconds:.2} s");
        }
    }
    row("gate", modes);
    for stop in &gate.stops {
        row("gate stops", format!("at {:.2} s: {}", stop.at_s, stop.cause.words()));
    }
    if refused.total() > 0 {
        let Refusals { not_finite, out_of_order, stale, ahead } = refused;
        row(
            "gate refused",
            format!("{not_finite} not finite, {out_of_order} out of order, {stale} too old, {ahead} ahead"),
        );
    }
}

/// Punctuality of the timers of a run, if known.
fn timers(report: &RunReport) -> Vec<Timer> {
    let of = report.operators.iter();
    of.filter_map(|o| Some(Timer { operator: o.name.clone(), ticks: o.ticks? })).collect()
}
