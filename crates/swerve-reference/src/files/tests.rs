//! All shipped files, and wrong ones, checked against the schemas.

use serde_json::{Map, Value, json};
use swerve_drive::shipped::Kind;
use swerve_scenario::Scenario;
use swerve_stack::Setup;

use super::*;

/// Validates a value with the keywords of JSON Schema that these schemas use; any other keyword fails the test.
fn problems(root: &Value, schema: &Value, value: &Value, at: &str, found: &mut Vec<String>) {
    let Value::Object(keywords) = schema else {
        if schema == &json!(false) {
            found.push(format!("{at}: nothing may be here"));
        }
        return;
    };
    let none = Map::new();
    let properties = keywords.get("properties").and_then(Value::as_object).unwrap_or(&none);
    let number = value.as_f64();
    let is_valid = |schema: &Value| {
        let mut found = Vec::new();
        problems(root, schema, value, at, &mut found);
        found.is_empty()
    };
    for (keyword, told) in keywords {
        let bound = |holds: fn(f64, f64) -> bool| number.is_none_or(|x| holds(x, told.as_f64().unwrap()));
        let sized = |holds: fn(u64, u64) -> bool| {
            size(value).is_none_or(|size| holds(size as u64, told.as_u64().unwrap()))
        };
        let sound = match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" | "default" | "format" | "examples" | "pattern" => {
                true
            }
            "properties" => {
                for (name, schema) in properties {
                    if let Some(value) = value.get(name) {
                        problems(root, schema, value, &format!("{at}.{name}"), found);
                    }
                }
                true
            }
            "additionalProperties" => {
                for (name, value) in value.as_object().unwrap_or(&none) {
                    if !properties.contains_key(name) {
                        problems(root, told, value, &format!("{at}.{name}"), found);
                    }
                }
                true
            }
            "items" => {
                for (k, item) in value.as_array().into_iter().flatten().enumerate() {
                    problems(root, told, item, &format!("{at}[{k}]"), found);
                }
                true
            }
            "$ref" => {
                let pointer = told.as_str().unwrap().strip_prefix('#').unwrap();
                problems(root, root.pointer(pointer).unwrap(), value, at, found);
                true
            }
            "allOf" => {
                told.as_array().unwrap().iter().for_each(|one| problems(root, one, value, at, found));
                true
            }
            "anyOf" => told.as_array().unwrap().iter().any(is_valid),
            "oneOf" => told.as_array().unwrap().iter().filter(|one| is_valid(one)).count() == 1,
            "type" => match told {
                Value::Array(all) => all.iter().any(|kind| is_of(kind, value)),
                kind => is_of(kind, value),
            },
            "enum" => told.as_array().unwrap().contains(value),
            "const" => told == value,
            "required" => has_all(value, told),
            "dependentRequired" => {
                let needed = told.as_object().unwrap().iter();
                needed.filter(|(name, _)| value.get(name).is_some()).all(|(_, needed)| has_all(value, needed))
            }
            "minimum" => bound(|x, bound| x >= bound),
            "maximum" => bound(|x, bound| x <= bound),
            "exclusiveMinimum" => bound(|x, bound| x > bound),
            "exclusiveMaximum" => bound(|x, bound| x < bound),
            "minItems" | "minProperties" | "minLength" => sized(|size, least| size >= least),
            "maxItems" | "maxProperties" => sized(|size, most| size <= most),
            other => panic!("{at}: the test does not know the keyword {other}"),
        };
        if !sound {
            found.push(format!("{at}: {keyword} {told}, found {value}"));
        }
    }
}

fn size(value: &Value) -> Option<usize> {
    match value {
        Value::Array(items) => Some(items.len()),
        Value::Object(table) => Some(table.len()),
        Value::String(text) => Some(text.len()),
        _ => None,
    }
}

fn has_all(value: &Value, names: &Value) -> bool {
    let has = |name: &Value| value.get(name.as_str().unwrap()).is_some();
    !value.is_object() || names.as_array().unwrap().iter().all(has)
}

fn is_of(kind: &Value, value: &Value) -> bool {
    match kind.as_str().unwrap() {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.as_f64().is_some_and(|x| x.fract() == 0.0),
        other => panic!("kind {other}"),
    }
}

fn wrong(kind: FileKind, text: &str) -> Vec<String> {
    let value = serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap();
    let schema = kind.schema(&Registry::standard()).to_value();
    let mut found = Vec::new();
    problems(&schema, &schema, &value, "", &mut found);
    found
}

#[test]
fn every_shipped_file_matches_its_schema() {
    let mut counts = [0; 5];
    for (k, (of, kind)) in [
        (Kind::Scenario, FileKind::Scenario),
        (Kind::Study, FileKind::Study),
        (Kind::Timing, FileKind::Timing),
        (Kind::Config, FileKind::Config),
        (Kind::Live, FileKind::Config),
    ]
    .into_iter()
    .enumerate()
    {
        for (name, file) in of.all() {
            counts[k] += 1;
            assert_eq!(wrong(kind, file.text), Vec::<String>::new(), "{name}");
        }
    }
    assert!(counts.iter().all(|count| *count >= 3), "{counts:?}");
}

/// Ends of ranges, and names that are additional or have another spelling.
#[test]
fn schema_accepts_what_the_reader_accepts() {
    for text in [
        "[planning]\nadded_latency_ms = 0\n",
        "[render]\nweather = \"clear_night\"\n",
        "[render]\nweather = \"HardRainSunset\"\n",
        "[sim]\ndt_ms = 20\n",
        "[camera.front]\nfov_deg = 179.9\n",
        "[perception]\ndetector = \"truth\"\n",
    ] {
        assert_eq!(wrong(FileKind::Config, text), Vec::<String>::new(), "{text}");
        let sets: toml::Table = text.parse().unwrap();
        let document = swerve_text::Document::parse("c.toml", sets.to_string()).unwrap();
        let read = Setup::from_document_with(&swerve_stack::Registry::standard(), &document, &[]);
        assert!(read.is_ok(), "{text}: {:?}", read.err());
    }
}

