//! Timing files: text to a checked [`Pipeline`].

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;
use swerve_core::Span;
use swerve_flow::{Policy, Reaction, RuntimeModel};
use swerve_stack::config::execution::{Deadline, Runtime, parse_policy, span_ms};
use swerve_text::{Document, KeyProblem, Problems, did_you_mean, number};

use super::pipeline::{BlackBox, Pipeline, Resource, Timer};

/// Maximum number of ticks of a timer; more would take too long.
const TICKS_MAX: i64 = 2_000_000;
const SLOTS_MAX: usize = 1_000_000;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    /// Duration of the run, ms.
    span_ms: f64,
    /// Operators, in the order of their ranks.
    operator: Vec<OperatorTable>,
    /// Resources that operators share, by name.
    #[serde(default)]
    resource: BTreeMap<String, ResourceTable>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct OperatorTable {
    /// Name of the operator and of its stream.
    name: String,
    /// Period of the timer that triggers the operator, ms.
    every_ms: Option<f64>,
    /// Time of the timer's first tick, ms. Default: 0.
    phase_ms: Option<f64>,
    /// Operators whose stamps trigger a step; their messages are joined by stamp.
    #[serde(default)]
    at: Vec<String>,
    /// Operators whose newest message is read.
    #[serde(default)]
    latest: Vec<String>,
    /// As `latest`, for operators that follow this one in the pipeline.
    #[serde(default)]
    feedback: Vec<String>,
    /// Run time of a step.
    runtime: Runtime,
    /// Handling of frames while the operator is busy: `skip_to_latest` (default), `queue(N)`, `pipelined(N)` and their
    /// variants.
    policy: Option<String>,
    /// Deadline for answering a stamp, and the reaction to a miss.
    deadline: Option<Deadline>,
    /// Resource that a step occupies.
    uses: Option<String>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ResourceTable {
    /// Number of steps that can use the resource at a time.
    slots: usize,
}

/// Reads the pipeline that a file describes, or returns all of its problems.
pub(crate) fn pipeline(document: &Document) -> Result<Pipeline, Problems> {
    document.to_checked(|file| checked(document, file))
}

fn checked(document: &Document, file: File) -> Result<Pipeline, Problems> {
    let mut reader = Reader { document, file: &file, problems: Problems::new() };
    let span = reader.above_zero("span_ms", file.span_ms);
    if file.operator.is_empty() {
        reader.problem("operator", "expected at least one [[operator]]");
    }
    let resources = file.resource.iter().map(|(name, table)| reader.resource(name, table)).collect();
    let operators: Vec<BlackBox> =
        file.operator.iter().enumerate().map(|(i, table)| reader.operator(i, table, span)).collect();
    if reader.problems.is_empty() {
        reader.cycle(&operators);
    }
    reader.problems.or(Pipeline { span, operators, resources })
}

/// Reads tables and collects their problems; an invalid value is replaced by a harmless one.
struct Reader<'a> {
    document: &'a Document,
    file: &'a File,
    problems: Problems,
}

