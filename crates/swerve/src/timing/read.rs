//! Timing files: text to a checked [`Pipeline`].

use core::ops::Range;

use swerve_core::Span;
use swerve_flow::{Anchor, Full, Policy, Reaction, RuntimeModel};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::pipeline::{BlackBox, BoxDeadline, Pipeline, Resource, Timer};
use super::problem::{Problem, alternatives, nearest};

/// The longest time that a file may name: ten years.
const MS_MAX: f64 = 10.0 * 366.0 * 86_400_000.0;
/// The largest number of places, waiting frames or slots.
const COUNT_MAX: i64 = 1_000_000;

/// More ticks than this would not end in a sensible time.
const TICKS_MAX: i64 = 10_000_000;

const ROOT_KEYS: [&str; 3] = ["span_ms", "operator", "resource"];
const OPERATOR_KEYS: [&str; 10] =
    ["name", "every_ms", "phase_ms", "at", "latest", "feedback", "runtime", "policy", "deadline", "uses"];
const RUNTIME_KEYS: [&str; 5] = ["zero", "fixed_ms", "cycle_ms", "normal_ms", "percentiles_ms"];
const DEADLINE_KEYS: [&str; 3] = ["ms", "anchor", "reaction"];
const ANCHORS: [(&str, Anchor); 3] =
    [("arrival", Anchor::Arrival), ("stamp", Anchor::Stamp), ("start", Anchor::Start)];
const REACTIONS: [(&str, Reaction); 2] = [("skip", Reaction::Skip), ("reuse_last", Reaction::ReuseLast)];
const POLICIES: &str = "\"skip_to_latest\", \"queue(n)\", \"queue(n, drop_newest)\", \"queue(n, fail)\", \
                        \"pipelined(n)\" or \"pipelined(n, overtaking)\"";

type Read<T> = Result<T, Problem>;
type Value<'t> = Spanned<DeValue<'t>>;

/// The pipeline that `text` describes, or everything that is wrong with it: at most one problem for each operator
/// and resource, then those between operators.
pub(crate) fn pipeline(text: &str) -> Result<Pipeline, Vec<Problem>> {
    let root = DeTable::parse(text).map_err(|error| {
        let at = error.span().unwrap_or(0..0);
        vec![Problem { at, key: String::new(), message: error.message().trim().replace('\n', ", ") }]
    })?;
    let root = Table { at: root.span(), owner: String::new(), table: root.get_ref() };
    let mut problems = Vec::new();
    let mut keep = |problem: Problem| problems.push(problem);

    root.only(&ROOT_KEYS).unwrap_or_else(&mut keep);
    let span = root.required("span_ms", "a time in ms").and_then(|v| root.above_zero("span_ms", v));
    let span = span.map_err(&mut keep).unwrap_or(Span::ZERO);
    let resources = resources(&root, &mut keep);
    let tables = root.tables("operator").map_err(&mut keep).unwrap_or_default();
    let named: Vec<Option<String>> =
        tables.iter().map(|table| name_of(table).map_err(&mut keep).ok()).collect();
    repeated_names(&tables, &named, &mut keep);
    let names = Names { operators: &named, resources: &resources, span };
    let read: Vec<Option<BlackBox>> =
        tables.iter().map(|table| operator(table, &names).map_err(&mut keep).ok()).collect();
    let operators: Vec<BlackBox> = read.into_iter().flatten().collect();
    if operators.len() == tables.len() {
        cycle(&tables, &operators).unwrap_or_else(&mut keep);
    }
    if problems.is_empty() { Ok(Pipeline { span, operators, resources }) } else { Err(problems) }
}

/// A table of the file with the place and the words to report a problem in it.
struct Table<'t> {
    at: Range<usize>,
    owner: String,
    table: &'t DeTable<'t>,
}

impl<'t> Table<'t> {
    fn get(&self, key: &str) -> Option<&'t Value<'t>> {
        self.table.iter().find(|(name, _)| name.get_ref() == key).map(|(_, value)| value)
    }

    fn problem(&self, at: Range<usize>, key: &str, message: impl Into<String>) -> Problem {
        let dot = if self.owner.is_empty() || key.is_empty() { "" } else { "." };
        Problem { at, key: format!("{}{dot}{key}", self.owner), message: message.into() }
    }

    /// What `value` is, against what `key` has to be.
    fn wrong(&self, key: &str, value: &Value<'_>, expected: &str) -> Problem {
        self.problem(value.span(), key, format!("found {}, expected {expected}", shown(value.get_ref())))
    }

