//! One key of a configuration.

use serde::Serialize;

/// Reference entry of a key.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Key {
    /// Dotted path from the top; `NAME` stands for any name.
    pub key: String,
    /// Setting under which the key exists; `None` if it always does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub only_with: Option<String>,
    /// Type of the value: `number`, `true or false`, `array of 3 x number`.
    #[serde(rename = "type")]
    pub form: String,
    /// Default as TOML; `None` if the key is then absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub default: Option<String>,
    /// Unit, by the suffix of the name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<&'static str>,
    /// Range of a number, or of the numbers of an array, ends included.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<String>,
    /// Description.
    pub doc: String,
    /// Valid names, if the values are names.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<Choice>,
}

/// A named value.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Choice {
    /// Spelling.
    pub name: String,
    /// Description.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub doc: String,
}

impl Key {
    /// Last component of the path.
    pub(crate) fn name(&self) -> &str {
        self.key.rsplit('.').next().unwrap_or(&self.key)
    }
}

/// Unit by suffix of a name; longer suffixes first.
const UNITS: [(&str, &str); 30] = [
    ("_mps3", "m/s³"),
    ("_mps2", "m/s²"),
    ("_radps2", "rad/s²"),
    ("_radps", "rad/s"),
    ("_degps", "deg/s"),
    ("_per_unit_us", "µs per unit"),
    ("_m_per_px", "m per pixel"),
    ("_per_min", "per minute"),
    ("_kgpm3", "kg/m³"),
    ("_nspm", "N s/m"),
    ("_mps", "m/s"),
    ("_1pm", "1/m"),
    ("_kgm2", "kg m²"),
    ("_npm", "N/m"),
    ("_nm", "N m"),
    ("_ms", "ms"),
    ("_us", "µs"),
    ("_kg", "kg"),
    ("_hz", "Hz"),
    ("_px", "pixels"),
    ("_rad", "rad"),
    ("_deg", "degrees"),
    ("_db", "dB"),
    ("_ps", "1/s"),
    ("_bytes", "bytes"),
    ("_m2", "m²"),
    ("_m", "m"),
    ("_s", "s"),
    ("_n", "N"),
    ("_w", "W"),
];

/// Unit of a key of this name.
pub(crate) fn unit(name: &str) -> Option<&'static str> {
    let is_of = |ending: &str| name.ends_with(ending) || name == &ending[1..];
    UNITS.iter().find(|(ending, _)| is_of(ending)).map(|(_, unit)| *unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_follows_from_the_suffix() {
        for (name, wanted) in [
            ("speed_mps", Some("m/s")),
            ("decel_mps2", Some("m/s²")),
            ("horizon_s", Some("s")),
            ("at_m", Some("m")),
            ("curvature_1pm", Some("1/m")),
            ("per_unit_us", Some("µs per unit")),
            ("m_per_px", Some("m per pixel")),
            ("seed", None),
        ] {
            assert_eq!(unit(name), wanted, "{name}");
        }
    }
}
