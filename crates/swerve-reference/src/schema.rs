//! Conversion of the schema of a type to its keys.

use schemars::Schema;
use serde_json::{Map, Value};

use crate::key::{Choice, Key, unit};

/// Treatment of arrays of tables.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Arrays {
    /// One key for the whole array.
    Whole,
    /// One key for each key of its entries: `actor.NAME.kind`.
    Within,
}

/// All keys of a type, ordered by name, with `prefix`. `defaults` are the defaults of the whole value, used where the
/// type does not give them per key.
pub(crate) fn keys(schema: &Schema, prefix: &str, defaults: Option<&Value>, arrays: Arrays) -> Vec<Key> {
    keys_with_places(schema, prefix, defaults, arrays).into_iter().map(|(key, _)| key).collect()
}

/// Same as [`keys`], with the location of each value's schema (a JSON pointer).
pub(crate) fn keys_with_places(
    schema: &Schema,
    prefix: &str,
    defaults: Option<&Value>,
    arrays: Arrays,
) -> Vec<(Key, String)> {
    let none = Map::new();
    let root = schema.as_value();
    let defs = root.get("$defs").and_then(Value::as_object).unwrap_or(&none);
    let mut keys = Vec::new();
    let mut walk = Walk { defs, keys: &mut keys, depth: 0, arrays };
    walk.node(Node { schema: root, place: String::new() }, prefix, defaults);
    keys
}

/// Maximum nesting depth, which stops at recursive types.
const DEPTH_MAX: usize = 12;

struct Walk<'a> {
    defs: &'a Map<String, Value>,
    keys: &'a mut Vec<(Key, String)>,
    depth: usize,
    arrays: Arrays,
}

/// A part of a schema and its location.
struct Node<'a> {
    schema: &'a Value,
    place: String,
}

impl<'a> Node<'a> {
    fn inner(&self, schema: &'a Value, way: &str) -> Self {
        Self { schema, place: format!("{}/{way}", self.place) }
    }
}

impl<'a> Walk<'a> {
    /// Adds the keys of a table, or the one key of a value.
    fn node(&mut self, node: Node<'a>, at: &str, default: Option<&Value>) {
        let schema = node.schema;
        let default = schema.get("default").or(default);
        let inner = meant(self.defs, node);
        let properties = inner.schema.get("properties").and_then(Value::as_object);
        let entries = inner.schema.get("additionalProperties").filter(|entry| entry.is_object());
        let items = inner.schema.get("items").filter(|_| self.arrays == Arrays::Within);
        let of_array = items.filter(|item| is_table(self.defs, item)).map(|item| (item, "items"));
        self.depth += 1;
        match (properties, entries.map(|entry| (entry, "additionalProperties")).or(of_array)) {
            _ if self.depth > DEPTH_MAX => {}
            (Some(properties), _) => {
                for (name, property) in properties {
                    let property = inner.inner(property, &format!("properties/{name}"));
                    self.node(property, &join(at, name), default.and_then(|all| all.get(name)));
                }
            }
            (None, Some((entry, way))) if is_table(self.defs, entry) => {
                self.node(inner.inner(entry, way), &join(at, "NAME"), None);
            }
            _ => self.keys.push((self.key(schema, inner.schema, at, default), inner.place)),
        }
        self.depth -= 1;
    }

    fn key(&self, schema: &Value, inner: &Value, at: &str, default: Option<&Value>) -> Key {
        let doc = [schema, inner].into_iter().find_map(|node| node.get("description")?.as_str());
        let name = at.rsplit('.').next().unwrap_or(at);
        Key {
            key: at.to_owned(),
            only_with: None,
            form: form(self.defs, inner),
            default: default.and_then(as_toml),
            unit: unit(name),
            range: range(inner),
            doc: prose(doc.unwrap_or_default()),
            choices: choices(inner),
        }
    }
}

fn join(at: &str, name: &str) -> String {
    if at.is_empty() { name.to_owned() } else { format!("{at}.{name}") }
}

/// Resolves references and `anything or null`.
fn resolved<'a>(defs: &'a Map<String, Value>, schema: &'a Value) -> &'a Value {
    meant(defs, Node { schema, place: String::new() }).schema
}