    fn only(&self, keys: &[&str]) -> Read<()> {
        let unknown = self
            .table
            .iter()
            .filter(|(name, _)| !keys.contains(&name.get_ref().as_ref()))
            .min_by_key(|(name, _)| name.span().start);
        let Some((name, _)) = unknown else { return Ok(()) };
        let message =
            format!("unknown key, expected {}{}", alternatives(keys), nearest(name.get_ref(), keys));
        Err(self.problem(name.span(), name.get_ref(), message))
    }

    fn required(&self, key: &str, expected: &str) -> Read<&'t Value<'t>> {
        self.get(key)
            .ok_or_else(|| self.problem(self.at.clone(), key, format!("missing, expected {expected}")))
    }

    fn table(&self, key: &str, value: &'t Value<'t>, expected: &str) -> Read<Self> {
        let table = value.get_ref().as_table().ok_or_else(|| self.wrong(key, value, expected))?;
        let dot = if self.owner.is_empty() { "" } else { "." };
        Ok(Self { at: value.span(), owner: format!("{}{dot}{key}", self.owner), table })
    }

    /// The tables of `[[key]]`, at least one.
    fn tables(&self, key: &str) -> Read<Vec<Self>> {
        let expected = format!("at least one [[{key}]]");
        let value = self.required(key, &expected)?;
        let list = value.get_ref().as_array().filter(|list| !list.is_empty());
        let list = list.ok_or_else(|| self.wrong(key, value, &expected))?;
        let entry = |(i, value): (usize, &'t Value<'t>)| {
            let mut table = self.table(key, value, &format!("a table [[{key}]]"))?;
            let name = table.get("name").and_then(|name| name.get_ref().as_str());
            table.owner = name.map_or_else(|| format!("{key} {}", i + 1), |name| format!("{key} \"{name}\""));
            Ok(table)
        };
        list.iter().enumerate().map(entry).collect()
    }

    fn text(&self, key: &str, value: &'t Value<'t>, expected: &str) -> Read<&'t str> {
        value.get_ref().as_str().ok_or_else(|| self.wrong(key, value, expected))
    }

    fn list(&self, key: &str, value: &'t Value<'t>, expected: &str) -> Read<&'t [Value<'t>]> {
        match value.get_ref() {
            DeValue::Array(list) => Ok(list),
            _ => Err(self.wrong(key, value, expected)),
        }
    }

    /// A time in ms that is not below zero.
    fn time(&self, key: &str, value: &Value<'_>) -> Read<Span> {
        let ms = number(value.get_ref()).filter(|ms| (0.0..=MS_MAX).contains(ms));
        let expected = format!("a time in ms, from 0 to {MS_MAX}");
        ms.map(|ms| Span::from_ns((ms * 1e6).round() as i64)).ok_or_else(|| self.wrong(key, value, &expected))
    }

    fn above_zero(&self, key: &str, value: &Value<'_>) -> Read<Span> {
        let expected = format!("a time in ms, above 0 (at least a nanosecond) and at most {MS_MAX}");
        let time = self.time(key, value).ok().filter(|span| *span > Span::ZERO);
        time.ok_or_else(|| self.wrong(key, value, &expected))
    }

    /// The value behind one of a few names.
    fn named<T: Copy>(&self, key: &str, values: &[(&str, T)]) -> Read<Option<T>> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let names: Vec<&str> = values.iter().map(|(name, _)| *name).collect();
        let expected = alternatives(&names);
        let text = self.text(key, value, &expected)?;
        let known = values.iter().find(|(name, _)| *name == text);
        known.map(|(_, value)| Some(*value)).ok_or_else(|| {
            let message = format!("found \"{text}\", expected {expected}{}", nearest(text, &names));
            self.problem(value.span(), key, message)
        })
    }
}

/// How a message shows a value.
fn shown(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("\"{text}\""),
        DeValue::Integer(number) => number.to_string(),
        DeValue::Float(number) => number.to_string(),
        DeValue::Boolean(truth) => truth.to_string(),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(list) if list.is_empty() => "an empty list".to_owned(),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(number) => {
            i64::from_str_radix(number.as_str(), number.radix()).ok().map(|n| n as f64)
        }
        DeValue::Float(number) => number.as_str().parse().ok(),
        _ => None,
    }
}