/// The TOML example in the documentation of scenarios, which contains every key.
fn every_key() -> String {
    let source = include_str!("../../../swerve-scenario/src/lib.rs");
    documented(source.split("```toml\n").nth(1).unwrap())
}

/// That of a scenario on a map.
fn every_key_of_a_map() -> String {
    let source = include_str!("../../../swerve-scenario/src/lib.rs");
    documented(source.split("```toml\n").nth(2).unwrap())
}

/// That of another simulator.
fn every_key_of_another_simulator() -> String {
    let source = include_str!("../../../swerve-scenario/src/lib.rs");
    documented(source.split("```toml\n").nth(3).unwrap())
}

fn documented(block: &str) -> String {
    let (form, _) = block.split_once("```").unwrap();
    form.lines().map(|line| line.trim_start_matches("//!").to_owned() + "\n").collect()
}

/// All keys of a schema, as nested tables: a reader that knows all keys accepts it.
fn keys(root: &Value, schema: &Value, at: &str, into: &mut Vec<String>) {
    if let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
        keys(root, root.pointer(&reference[1..]).unwrap(), at, into);
    }
    if let Some(items) = schema.get("items") {
        keys(root, items, at, into);
    }
    for (name, inner) in schema.get("properties").and_then(Value::as_object).into_iter().flatten() {
        into.push(format!("{at}.{name}"));
        keys(root, inner, &format!("{at}.{name}"), into);
    }
}

#[test]
fn scenario_schema_has_the_keys_of_the_reader() {
    assert_eq!(wrong(FileKind::Scenario, &every_key()), Vec::<String>::new());
    let on_map = format!("name = \"a\"\n{}", every_key_of_a_map());
    assert_eq!(wrong(FileKind::Scenario, &on_map), Vec::<String>::new());
    let way = "start = { lane = \"a\", s_m = 1.0 }\ngoal = { lane = \"b\", s_m = 9.0 }";
    let in_sumo =
        format!("name = \"a\"\nmap.file = \"a.net.xml\"\n[ego]\n{way}\n{}", every_key_of_another_simulator());
    assert_eq!(wrong(FileKind::Scenario, &in_sumo), Vec::<String>::new());
    let schema = FileKind::Scenario.schema(&Registry::standard()).to_value();
    let mut all = Vec::new();
    keys(&schema, &schema, "", &mut all);
    for (text, refused) in [
        ("name = \"a\"\ncolour = 1\n", ".colour"),
        ("name = \"a\"\n[road]\nsegments = [{ length_m = 9.0, slope = 1 }]\n", ".slope"),
    ] {
        let wrong = wrong(FileKind::Scenario, text);
        assert!(wrong.iter().any(|problem| problem.contains(refused)), "{wrong:?}");
        let problems = Scenario::parse("s.toml", text).unwrap_err();
        let told: Vec<String> = problems.iter().map(ToString::to_string).collect();
        assert!(told.iter().any(|problem| problem.contains(&refused[1..])), "{told:?}");
    }
    let form = every_key() + &every_key_of_a_map() + &every_key_of_another_simulator();
    for key in all.iter().map(|key| key.rsplit('.').next().unwrap()) {
        let is_used = form.contains(key) || swerve_scenario::Metric::ALL.iter().any(|m| m.name() == key);
        assert!(is_used, "{key} is in the schema, and in no documentation of the text form");
    }
    for metric in swerve_scenario::Metric::ALL {
        let expect = format!(".expect.{}", metric.name());
        assert!(all.contains(&expect), "{expect}");
    }
}

#[test]
fn schemas_refuse_what_the_readers_refuse() {
    let base = "base = { scenario = \"lane\" }\n";
    let axis = "[[axis]]\nkey = \"seed\"\nvalues = \"1..4\"\n";
    assert_eq!(wrong(FileKind::Study, &format!("{base}{axis}")), Vec::<String>::new());
    for (kind, text) in [
        (FileKind::Study, format!("{base}{axis}colour = 1\n")),
        (FileKind::Study, axis.to_owned()),
        (FileKind::Study, format!("{base}[[axis]]\nkey = \"seed\"\nvalues = 3\n")),
        (FileKind::Timing, "span_ms = 10\n".to_owned()),
        (
            FileKind::Timing,
            "span_ms = 10\n[[operator]]\nname = \"a\"\nruntime = { fixd_ms = 1 }\n".to_owned(),
        ),
        (FileKind::Timing, "span_ms = \"10\"\noperator = []\n".to_owned()),
        (FileKind::Config, "[planning]\nplaner = \"fot\"\n".to_owned()),
        (FileKind::Config, "[planning]\nadded_latency_ms = -5\n".to_owned()),
        (FileKind::Config, "[render]\nweather = \"x\"\n".to_owned()),
        (FileKind::Config, "[perception]\ndetector = \"street\"\n".to_owned()),
        (FileKind::Config, "[sim]\ndt_ms = 20.5\n".to_owned()),
        (FileKind::Config, "[camera.front]\nfov_deg = 0\n".to_owned()),
        (FileKind::Scenario, "name = 3\n".to_owned()),
    ] {
        assert!(!wrong(kind, &text).is_empty(), "{text}");
    }
}
