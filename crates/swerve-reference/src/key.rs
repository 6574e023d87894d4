//! One key of a configuration.

use serde::Serialize;

/// A key, and all that is known of it.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Key {
    /// Dotted, from the top; `NAME` stands for any name.
    pub key: String,
    /// Under which setting it is there, where that is not always.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub only_with: Option<String>,
    /// What it takes: `number`, `true or false`, `array of 3 x number`.
    #[serde(rename = "type")]
    pub form: String,
    /// What it is when nothing says otherwise, as TOML; none where it is then absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub default: Option<String>,
    /// As its name says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<&'static str>,
    /// As the check tells it of a value far outside.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<String>,
    /// What it is for.
    pub doc: String,
    /// The values that it takes, where these are names.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<Choice>,
}

/// A value that has a name.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Choice {
    /// As it is written.
    pub name: String,
    /// What it means.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub doc: String,
}

impl Key {
    /// Its last part.
    pub(crate) fn name(&self) -> &str {
        self.key.rsplit('.').next().unwrap_or(&self.key)
    }
}

/// The unit that the end of a name says; the longer endings first.
const UNITS: [(&str, &str); 22] = [
    ("_mps3", "m/s³"),
    ("_mps2", "m/s²"),
    ("_radps2", "rad/s²"),
    ("_radps", "rad/s"),
    ("_degps", "deg/s"),
    ("_per_unit_us", "µs per unit"),
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
    ("_bytes", "bytes"),
    ("_m2", "m²"),
    ("_m", "m"),
    ("_s", "s"),
];

/// The unit of a key of this name.
pub(crate) fn unit(name: &str) -> Option<&'static str> {
    UNITS.iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, unit)| *unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_name_says_the_unit() {
        for (name, wanted) in [
            ("speed_mps", Some("m/s")),
            ("decel_mps2", Some("m/s²")),
            ("horizon_s", Some("s")),
            ("at_m", Some("m")),
            ("curvature_1pm", Some("1/m")),
            ("seed", None),
        ] {
            assert_eq!(unit(name), wanted, "{name}");
        }
    }
}
