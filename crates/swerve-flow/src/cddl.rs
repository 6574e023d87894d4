//! Schema of a message in CDDL (RFC 8610), with the names that serde writes; logs store it with each stream.

use core::fmt::Write as _;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};

use serde::de::DeserializeOwned;
use serde::{Serialize, Serializer};
use serde_reflection::{
    ContainerFormat, Format, FormatHolder as _, Named, Registry, Samples, Tracer, TracerConfig, VariantFormat,
};

/// Returns CDDL rules, the first of which is `payload`; `payload = any` for a type that cannot be traced, such as one
/// that refuses made-up values.
pub(crate) fn cddl<T: DeserializeOwned>() -> String {
    rules::<T>().unwrap_or_else(|| "payload = any\n".to_owned())
}

/// Maximum number of traces of a type. Each finds one more variant of every enum; none has more variants than this.
const LOOKS: usize = 1000;

/// Traces the parts of a type, by name.
///
/// The tracer enters a sequence or an option once, and sees only one variant of an enum in it. The type is therefore
/// traced repeatedly until no new variant is found, each time with the known variants given to the tracer.
fn trace<T: DeserializeOwned>() -> Option<(Format, Registry)> {
    let mut found = Registry::new();
    for _ in 0..LOOKS {
        let mut tracer = Tracer::new(TracerConfig::default().is_human_readable(false));
        let mut samples = Samples::new();
        for known in found.iter().flat_map(|(name, container)| KnownVariant::of(name, container)) {
            tracer.trace_value(&mut samples, &known).ok()?;
        }
        let (mut payload, _) = tracer.trace_type_once::<T>(&samples).ok()?;
        payload.normalize().ok()?;
        let mut is_new = false;
        for (name, container) in tracer.registry_unchecked() {
            let ContainerFormat::Enum(variants) = container else {
                found.entry(name).or_insert(container);
                continue;
            };
            let of = found.entry(name).or_insert_with(|| ContainerFormat::Enum(BTreeMap::new()));
            let ContainerFormat::Enum(known) = of else { return None };
            for (place, variant) in variants {
                if !known.values().any(|other| other.name == variant.name) {
                    // The tracer numbers the unknown variants from the end, in their order.
                    known.insert(place, variant);
                    is_new = true;
                }
            }
        }
        if !is_new {
            return Some((payload, found));
        }
    }
    None
}

/// A known variant of an enum, traced as a value so that the tracer need not look for it.
///
/// If the tracer knows all variants it enters the first one once more, which must then match the traced value: a
/// variant without data, or with bytes.
struct KnownVariant {
    choice: &'static str,
    place: u32,
    name: &'static str,
    holds_bytes: bool,
}

impl KnownVariant {
    fn of(choice: &str, container: &ContainerFormat) -> Vec<Self> {
        let ContainerFormat::Enum(variants) = container else { return Vec::new() };
        let one = |(place, variant): (usize, &Named<VariantFormat>)| Self {
            choice: lasting(choice),
            place: place as u32,
            name: lasting(&variant.name),
            holds_bytes: matches!(&variant.value, VariantFormat::NewType(inner) if **inner == Format::Bytes),
        };
        variants.values().enumerate().map(one).collect()
    }
}

impl Serialize for KnownVariant {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.holds_bytes {
            return serializer.serialize_newtype_variant(self.choice, self.place, self.name, &NoBytes);
        }
        serializer.serialize_unit_variant(self.choice, self.place, self.name)
    }
}

struct NoBytes;

impl Serialize for NoBytes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(&[])
    }
}

/// Interns a name, because serde requires static names; each is leaked only once.
fn lasting(name: &str) -> &'static str {
    static NAMES: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(kept) = names.get(name) {
        return kept;
    }
    let kept: &'static str = Box::leak(name.into());
    names.insert(kept);
    kept
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

/// Form of one variant: its name, or a map from its name to its data.
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

/// Form of one element, with a choice in parentheses.
fn grouped(format: &Format) -> Option<String> {
    let form = form(format)?;
    Some(if form.contains(" / ") { format!("({form})") } else { form })
}

#[cfg(test)]
mod tests {
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
        seen: Vec<Sample>,
    }

    #[derive(Deserialize)]
    #[expect(dead_code, reason = "only its form is looked at")]
    struct Sample {
        kind: Kind,
        why: Option<State>,
        light: Option<Light>,
    }

    #[derive(Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Kind {
        Car,
        Truck,
        Pedestrian,
    }

    #[derive(Deserialize)]
    #[expect(dead_code, reason = "only its form is looked at")]
    enum Light {
        Off,
        Shows(Vec<Kind>),
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

    /// An enum whose variants all hold bytes.
    #[derive(Deserialize)]
    enum Pixels {
        Grey(Run),
        Colour(Run),
    }

    struct Run;

    impl<'de> Deserialize<'de> for Run {
        fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            deserializer.deserialize_byte_buf(serde::de::IgnoredAny).map(|_| Self)
        }
    }

    /// Refuses made-up values.
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
            Kind = \"car\" / \"truck\" / \"pedestrian\"\n\
            Light = \"Off\" / { Shows: [* Kind] }\n\
            Plan = { id: uint, at_m: [2*2 float], points: [* Point], stop: float / null, state: State, \
            by_name: { * tstr => int }, seen: [* Sample] }\n\
            Point = [float, float]\n\
            Sample = { kind: Kind, why: State / null, light: Light / null }\n\
            State = \"found\" / { failed: { reason: tstr } } / { late: uint }\n";
        assert_eq!(cddl::<Plan>(), expected);
        assert_eq!(cddl::<Vec<Option<bool>>>(), "payload = [* (bool / null)]\n");
        let pixels = "payload = Pixels\nPixels = { Grey: bstr } / { Colour: bstr }\n";
        assert_eq!(cddl::<Pixels>(), pixels);
        assert_eq!(cddl::<Even>(), "payload = any\n");
    }
}