impl Reader<'_> {
    fn problem(&mut self, key: &str, message: impl Into<String>) {
        self.problems.push(self.document.problem(key, message));
    }

    fn keep<T>(&mut self, key: &str, read: Result<T, String>) -> Option<T> {
        read.map_err(|message| self.problem(key, message)).ok()
    }

    fn above_zero(&mut self, key: &str, ms: f64) -> Span {
        let span = self.keep(key, span_ms(ms));
        if span == Some(Span::ZERO) {
            let message =
                format!("expected milliseconds above zero, at least a nanosecond, found {}", number(ms));
            self.problem(key, message);
        }
        span.unwrap_or(Span::ZERO)
    }

    fn resource(&mut self, name: &str, table: &ResourceTable) -> Resource {
        if !(1..=SLOTS_MAX).contains(&table.slots) {
            let message = format!("expected a whole number from 1 to {SLOTS_MAX}, found {}", table.slots);
            self.problem(&format!("resource.{name}.slots"), message);
        }
        Resource { name: name.to_owned(), slots: table.slots }
    }

    fn operator(&mut self, index: usize, table: &OperatorTable, span: Span) -> BlackBox {
        let key = |name: &str| format!("operator[{index}].{name}");
        self.name(index, &table.name);
        if table.every_ms.is_none() && table.at.is_empty() {
            let message = format!(
                "nothing makes \"{}\" fire: expected `every_ms`, or `at` with an operator",
                table.name
            );
            self.problem(&format!("operator[{index}]"), message);
        }
        let mut seen = Vec::new();
        let mut inputs = |reader: &mut Self, name, list| reader.inputs(&key(name), list, &mut seen);
        let at = inputs(self, "at", &table.at);
        let latest = inputs(self, "latest", &table.latest);
        let feedback = inputs(self, "feedback", &table.feedback);
        let policy = table.policy.as_deref().map_or(Ok(Policy::SkipToLatest), parse_policy);
        let deadline = table.deadline.map(|deadline| match deadline.reaction {
            Reaction::OnDeadline => {
                Err("a black box has no handler: expected reaction skip or reuse_last".to_owned())
            }
            Reaction::Skip | Reaction::ReuseLast => deadline.deadline(),
        });
        BlackBox {
            name: table.name.clone(),
            timer: self.timer(index, table, span),
            at,
            latest,
            feedback,
            runtime: runtime(&table.runtime).unwrap_or_else(|(inner, message)| {
                let dot = if inner.is_empty() { "" } else { "." };
                self.problem(&format!("{}{dot}{inner}", key("runtime")), message);
                RuntimeModel::default()
            }),
            policy: self.keep(&key("policy"), policy).unwrap_or_default(),
            deadline: deadline.and_then(|deadline| self.keep(&key("deadline"), deadline)),
            uses: table.uses.as_deref().and_then(|name| self.uses(&key("uses"), name)),
        }
    }

    fn name(&mut self, index: usize, name: &str) {
        let key = format!("operator[{index}].name");
        if name.trim().is_empty() || name.chars().any(char::is_control) {
            self.problem(&key, format!("expected a name to be read, found {name:?}"));
        }
        if self.file.operator[..index].iter().any(|other| other.name == name) {
            self.problem(&key, format!("another operator is called \"{name}\": expected a unique name"));
        }
    }

    fn timer(&mut self, index: usize, table: &OperatorTable, span: Span) -> Option<Timer> {
        let key = |name: &str| format!("operator[{index}].{name}");
        let Some(every_ms) = table.every_ms else {
            if table.phase_ms.is_some() {
                self.problem(&key("phase_ms"), "a phase without a timer: expected `every_ms` beside it");
            }
            return None;
        };
        let period = self.above_zero(&key("every_ms"), every_ms);
        let ticks = span.ns().checked_div(period.ns()).unwrap_or(0);
        if ticks > TICKS_MAX {
            let message = format!("ticks {ticks} times within `span_ms`, expected at most {TICKS_MAX} times");
            self.problem(&key("every_ms"), message);
        }
        let phase = self.keep(&key("phase_ms"), span_ms(table.phase_ms.unwrap_or(0.0)));
        Some(Timer { period, phase: phase.unwrap_or(Span::ZERO) })
    }

    /// Indices of the operators in one list of inputs. An operator is an input only once, whatever the list.
    fn inputs(&mut self, key: &str, names: &[String], seen: &mut Vec<usize>) -> Vec<usize> {
        let operators = &self.file.operator;
        let mut read = Vec::new();
        for (i, name) in names.iter().enumerate() {
            let key = format!("{key}[{i}]");
            match operators.iter().position(|operator| operator.name == *name) {
                None => {
                    let known = operators.iter().map(|operator| operator.name.as_str());
                    self.problem(&key, unknown("operator", name, known));
                }
                Some(input) if seen.contains(&input) => {
                    self.problem(&key, format!("\"{name}\" is an input already: expected each input once"));
                }
                Some(input) => {
                    seen.push(input);
                    read.push(input);
                }
            }
        }
        read
    }

    fn uses(&mut self, key: &str, name: &str) -> Option<usize> {
        let names = self.file.resource.keys().map(String::as_str);
        let index = names.clone().position(|known| known == name);
        if index.is_none() {
            self.problem(key, unknown("resource", name, names));
        }
        index
    }

    /// Refuses operators that wait for each other (a cycle of `at` and `latest`).
    fn cycle(&mut self, operators: &[BlackBox]) {
        let waits_for = |i: usize| operators[i].at.iter().chain(&operators[i].latest).copied();
        let mut ranked = vec![false; operators.len()];
        while let Some(i) = (0..ranked.len()).find(|&i| !ranked[i] && waits_for(i).all(|input| ranked[input]))
        {
            ranked[i] = true;
        }
        // Every operator without a rank waits for another one: following them leads back to a visited one.
        let Some(first) = ranked.iter().position(|done| !done) else { return };
        let mut path = vec![first];
        let start = loop {
            let last = path[path.len() - 1];
            let next =
                waits_for(last).find(|&input| !ranked[input]).expect("with all inputs ranked it has a rank");
            if let Some(start) = path.iter().position(|&visited| visited == next) {
                break start;
            }
            path.push(next);
        };
        let reader = path[start];
        let input = *path.get(start + 1).unwrap_or(&reader);
        let names: Vec<&str> = path[start..].iter().rev().map(|&i| operators[i].name.as_str()).collect();
        let message = format!(
            "a cycle without feedback: {} -> {}; expected `feedback` instead of `at` or `latest` somewhere in it",
            names.join(" -> "),
            names[0]
        );
        let at = operators[reader].at.iter().position(|&i| i == input).map(|i| format!("at[{i}]"));
        let latest =
            || operators[reader].latest.iter().position(|&i| i == input).map(|i| format!("latest[{i}]"));
        let list = at.or_else(latest).expect("the reader waits for this input");
        self.problem(&format!("operator[{reader}].{list}"), message);
    }
}

/// Reads a run time model; an error has the invalid key and the message.
fn runtime(table: &Runtime) -> Result<RuntimeModel, KeyProblem> {
    if table.work.is_some() || table.measured.is_some() {
        let message = "a black box does no work to be counted or measured: expected one of zero, fixed_ms, cycle_ms, \
                       normal_ms, log_normal_ms, percentiles_ms";
        return Err((String::new(), message.to_owned()));
    }
    table.model_by_key()
}

fn unknown<'a>(what: &str, name: &str, known: impl Iterator<Item = &'a str> + Clone) -> String {
    let listed: Vec<String> = known.clone().map(|name| format!("\"{name}\"")).collect();
    let listed = if listed.is_empty() { "none: there is none".to_owned() } else { listed.join(", ") };
    let hint = did_you_mean(name, known);
    format!("unknown {what} \"{name}\", expected one of {listed}{hint}")
}
