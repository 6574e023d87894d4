//! Assignments to single keys of a scenario: `--set actor.person.speed_mps=4`, or an axis of a study.

use swerve_text::{Document, Problem, Problems, did_you_mean, list, nearest};
use toml::{Table, Value};

use crate::{MapText, Scenario};

/// Arrays of tables with names, of which a key also sets the only nested key of its name.
const NAMED: [&str; 2] = ["actor", "slippery"];

/// A dotted key and its value.
type Set = (String, Value);

/// Splits assignments into those of the scenario and those of the configuration.
pub fn split_sets(sets: &[Set]) -> (Vec<Set>, Vec<Set>) {
    sets.iter().cloned().partition(|(key, _)| is_scenario_key(key))
}

/// Returns true if a key belongs to the scenario rather than the configuration: it is in a table that only scenarios
/// have, or is `scenario.KEY`.
pub fn is_scenario_key(key: &str) -> bool {
    matches!(
        key.split('.').next(),
        Some(
            "actor"
                | "end"
                | "expect"
                | "map"
                | "reactive"
                | "road"
                | "scenario"
                | "slippery"
                | "traffic"
                | "world"
        )
    )
}

impl Scenario {
    /// As [`parse`](Self::parse), with single keys changed.
    ///
    /// `actor.person.d_m` is a key of the actor `person`. If the actor has no such key, the only key of that name
    /// within its tables is set: `actor.person.speed_mps` sets `actor.person.motion.0.walk.speed_mps`. Patches,
    /// `slippery.NAME.KEY`, are addressed likewise. Keys of tables
    /// that also exist in configurations are prefixed with `scenario`: `scenario.ego.end_m`. Array elements are
    /// addressed by index, from 0, or by name. The text of the result is that of the scenario with the changes
    /// applied.
    ///
    /// # Errors
    /// All problems of the text; if there are none, those of the assigned keys.
    pub fn parse_with(file: &str, text: &str, sets: &[Set]) -> Result<Self, Problems> {
        Self::parse_on(file, text, None, sets)
    }

    /// As [`parse_with`](Self::parse_with), with the text of the map, if it is not in the folder of the file.
    ///
    /// # Errors
    /// As there.
    pub fn parse_on(file: &str, text: &str, map: Option<&MapText>, sets: &[Set]) -> Result<Self, Problems> {
        let document = Document::parse(file, text)?;
        let plain = crate::parse::scenario(&document, map)?;
        if sets.is_empty() {
            return Ok(plain);
        }
        let is_same = !sets.iter().any(|(key, _)| is_of_map(key));
        let map = map.or_else(|| plain.road.map_text().filter(|_| is_same));
        changed(document, map, sets)
    }

    /// As [`parse_on`](Self::parse_on) of the text of this scenario on its map, which are not checked again; `file` is the
    /// name of its file.
    ///
    /// # Errors
    /// Those of the assigned keys.
    pub fn changed(&self, file: &str, sets: &[Set]) -> Result<Self, Problems> {
        changed(Document::parse(file, &*self.text)?, self.road.map_text(), sets)
    }
}

/// True if a key may name another map.
fn is_of_map(key: &str) -> bool {
    key.strip_prefix("scenario.").unwrap_or(key).starts_with("map")
}

/// A document without problems, with single keys changed.
fn changed(document: Document, map: Option<&MapText>, sets: &[Set]) -> Result<Scenario, Problems> {
    let Document { file, mut table, .. } = document;
    let mut places = Vec::new();
    for (key, value) in sets {
        let place = put(&mut table, key, value).map_err(|message| of_set(key, message))?;
        places.push((place, key.as_str()));
    }
    let text = toml::to_string(&table).map_err(|error| of_set(&sets[0].0, error.to_string()))?;
    crate::parse::scenario(&Document::parse(&file, text)?, map).map_err(|problems| {
        let of_keys = problems.iter().map(|problem| {
            let is_of = |(place, _): &&(String, &str)| {
                problem.key.starts_with(place.as_str()) || place.starts_with(&problem.key)
            };
            let of_all = if let [(only, _)] = sets { only.as_str() } else { problem.key.as_str() };
            let key = places.iter().rev().find(is_of).map_or(of_all, |(_, key)| key);
            let near =
                problems.known_beside(&problem.key).and_then(|known| near_in_named(&table, key, known));
            let nearer = near.map(|near| format!("unknown key; did you mean `{near}`?"));
            of_set(key, nearer.unwrap_or_else(|| problem.message.clone()))
        });
        of_keys.collect::<Problems>()
    })
}

