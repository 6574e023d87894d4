//! Counterfactual plans without an actor.

use swerve_core::Time;
use swerve_drive::process::Processes;
use swerve_drive::record_run_times;
use swerve_flow::{Event, Observer, PlaybackPayload, PlaybackRecord, RunOptions, StopHandle, run_virtual};
use swerve_log::{Log, Record};
use swerve_msg::{ActorId, Plan, PredictionList};
use swerve_stack::config::clock::Clock;
use swerve_stack::pipeline::Pipeline;
use swerve_stack::{Role, Setup};

use super::timeline::Timeline;

/// Difference in position or speed beyond which a plan counts as changed, metres and m/s.
pub(super) const OTHER: f64 = 0.1;

/// A log whose planner plans again.
pub(super) struct Without<'a> {
    pub(super) log: &'a Log,
    pub(super) setup: &'a Setup,
    /// Stream of predictions that the planner reads.
    pub(super) stream: &'a str,
    /// Tracks removed from the predictions.
    pub(super) ids: &'a [ActorId],
    /// Stamp before which there are none of these tracks.
    pub(super) from: Time,
}

/// Compares plans with the logged ones until one differs.
struct Compared<'a> {
    log: Vec<(Time, &'a swerve_log::PublicationRecord)>,
    planner: &'a str,
    from: Time,
    stop: StopHandle,
    first: Option<Time>,
}

impl Without<'_> {
    /// Stamp of the first logged plan that differs without the actor.
    pub(super) fn first_difference(
        &self,
        mut pipeline: Pipeline,
        planner: &str,
        timeline: &Timeline<'_>,
    ) -> anyhow::Result<Option<Time>> {
        if pipeline.clock == Clock::Wall || timeline.is_measured(planner) {
            record_run_times(&mut pipeline, self.log, |operator| operator == planner);
        }
        self.play_others(&mut pipeline, timeline, |name| name == planner)?;
        let _processes = Processes::start_needed(self.setup, &mut pipeline)?;
        let plans = timeline.stream_of::<Plan>(planner).unwrap_or(planner);
        let log = self.log.publications(plans).map(|p| (p.header.stamp, p)).collect();
        let stop = pipeline.graph.stop_handle();
        let mut compared = Compared { log, planner, from: self.from, stop, first: None };
        let last = self.log.end.as_ref().map_or(pipeline.until, |end| end.at);
        let options = RunOptions::until(last).seed(self.log.start.seed).threads(1);
        run_virtual(pipeline.graph, &options, vec![&mut compared])?;
        Ok(compared.first)
    }

    /// Plays back all operators except those that run again, as far as these read their messages.
    pub(super) fn play_others(
        &self,
        pipeline: &mut Pipeline,
        timeline: &Timeline<'_>,
        runs_again: impl Fn(&str) -> bool,
    ) -> anyhow::Result<()> {
        let names: Vec<String> = pipeline.graph.describe()?.operators.into_iter().map(|o| o.name).collect();
        let again = || names.iter().filter(|name| runs_again(name));
        let read: Vec<&str> = again()
            .flat_map(|name| timeline.inputs(name))
            .filter_map(|input| input.from.as_deref())
            .collect();
        // A deadline may follow any stream of the stack.
        let follows_stack = again().any(|name| timeline.has_deadline(name));
        for name in names.iter().filter(|name| !runs_again(name)) {
            let in_stack =
                follows_stack && pipeline.assembly.node(name).is_some_and(|node| node.role == Role::Stack);
            let records =
                if in_stack || read.contains(&name.as_str()) { self.playback(name)? } else { Vec::new() };
            pipeline.graph.playback(name, records)?;
            pipeline.graph.playback_steps(name, self.log.held(name))?;
        }
        Ok(())
    }

    /// Messages published by an operator, without predictions of the tracks.
    fn playback(&self, operator: &str) -> anyhow::Result<Vec<PlaybackRecord>> {
        let mut records = self.log.playback(operator);
        let is_of = |record: &&Record| match record {
            Record::Publication(p) => p.stream.operator == operator,
            Record::Watermark(w) => w.operator == operator,
            _ => false,
        };
        for (played, logged) in records.iter_mut().zip(self.log.records.iter().filter(is_of)) {
            let Record::Publication(p) = logged else { continue };
            if p.stream.stream != self.stream || p.header.stamp < self.from {
                continue;
            }
            let mut list: PredictionList = p.decode()?;
            list.predictions.retain(|prediction| !self.ids.contains(&prediction.id));
            if let Some(message) = &mut played.message {
                message.payload = PlaybackPayload::value(list);
            }
        }
        Ok(records)
    }
}

impl Observer for Compared<'_> {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(p) = event else { return };
        let (Some(stamp), Some(payload)) = (p.stamp, p.payload) else { return };
        let Some(plan) = payload.downcast_ref::<Plan>() else { return };
        if p.operator != self.planner || stamp < self.from || self.first.is_some() {
            return;
        }
        let Ok(place) = self.log.binary_search_by_key(&stamp, |(stamp, _)| *stamp) else { return };
        let logged: Option<Plan> = self.log[place].1.decode().ok();
        if logged.is_some_and(|logged| is_other(&logged, plan)) {
            self.first = Some(stamp);
            self.stop.stop();
        }
    }
}

/// True if following one plan leads to another position or speed than following the other.
pub(super) fn is_other(a: &Plan, b: &Plan) -> bool {
    if a.status != b.status || a.points.is_empty() != b.points.is_empty() {
        return true;
    }
    let elsewhere = |from: &Plan, to: &Plan| {
        let differs = |p: &swerve_msg::PlanPoint| {
            let place = to.at(p.at).filter(|_| p.at <= to.end());
            place.is_some_and(|q| {
                p.pose.point().distance(q.pose.point()) > OTHER || (p.speed_mps - q.speed_mps).abs() > OTHER
            })
        };
        from.points.iter().any(differs)
    };
    elsewhere(a, b) || elsewhere(b, a)
}