fn count(value: &DeValue<'_>) -> Option<usize> {
    let DeValue::Integer(number) = value else { return None };
    let n = i64::from_str_radix(number.as_str(), number.radix()).ok()?;
    (1..=COUNT_MAX).contains(&n).then_some(n as usize)
}

/// What an operator may refer to.
struct Names<'a> {
    operators: &'a [Option<String>],
    resources: &'a [Resource],
    /// Of the run, for what happens too often in it.
    span: Span,
}

fn resources(root: &Table<'_>, keep: &mut impl FnMut(Problem)) -> Vec<Resource> {
    let Some(value) = root.get("resource") else { return Vec::new() };
    let expected = "tables such as [resource.gpu0]";
    let table = match root.table("resource", value, expected) {
        Ok(table) => table,
        Err(problem) => {
            keep(problem);
            return Vec::new();
        }
    };
    let mut entries: Vec<_> = table.table.iter().collect();
    entries.sort_by_key(|(name, _)| name.span().start);
    let mut read = |name: &str, value| {
        let slots = table.table(name, value, expected).and_then(|resource| {
            resource.only(&["slots"])?;
            let slots = resource.required("slots", "how many steps it takes at a time")?;
            let expected = format!("a whole number from 1 to {COUNT_MAX}");
            count(slots.get_ref()).ok_or_else(|| resource.wrong("slots", slots, &expected))
        });
        // A resource with a problem keeps its name, so that its users have none.
        Resource { name: name.to_owned(), slots: slots.map_err(&mut *keep).unwrap_or(1) }
    };
    entries.into_iter().map(|(name, value)| read(name.get_ref(), value)).collect()
}

fn name_of(table: &Table<'_>) -> Read<String> {
    let expected = "a name that is not empty";
    let value = table.required("name", expected)?;
    let name = table.text("name", value, expected)?;
    if name.trim().is_empty() || name.chars().any(char::is_control) {
        return Err(table.wrong("name", value, expected));
    }
    Ok(name.to_owned())
}