/// Nearest to an unknown key of an actor or patch: of the known keys, present or not, and all keys within it, nested ones
/// such as `speed_mps` of a motion included.
fn near_in_named<'t>(table: &'t Table, key: &str, known: &[&'t str]) -> Option<&'t str> {
    let parts: Vec<&str> = key.strip_prefix("scenario.").unwrap_or(key).split('.').collect();
    let [of, name, last] = parts[..] else { return None };
    let named = table.get(of).filter(|_| NAMED.contains(&of));
    let named = named.and_then(|all| entry(all, name).ok()?.1)?;
    let mut names = Vec::new();
    names_within(named, &mut names);
    names.retain(|name| *name != last);
    nearest(last, names.into_iter().chain(known.iter().copied()))
}

/// Collects the names of all keys within a value.
fn names_within<'t>(value: &'t Value, names: &mut Vec<&'t str>) {
    match value {
        Value::Table(table) => table.iter().for_each(|(name, inner)| {
            names.push(name);
            names_within(inner, names);
        }),
        Value::Array(entries) => entries.iter().for_each(|entry| names_within(entry, names)),
        _ => {}
    }
}

fn of_set(key: &str, message: String) -> Problem {
    Problem { file: "--set".to_owned(), line: None, key: key.to_owned(), message }
}

/// Sets a value. Returns its path in the notation of scenario problems: `actor.person.motion[0].walk.speed_mps`.
fn put(table: &mut Table, key: &str, value: &Value) -> Result<String, String> {
    let mut parts: Vec<String> = key.split('.').map(str::to_owned).collect();
    if parts[0] == "scenario" {
        parts.remove(0);
    }
    if parts.is_empty() {
        return Err("expected actor.NAME.KEY or scenario.KEY".to_owned());
    }
    if let [of] = &parts[..]
        && NAMED.contains(&of.as_str())
    {
        return Err(format!("expected {of}.NAME.KEY or scenario.KEY"));
    }
    if let [of, name, last] = &parts[..]
        && NAMED.contains(&of.as_str())
        && let Some(Value::Table(named)) = table.get(of).and_then(|all| entry(all, name).ok()?.1)
        && !named.contains_key(last)
    {
        let mut found = Vec::new();
        within(named, last, &mut Vec::new(), &mut found);
        match &found[..] {
            [] => {}
            [only] => parts.splice(2.., only.iter().cloned()).for_each(drop),
            many => {
                let many: Vec<String> =
                    many.iter().map(|path| format!("{of}.{name}.{}", path.join("."))).collect();
                let many: Vec<&str> = many.iter().map(String::as_str).collect();
                return Err(format!("occurs several times; expected one of {}", list(&many)));
            }
        }
    }
    let mut place = String::new();
    let mut at = table;
    let mut parts = parts.iter().map(String::as_str).peekable();
    while let Some(part) = parts.next() {
        place += if place.is_empty() { "" } else { "." };
        place += part;
        if parts.peek().is_none() {
            swerve_text::set(at, part, value.clone()).map_err(|(_, message)| message)?;
            break;
        }
        let mut inner = at.entry(part).or_insert_with(|| Table::new().into());
        while let Value::Array(_) = inner {
            let Some(name) = parts.next() else { break };
            let (i, named) = entry(inner, name)?;
            place += &match named.and_then(|entry| entry.get("name")?.as_str()) {
                Some(name) => format!(".{name}"),
                None => format!("[{i}]"),
            };
            let Value::Array(entries) = inner else { break };
            if parts.peek().is_none() {
                match (&mut entries[i], value) {
                    (Value::Table(old), Value::Table(new)) => {
                        for (name, value) in new {
                            swerve_text::set(old, name, value.clone()).map_err(|(_, message)| message)?;
                        }
                    }
                    (old, value) => *old = value.clone(),
                }
                return Ok(place);
            }
            inner = &mut entries[i];
        }
        at = inner.as_table_mut().ok_or_else(|| format!("`{part}` is a value, not a table"))?;
    }
    Ok(place)
}

