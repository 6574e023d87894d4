//! The form of a message in CDDL (RFC 8610), by the names that serde writes: what a log says of its streams.

use core::fmt::Write as _;

use serde::de::DeserializeOwned;
use serde_reflection::{
    ContainerFormat, Error, Format, Named, Registry, Samples, Tracer, TracerConfig, VariantFormat,
};

/// Rules of which the first is `payload`; `payload = any` of a type that does not show its form to a tracer, such as one
/// that refuses made-up values.
pub(crate) fn cddl<T: DeserializeOwned>() -> String {
    rules::<T>().unwrap_or_else(|| "payload = any\n".to_owned())
}

/// Looks at a type, which has choices that hold themselves where this is not enough.
const VARIANTS: usize = 1000;

/// What a type is made of, by name. The tracer shows one variant more of each choice each time; of choices it tells which,
/// once it has come upon them.
fn trace<T: DeserializeOwned>() -> Option<(Format, Registry)> {
    let samples = Samples::new();
    let mut choices = Vec::<String>::new();
    loop {
        let mut tracer = Tracer::new(TracerConfig::default().is_human_readable(false));
        let mut payload = Format::unknown();
        for _ in 0..VARIANTS {
            (payload, _) = tracer.trace_type_once::<T>(&samples).ok()?;
            if choices.iter().filter_map(|name| tracer.check_incomplete_enum(name)).count() == 0 {
                break;
            }
        }
        match tracer.registry() {
            Ok(registry) => return Some((payload, registry)),
            Err(Error::MissingVariants(names)) if names.iter().any(|name| !choices.contains(name)) => {
                choices.extend(names);
            }
            Err(_) => return None,
        }
    }
}

fn rules<T: DeserializeOwned>() -> Option<String> {
    let (payload, registry) = trace::<T>()?;
    let mut rules = format!("payload = {}\n", form(&payload)?);
    for (name, container) in registry {
        let form = match &container {
            ContainerFormat::UnitStruct => "null".to_owned(),
            ContainerFormat::NewTypeStruct(inner) => form(inner)?,
            ContainerFormat::TupleStruct(parts) => tuple(parts)?,
            ContainerFormat::Struct(fields) => map(fields)?,
            ContainerFormat::Enum(variants) => {
                let forms: Option<Vec<String>> = variants.values().map(variant).collect();
                forms?.join(" / ")
            }
        };
        let _infallible = writeln!(rules, "{name} = {form}");
    }
    Some(rules)
}

fn map(fields: &[Named<Format>]) -> Option<String> {
    let fields: Option<Vec<String>> =
        fields.iter().map(|field| Some(format!("{}: {}", field.name, form(&field.value)?))).collect();
    Some(format!("{{ {} }}", fields?.join(", ")))
}

fn tuple(parts: &[Format]) -> Option<String> {
    let parts: Option<Vec<String>> = parts.iter().map(form).collect();
    Some(format!("[{}]", parts?.join(", ")))
}

/// One variant: its name, or a map from its name to what it holds.
fn variant(variant: &Named<VariantFormat>) -> Option<String> {
    let name = &variant.name;
    let inner = match &variant.value {
        VariantFormat::Unit => return Some(format!("\"{name}\"")),
        VariantFormat::NewType(inner) => form(inner)?,
        VariantFormat::Tuple(parts) => tuple(parts)?,
        VariantFormat::Struct(fields) => map(fields)?,
        VariantFormat::Variable(_) => return None,
    };
    Some(format!("{{ {name}: {inner} }}"))
}

fn form(format: &Format) -> Option<String> {
    Some(match format {
        Format::Variable(_) => return None,
        Format::TypeName(name) => name.clone(),
        Format::Unit => "null".into(),
        Format::Bool => "bool".into(),
        Format::I8 | Format::I16 | Format::I32 | Format::I64 | Format::I128 => "int".into(),
        Format::U8 | Format::U16 | Format::U32 | Format::U64 | Format::U128 => "uint".into(),
        Format::F32 | Format::F64 => "float".into(),
        Format::Char | Format::Str => "tstr".into(),
        Format::Bytes => "bstr".into(),
        Format::Option(inner) => format!("{} / null", form(inner)?),
        Format::Seq(inner) => format!("[* {}]", grouped(inner)?),
        Format::Map { key, value } => format!("{{ * {} => {} }}", grouped(key)?, grouped(value)?),
        Format::Tuple(parts) => tuple(parts)?,
        Format::TupleArray { content, size } => format!("[{size}*{size} {}]", grouped(content)?),
    })
}

/// A form as one element: a choice in parentheses.
fn grouped(format: &Format) -> Option<String> {
    let form = form(format)?;
    Some(if form.contains(" / ") { format!("({form})") } else { form })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde::Deserialize;

    use super::*;

    #[derive(Deserialize)]
    #[expect(dead_code, reason = "only its form is looked at")]
    struct Plan {
        id: u32,
        at_m: [f64; 2],
        points: Vec<Point>,
        stop: Option<f64>,
        state: State,
        by_name: BTreeMap<String, i64>,
    }

    #[derive(Deserialize)]
    #[expect(dead_code, reason = "only its form is looked at")]
    struct Point(f64, f64);

    #[derive(Deserialize)]
    #[serde(rename_all = "snake_case")]
    #[expect(dead_code, reason = "only its form is looked at")]
    enum State {
        Found,
        Failed { reason: String },
        Late(u8),
    }

    /// Takes no value that is made up.
    struct Even;

    impl<'de> Deserialize<'de> for Even {
        fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            match u64::deserialize(deserializer)? {
                n if n > 0 && n.is_multiple_of(2) => Ok(Self),
                _ => Err(serde::de::Error::custom("expected an even number")),
            }
        }
    }

    #[test]
    fn forms_are_those_that_serde_writes() {
        let expected = "payload = Plan\n\
            Plan = { id: uint, at_m: [2*2 float], points: [* Point], stop: float / null, state: State, \
            by_name: { * tstr => int } }\n\
            Point = [float, float]\n\
            State = \"found\" / { failed: { reason: tstr } } / { late: uint }\n";
        assert_eq!(cddl::<Plan>(), expected);
        assert_eq!(cddl::<Vec<Option<bool>>>(), "payload = [* (bool / null)]\n");
        assert_eq!(cddl::<Even>(), "payload = any\n");
    }
}