fn repeated_names(tables: &[Table<'_>], named: &[Option<String>], keep: &mut impl FnMut(Problem)) {
    for (i, table) in tables.iter().enumerate() {
        if named[i].is_some() && named[..i].contains(&named[i]) {
            let at = table.get("name").map_or(table.at.clone(), Spanned::span);
            keep(table.problem(
                at,
                "name",
                "another operator has this name already; expected a name of its own",
            ));
        }
    }
}

fn operator(table: &Table<'_>, names: &Names<'_>) -> Read<BlackBox> {
    table.only(&OPERATOR_KEYS)?;
    let name = name_of(table).unwrap_or_default();
    let mut seen = Vec::new();
    let timer = timer(table, names.span)?;
    let at = inputs(table, "at", names, &mut seen)?;
    let latest = inputs(table, "latest", names, &mut seen)?;
    let feedback = inputs(table, "feedback", names, &mut seen)?;
    if timer.is_none() && at.is_empty() {
        let expected = "nothing makes it fire: expected \"every_ms\", or \"at\" with at least one operator";
        return Err(table.problem(table.at.clone(), "", expected));
    }
    Ok(BlackBox {
        name,
        timer,
        at,
        latest,
        feedback,
        runtime: runtime(table)?,
        policy: policy(table)?,
        deadline: deadline(table)?,
        uses: uses(table, names)?,
    })
}

fn timer(table: &Table<'_>, span: Span) -> Read<Option<Timer>> {
    let phase = table.get("phase_ms").map(|value| (value, table.time("phase_ms", value)));
    match (table.get("every_ms"), phase) {
        (Some(every), phase) => {
            let period = table.above_zero("every_ms", every)?;
            let ticks = span.ns() / period.ns();
            if ticks > TICKS_MAX {
                let message =
                    format!("ticks {ticks} times within span_ms, expected at most {TICKS_MAX} times");
                return Err(table.problem(every.span(), "every_ms", message));
            }
            Ok(Some(Timer { period, phase: phase.map_or(Ok(Span::ZERO), |(_, phase)| phase)? }))
        }
        (None, Some((value, _))) => Err(table.problem(
            value.span(),
            "phase_ms",
            "a phase without a timer; expected \"every_ms\" beside it",
        )),
        (None, None) => Ok(None),
    }
}

fn inputs(table: &Table<'_>, key: &str, names: &Names<'_>, seen: &mut Vec<usize>) -> Read<Vec<usize>> {
    let Some(value) = table.get(key) else { return Ok(Vec::new()) };
    let expected = "a list of operator names";
    let mut read = Vec::new();
    for entry in table.list(key, value, expected)? {
        let name = table.text(key, entry, expected)?;
        let Some(i) = names.operators.iter().position(|n| n.as_deref() == Some(name)) else {
            let known: Vec<&String> = names.operators.iter().flatten().collect();
            let message = format!(
                "unknown operator \"{name}\", expected {}{}",
                alternatives(&known),
                nearest(name, &known)
            );
            return Err(table.problem(entry.span(), key, message));
        };
        if seen.contains(&i) {
            let message = format!("\"{name}\" is an input already; expected each input once per operator");
            return Err(table.problem(entry.span(), key, message));
        }
        seen.push(i);
        read.push(i);
    }
    Ok(read)
}

fn runtime(table: &Table<'_>) -> Read<RuntimeModel> {
    let expected = "a run time such as { fixed_ms = 5 }";
    let value = table.required("runtime", expected)?;
    let model = table.table("runtime", value, expected)?;
    model.only(&RUNTIME_KEYS)?;
    let mut entries = model.table.iter();
    let (Some((key, value)), None) = (entries.next(), entries.next()) else {
        return Err(table.problem(
            value.span(),
            "runtime",
            format!(
                "found {} keys, expected exactly one of {}",
                model.table.len(),
                alternatives(&RUNTIME_KEYS)
            ),
        ));
    };
    let key = key.get_ref().as_ref();
    let list = |expected: &str| -> Read<&[Value<'_>]> {
        let list = model.list(key, value, expected)?;
        if list.is_empty() { Err(model.wrong(key, value, expected)) } else { Ok(list) }
    };
    match key {
        "zero" if value.get_ref().as_bool() == Some(true) => Ok(RuntimeModel::Zero),
        "zero" => Err(model.wrong(key, value, "true")),
        "fixed_ms" => Ok(RuntimeModel::Fixed(model.time(key, value)?)),
        "cycle_ms" => {
            let list = list("a list of times in ms above 0")?;
            Ok(RuntimeModel::Cycle(list.iter().map(|v| model.above_zero(key, v)).collect::<Read<_>>()?))
        }
        "normal_ms" => {
            let expected = "mean and standard deviation in ms, as in [80, 10]";
            let [mean, deviation] = list(expected)? else { return Err(model.wrong(key, value, expected)) };
            Ok(RuntimeModel::Normal { mean: model.time(key, mean)?, deviation: model.time(key, deviation)? })
        }
        _ => percentiles(&model, key, value, list),
    }
}

fn percentiles<'t>(
    model: &Table<'t>,
    key: &str,
    value: &'t Value<'t>,
    list: impl Fn(&str) -> Read<&'t [Value<'t>]>,
) -> Read<RuntimeModel> {
    let expected = "pairs of a percentile and a time in ms, both increasing, as in [[50, 70], [99, 120]]";
    let mut points: Vec<(f64, Span)> = Vec::new();
    for pair in list(expected)? {
        let DeValue::Array(entries) = pair.get_ref() else { return Err(model.wrong(key, pair, expected)) };
        let [percent, time] = &entries[..] else { return Err(model.wrong(key, pair, expected)) };
        let in_range = number(percent.get_ref()).filter(|p| (0.0..=100.0).contains(p));
        let p = in_range.ok_or_else(|| model.wrong(key, percent, "a percentile from 0 to 100"))?;
        let point = (p, model.time(key, time)?);
        if points.last().is_some_and(|last| point.0 <= last.0 || point.1 < last.1) {
            return Err(model.problem(
                pair.span(),
                key,
                format!("not above the entry before; expected {expected}"),
            ));
        }
        points.push(point);
    }
    if points.is_empty() {
        return Err(model.wrong(key, value, expected));
    }
    Ok(RuntimeModel::Percentiles(points))
}

fn policy(table: &Table<'_>) -> Read<Policy> {
    let Some(value) = table.get("policy") else { return Ok(Policy::SkipToLatest) };
    let text = table.text("policy", value, POLICIES)?;
    parse_policy(text)
        .ok_or_else(|| table.wrong("policy", value, &format!("{POLICIES}, n from 1 to {COUNT_MAX}")))
}

