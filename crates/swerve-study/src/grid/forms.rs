//! Values of a study file with several notations.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use toml::Value;

/// One file, or an array of files.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Files(pub Vec<PathBuf>);

/// Distinguishes the notations by the type of the value, so that errors use the terms of the file.
impl<'de> Deserialize<'de> for Files {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrMany;
        impl<'de> Visitor<'de> for OneOrMany {
            type Value = Files;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a file, or an array of files")
            }

            fn visit_str<E: de::Error>(self, file: &str) -> Result<Files, E> {
                Ok(Files(vec![file.into()]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut files: A) -> Result<Files, A::Error> {
                let mut all = Vec::new();
                while let Some(file) = files.next_element()? {
                    all.push(file);
                }
                Ok(Files(all))
            }
        }
        deserializer.deserialize_any(OneOrMany)
    }
}

impl JsonSchema for Files {
    fn schema_name() -> Cow<'static, str> {
        "Files".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" } }] })
    }
}

/// Values of an axis: an array, integers `"1..20"` including both ends, or `{ from, to, step }` including both ends.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Values(pub Vec<Value>);

impl Values {
    /// An integer and a float that are the same number, if there are any: two drives of one setting.
    pub(super) fn equal_numbers(&self) -> Option<[&Value; 2]> {
        let as_whole = |value: &Value| match value {
            Value::Float(x) if x.fract() == 0.0 && x.abs() < 9e15 => Some(*x as i64),
            _ => None,
        };
        let whole: BTreeMap<i64, &Value> =
            self.0.iter().filter_map(|value| Some((as_whole(value)?, value))).collect();
        let equal = |value| Some([value, *whole.get(&Value::as_integer(value)?)?]);
        self.0.iter().find_map(equal)
    }
}

impl JsonSchema for Values {
    fn schema_name() -> Cow<'static, str> {
        "Values".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "type": "array" },
            { "type": "string", "pattern": r"^\s*-?[0-9]+\s*\.\.\s*-?[0-9]+\s*$" },
            {
                "type": "object",
                "properties": {
                    "from": { "type": "number" }, "to": { "type": "number" }, "step": { "type": "number" },
                },
                "required": ["from", "to", "step"],
                "additionalProperties": false,
            },
        ] })
    }
}

/// Maximum number of values; more are considered a mistake.
const VALUES_MAX: usize = 100_000;

/// Equally spaced numbers including both ends.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Range {
    from: Value,
    to: Value,
    step: Value,
}

impl Range {
    fn values(&self) -> Result<Vec<Value>, String> {
        let wrong =
            || "expected `from`, `to` and a `step` that is above 0 and leads from the one to the other";
        if let (Value::Integer(from), Value::Integer(to), Value::Integer(step)) =
            (&self.from, &self.to, &self.step)
        {
            if to < from || *step <= 0 {
                return Err(wrong().to_owned());
            }
            let last = to.checked_sub(*from).and_then(|way| usize::try_from(way / step).ok());
            return many(last, |k| Value::Integer(from + k as i64 * step));
        }
        let number = |value: &Value| match value {
            Value::Integer(whole) => Some(*whole as f64),
            Value::Float(x) => Some(*x).filter(|x| x.is_finite()),
            _ => None,
        };
        let all = [&self.from, &self.to, &self.step].map(number);
        let [Some(from), Some(to), Some(step)] = all else { return Err(wrong().to_owned()) };
        if !(step > 0.0 && to >= from) {
            return Err(wrong().to_owned());
        }
        // The tolerance of 1e-6 steps covers the rounding of decimals such as 0.1.
        let count = ((to - from) / step + 1e-6).floor();
        // Rounded to nine decimals: 0.3, not 0.30000000000000004.
        let at = |k: usize| Value::Float(((from + k as f64 * step) * 1e9).round() / 1e9);
        many(Some(count as usize), at)
    }
}

/// The first `last` + 1 values.
fn many(last: Option<usize>, at: impl Fn(usize) -> Value) -> Result<Vec<Value>, String> {
    match last.filter(|last| *last < VALUES_MAX) {
        Some(last) => Ok((0..=last).map(at).collect()),
        None => Err(format!("expected at most {VALUES_MAX} values")),
    }
}

impl<'de> Deserialize<'de> for Values {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AnyForm;
        impl<'de> Visitor<'de> for AnyForm {
            type Value = Values;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an array, a range such as \"1..20\", or { from = 0, to = 400, step = 40 }")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Values, E> {
                let beyond = |error: &std::num::ParseIntError| {
                    use std::num::IntErrorKind::{NegOverflow, PosOverflow};
                    matches!(error.kind(), NegOverflow | PosOverflow)
                };
                let ends =
                    text.split_once("..").map(|(from, to)| [from, to].map(|end| end.trim().parse::<i64>()));
                if ends.iter().flatten().any(|end| end.as_ref().is_err_and(beyond)) {
                    let (min, max) = (i64::MIN, i64::MAX);
                    return Err(E::custom(format!(
                        "expected whole numbers from {min} to {max}, found {text:?}"
                    )));
                }
                let ends = ends.and_then(|[from, to]| Some((from.ok()?, to.ok()?)));
                let Some((from, to)) = ends else {
                    return Err(E::invalid_value(de::Unexpected::Str(text), &self));
                };
                if to < from {
                    return Err(E::custom(format!("expected the lower number first, found {text:?}")));
                }
                let range = Range { from: from.into(), to: to.into(), step: 1.into() };
                range.values().map(Values).map_err(E::custom)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut values: A) -> Result<Values, A::Error> {
                let mut all = Vec::new();
                while let Some(value) = values.next_element()? {
                    all.push(value);
                }
                Ok(Values(all))
            }

            fn visit_map<A: MapAccess<'de>>(self, range: A) -> Result<Values, A::Error> {
                let range = Range::deserialize(MapAccessDeserializer::new(range))?;
                range.values().map(Values).map_err(de::Error::custom)
            }
        }
        deserializer.deserialize_any(AnyForm)
    }
}

/// Default name of an axis: the last part of its key, with the name in front for a key of an actor or patch, since these
/// and the ego share key names.
pub(super) fn name_of(key: &str) -> String {
    let parts: Vec<&str> = key.split('.').collect();
    match parts[..] {
        ["actor" | "slippery", name, .., last] => format!("{name}.{last}"),
        _ => parts.last().copied().unwrap_or(key).to_owned(),
    }
}

/// Label of a value in tables.
pub(super) fn label_of(value: &toml::Value) -> String {
    match value {
        toml::Value::String(s) => s.clone(),
        toml::Value::Float(x) if x.abs() >= 1e15 => swerve_text::number(*x),
        other => other.to_string(),
    }
}