/// Same as [`resolved`], with the location.
fn meant<'a>(defs: &'a Map<String, Value>, node: Node<'a>) -> Node<'a> {
    let schema = node.schema;
    if let Some(name) = schema.get("$ref").and_then(Value::as_str) {
        let name = name.rsplit('/').next().unwrap_or_default();
        let def = |schema| meant(defs, Node { schema, place: format!("/$defs/{name}") });
        return defs.get(name).map_or(node, def);
    }
    let any = schema.get("anyOf").and_then(Value::as_array);
    let mut others =
        any.into_iter().flatten().enumerate().filter(|(_, one)| one.get("type") != Some(&"null".into()));
    match (others.next(), others.next()) {
        (Some((k, only)), None) => meant(defs, node.inner(only, &format!("anyOf/{k}"))),
        _ => node,
    }
}

fn is_table(defs: &Map<String, Value>, schema: &Value) -> bool {
    let inner = resolved(defs, schema);
    inner.get("properties").is_some() || inner.get("additionalProperties").is_some_and(Value::is_object)
}

/// Describes the type of a value.
fn form(defs: &Map<String, Value>, schema: &Value) -> String {
    let schema = resolved(defs, schema);
    if schema.get("const").or(schema.get("enum")).is_some() {
        return "name".to_owned();
    }
    if let Some(Value::Array(any)) = schema.get("anyOf").or(schema.get("oneOf")) {
        let mut forms: Vec<String> = any.iter().map(|one| form(defs, one)).collect();
        forms.dedup();
        return forms.join(" or ");
    }
    let kinds = match schema.get("type") {
        Some(Value::String(kind)) => vec![kind.as_str()],
        Some(Value::Array(kinds)) => kinds.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    let told = kinds.iter().filter(|kind| **kind != "null").map(|kind| match *kind {
        "integer" => "whole number".to_owned(),
        "boolean" => "true or false".to_owned(),
        "string" => "text".to_owned(),
        "object" => "table".to_owned(),
        "array" => {
            let of = schema.get("items").map_or_else(|| "values".into(), |item| form(defs, item));
            match schema.get("minItems").filter(|least| Some(*least) == schema.get("maxItems")) {
                Some(count) => format!("array of {count} x {of}"),
                None => format!("array of {of}"),
            }
        }
        other => other.to_owned(),
    });
    let told: Vec<String> = told.collect();
    if told.is_empty() { "any value".to_owned() } else { told.join(" or ") }
}

/// Range of a number, or of the numbers of an array.
fn range(schema: &Value) -> Option<String> {
    if let Some(items) = schema.get("items") {
        return range(items);
    }
    let end = |keyword| schema.get(keyword).and_then(Value::as_f64);
    let low = end("minimum")?;
    Some(end("maximum").map_or_else(|| format!("{low} or more"), |high| format!("{low} to {high}")))
}

/// Valid names of a value.
fn choices(schema: &Value) -> Vec<Choice> {
    let plain = schema.get("enum").and_then(Value::as_array).into_iter().flatten();
    let plain = plain.filter_map(|name| Some(Choice { name: name.as_str()?.into(), doc: String::new() }));
    let told = schema.get("oneOf").and_then(Value::as_array).into_iter().flatten();
    let told = told.flat_map(|one| {
        let doc = one.get("description").and_then(Value::as_str).unwrap_or_default();
        let doc = prose(doc);
        let names = match (one.get("const"), one.get("enum")) {
            (Some(name), _) => vec![name],
            (None, Some(Value::Array(names))) => names.iter().collect(),
            _ => Vec::new(),
        };
        let names: Vec<String> = names.iter().filter_map(|name| Some(name.as_str()?.to_owned())).collect();
        names.into_iter().map(move |name| Choice { name, doc: doc.clone() })
    });
    plain.chain(told).collect()
}

/// A doc comment in one line, with the names of its links to items.
fn prose(doc: &str) -> String {
    let line = doc.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut parts = line.split("[`");
    let mut prose = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, rest) = part.split_once("`]").unwrap_or((part, ""));
        let path = rest.strip_prefix('(').and_then(|rest| rest.split_once(')'));
        let rest = path.map_or(rest, |(_, rest)| rest);
        prose.extend(["`", name, "`", rest]);
    }
    prose
}

/// A default as TOML, abbreviated.
fn as_toml(value: &Value) -> Option<String> {
    const LONG: usize = 60;
    let value = toml::Value::try_from(value).ok()?;
    let text = value.to_string();
    let is_long = text.chars().count() > LONG;
    Some(match value {
        toml::Value::Table(table) if is_long => format!("a table of {}", table.len()),
        toml::Value::Array(entries) if is_long => format!("an array of {}", entries.len()),
        _ => text,
    })
}