/// The array element with this index or name.
fn entry<'a>(array: &'a Value, name: &str) -> Result<(usize, Option<&'a Value>), String> {
    let entries = array.as_array().map_or(&[][..], Vec::as_slice);
    let names: Vec<&str> =
        entries.iter().filter_map(|entry| entry.get("name").and_then(Value::as_str)).collect();
    let by_name = || entries.iter().position(|entry| entry.get("name").and_then(Value::as_str) == Some(name));
    let by_place = || name.parse().ok().filter(|i| *i < entries.len());
    match by_name().or_else(by_place) {
        Some(i) => Ok((i, entries.get(i))),
        None if names.is_empty() => {
            Err(format!("there is no entry {name}: expected 0 to {}", entries.len().max(1) - 1))
        }
        None => {
            let near = did_you_mean(name, names.iter().copied());
            Err(format!("there is no \"{name}\"{near}; expected one of {}", list(&names)))
        }
    }
}

/// Collects the paths to all keys of this name in tables within a table.
fn within(table: &Table, name: &str, path: &mut Vec<String>, found: &mut Vec<Vec<String>>) {
    for (key, value) in table {
        path.push(key.clone());
        if key == name {
            found.push(path.clone());
        }
        match value {
            Value::Table(inner) => within(inner, name, path, found),
            Value::Array(entries) => {
                for (i, entry) in entries.iter().enumerate() {
                    let Value::Table(inner) = entry else { continue };
                    path.push(i.to_string());
                    within(inner, name, path, found);
                    path.pop();
                }
            }
            _ => {}
        }
        path.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Course;

    const TEXT: &str = r#"
        name = "two"
        road = { segments = [{ length_m = 200.0 }] }
        ego = { target_speed_mps = 10.0, end_m = 100.0 }
        expect = { verdict = "avoided", min_distance_m = { min = 0.1 } }
        [[slippery]]
        name = "ice"
        friction = 0.3
        s_m = 0.0
        length_m = 15.0
        [[actor]]
        name = "person"
        kind = "pedestrian"
        s_m = 50.0
        d_m = 4.0
        size = { radius_m = 0.25, height_m = 1.8 }
        trigger = { distance = { to = "ego", within_m = 26.0 } }
        motion = [{ wait = { for_s = 1.0 } }, { walk = { speed_mps = 2.0, distance_m = 4.5, direction = "right" } }]
        [[actor]]
        name = "runner"
        kind = "pedestrian"
        s_m = 60.0
        d_m = 4.0
        size = { radius_m = 0.25, height_m = 1.8 }
        motion = [
            { walk = { speed_mps = 2.0, distance_m = 2.0, direction = "right" } },
            { walk = { speed_mps = 4.0, distance_m = 2.0, direction = "right" } },
        ]
    "#;

    fn with(set: &str) -> Result<Scenario, Problems> {
        Scenario::parse_with("two.toml", TEXT, &[swerve_text::parse_assignment(set).unwrap()])
    }

    #[test]
    fn assignment_sets_the_addressed_key() {
        let base = Scenario::parse("two.toml", TEXT).unwrap();
        type Change = fn(&mut Scenario);
        let cases: [(&str, Change); 9] = [
            ("slippery.ice.friction=0.2", |s| s.slippery[0].friction = 0.2),
            ("actor.person.d_m=5", |s| s.actors[0].d_m = 5.0),
            ("actor.person={ d_m = 5 }", |s| s.actors[0].d_m = 5.0),
            ("scenario.end={ timeout_s = 3 }", |s| s.end.timeout_s = 3.0),
            ("actor.1.d_m=5", |s| s.actors[1].d_m = 5.0),
            ("scenario.actor.person.d_m=5", |s| s.actors[0].d_m = 5.0),
            ("scenario.road.friction=0.5", |s| s.road.friction = 0.5),
            ("scenario.end.timeout_s=3", |s| s.end.timeout_s = 3.0),
            ("scenario.road.segments.0.length_m=300", |s| {
                let Course::Strip(strip) = &mut s.road.course else { return };
                strip.segments[0].length_m = 300.0;
            }),
        ];
        for (set, change) in cases {
            let mut wanted = base.clone();
            change(&mut wanted);
            let got = with(set).unwrap();
            assert_eq!(Scenario::parse("again", &got.text).unwrap(), got, "{set}: its text says the same");
            wanted.text = got.text.clone();
            assert_eq!(got, wanted, "{set}");
        }
    }

    #[test]
    fn short_key_sets_the_only_nested_key_of_that_name() {
        for (short, long) in [
            ("actor.person.speed_mps=4", "actor.person.motion.1.walk.speed_mps=4"),
            ("actor.person.within_m=9", "actor.person.trigger.distance.within_m=9"),
            ("actor.person.for_s=3", "actor.person.motion.0.wait.for_s=3"),
        ] {
            let (short, long) = (with(short).unwrap(), with(long).unwrap());
            assert_eq!(short, long);
            assert_ne!(short.actors, Scenario::parse("", TEXT).unwrap().actors);
        }
    }

    #[test]
    fn tables_that_only_scenarios_have_need_no_prefix() {
        for key in ["road.friction=0.5", "end.timeout_s=3"] {
            assert_eq!(with(key).unwrap(), with(&format!("scenario.{key}")).unwrap(), "{key}");
            assert!(is_scenario_key(key));
        }
        assert!(!is_scenario_key("ego.speed_mps"));
    }

    #[test]
    fn invalid_assignments_are_reported() {
        for (set, part) in [
            ("actor.persn.d_m=5", "--set: actor.persn.d_m: there is no \"persn\"; did you mean `person`?"),
            (
                "actor.runner.speed_mps=4",
                "expected one of \"actor.runner.motion.0.walk.speed_mps\", \"actor.ru",
            ),
            ("actor.person.speed_mps=fast", "--set: actor.person.speed_mps: expected"),
            ("actor.person.speed_mps=-1", "--set: actor.person.speed_mps: expected"),
            ("actor.person.sped=1", "--set: actor.person.sped: unknown key"),
            ("actor.person.sped_mps=3", "unknown key; did you mean `speed_mps`?"),
            ("actor.person.withn_m=3", "unknown key; did you mean `within_m`?"),
            // Absent from this actor, but a valid key of actors.
            ("actor.person.headng_rad=1", "unknown key; did you mean `heading_rad`?"),
            ("actor.person.q=1", "unknown key; expected one of \"d_m\""),
            ("actor.person=1", "--set: actor.person: expected"),
            ("actor=1", "expected actor.NAME.KEY"),
            (
                "slippery.ice.friction=9",
                "--set: slippery.ice.friction: expected a number from 0.01 to 4, found 9",
            ),
            (
                "slippery.ise.friction=1",
                "--set: slippery.ise.friction: there is no \"ise\"; did you mean `ice`?",
            ),
            ("slippery.ice.with_m=1", "--set: slippery.ice.with_m: unknown key; did you mean `width_m`?"),
            ("slippery=1", "expected slippery.NAME.KEY"),
            ("scenario.ego.end_m.x=1", "`end_m` is a value"),
            ("scenario.road.segments.7.length_m=1", "there is no entry 7: expected 0 to 0"),
        ] {
            let said = with(set).unwrap_err().to_string();
            assert!(said.contains(part), "{set}: {said}");
        }
    }
}