fn parse_policy(text: &str) -> Option<Policy> {
    if text == "skip_to_latest" {
        return Some(Policy::SkipToLatest);
    }
    let (kind, arguments) = text.strip_suffix(')')?.split_once('(')?;
    let mut arguments = arguments.split(',').map(str::trim);
    let n: i64 = arguments.next()?.parse().ok()?;
    let n = (1..=COUNT_MAX).contains(&n).then_some(n as usize)?;
    let option = arguments.next();
    if arguments.next().is_some() {
        return None;
    }
    match (kind, option) {
        ("queue", None | Some("drop_oldest")) => Some(Policy::Queue { capacity: n, full: Full::DropOldest }),
        ("queue", Some("drop_newest")) => Some(Policy::Queue { capacity: n, full: Full::DropNewest }),
        ("queue", Some("fail")) => Some(Policy::Queue { capacity: n, full: Full::Fail }),
        ("pipelined", None) => Some(Policy::Pipelined { places: n, overtaking: false }),
        ("pipelined", Some("overtaking")) => Some(Policy::Pipelined { places: n, overtaking: true }),
        _ => None,
    }
}

fn deadline(table: &Table<'_>) -> Read<Option<BoxDeadline>> {
    let Some(value) = table.get("deadline") else { return Ok(None) };
    let deadline = table.table("deadline", value, "a table such as { ms = 100 }")?;
    deadline.only(&DEADLINE_KEYS)?;
    let length = deadline.required("ms", "a time in ms above 0")?;
    Ok(Some(BoxDeadline {
        length: deadline.above_zero("ms", length)?,
        anchor: deadline.named("anchor", &ANCHORS)?.unwrap_or_default(),
        reaction: deadline.named("reaction", &REACTIONS)?.unwrap_or_default(),
    }))
}

fn uses(table: &Table<'_>, names: &Names<'_>) -> Read<Option<usize>> {
    let Some(value) = table.get("uses") else { return Ok(None) };
    let name = table.text("uses", value, "the name of a resource")?;
    let known: Vec<&str> = names.resources.iter().map(|r| r.name.as_str()).collect();
    let unknown = || {
        let message =
            format!("unknown resource \"{name}\", expected a [resource.{name}]{}", nearest(name, &known));
        table.problem(value.span(), "uses", message)
    };
    known.iter().position(|n| *n == name).map(Some).ok_or_else(unknown)
}

/// Refuses inputs that wait for each other (a cycle of `at` and `latest`).
fn cycle(tables: &[Table<'_>], operators: &[BlackBox]) -> Read<()> {
    let mut ranked = vec![false; operators.len()];
    let ready =
        |i: usize, ranked: &[bool]| operators[i].at.iter().chain(&operators[i].latest).all(|&j| ranked[j]);
    while let Some(i) = (0..operators.len()).find(|&i| !ranked[i] && ready(i, &ranked)) {
        ranked[i] = true;
    }
    let Some(first) = ranked.iter().position(|done| !done) else { return Ok(()) };
    // Every unranked operator waits for an unranked one: following them has to come back to a visited one.
    let mut path = vec![first];
    let start = loop {
        let last = &operators[path[path.len() - 1]];
        let next = last.at.iter().chain(&last.latest).copied().find(|&j| !ranked[j]);
        let next = next.expect("an operator that all inputs are ranked of has a rank");
        if let Some(start) = path.iter().position(|&j| j == next) {
            break start;
        }
        path.push(next);
    };
    let names: Vec<&str> = path[start..].iter().rev().map(|&i| operators[i].name.as_str()).collect();
    let message = format!(
        "a cycle without feedback: {} -> {}; expected \"feedback\" instead of \"at\" or \"latest\" somewhere in it",
        names.join(" -> "),
        names[0]
    );
    let back = path.get(start + 1).unwrap_or(&path[start]);
    let (at, key) = named_input(&tables[path[start]], &operators[*back].name);
    Err(tables[path[start]].problem(at, key, message))
}

/// Where `table` names `input` among the inputs that it waits for.
fn named_input(table: &Table<'_>, input: &str) -> (Range<usize>, &'static str) {
    let lists =
        ["at", "latest"].into_iter().filter_map(|key| Some((key, table.get(key)?.get_ref().as_array()?)));
    let mut entries = lists.flat_map(|(key, list)| list.iter().map(move |entry| (key, entry)));
    let found = entries.find(|(_, entry)| entry.get_ref().as_str() == Some(input));
    found.map_or((table.at.clone(), ""), |(key, entry)| (entry.span(), key))
}
