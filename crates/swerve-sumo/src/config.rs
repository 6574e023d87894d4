//! SUMO's configurations (`.sumocfg`): the files of a simulation, its times, and the options that change the traffic.
//!
//! Options that write files, open windows or control the run are left out: Swerve starts SUMO with options of its own.

use std::path::{Path, PathBuf};

use swerve_map_io::xml::{Reader, number, parse};
use swerve_map_io::{Problems, quoted};

/// Options that change the traffic, passed on as they are.
const PASSED: [&str; 24] = [
    "action-step-length",
    "collision.mingap-factor",
    "default.action-step-length",
    "default.carfollowmodel",
    "default.emergencydecel",
    "default.speeddev",
    "device.rerouting.adaptation-interval",
    "device.rerouting.period",
    "device.rerouting.probability",
    "extrapolate-departpos",
    "ignore-junction-blocker",
    "ignore-route-errors",
    "lanechange.duration",
    "lanechange.overtake-right",
    "lateral-resolution",
    "max-depart-delay",
    "max-num-vehicles",
    "pedestrian.model",
    "random-depart-offset",
    "route-steps",
    "scale",
    "step-method.ballistic",
    "time-to-impatience",
    "tls.actuated.jam-threshold",
];

/// Short names of options.
const SHORT: [(&str, &str); 6] = [
    ("n", "net-file"),
    ("net", "net-file"),
    ("r", "route-files"),
    ("a", "additional-files"),
    ("additional", "additional-files"),
    ("b", "begin"),
];

/// Step of SUMO without an option, seconds.
const STEP_S: f64 = 1.0;

/// A configuration.
#[derive(Clone, PartialEq, Debug)]
pub struct SumoConfig {
    /// Road network.
    pub net: PathBuf,
    /// Files with routes and vehicles.
    pub routes: Vec<PathBuf>,
    /// Additional files.
    pub additional: Vec<PathBuf>,
    /// Simulated time of the begin, seconds.
    pub begin_s: f64,
    /// Step, seconds; `None` if the file has none.
    pub step_s: Option<f64>,
    /// Other options that change the traffic: name and value.
    pub options: Vec<(String, String)>,
    /// Names of options that are left out.
    pub left_out: Vec<String>,
}

impl SumoConfig {
    /// Step of SUMO itself, seconds: that of the file, else 1 s.
    pub fn own_step_s(&self) -> f64 {
        self.step_s.unwrap_or(STEP_S)
    }

    /// Reads the text of a configuration; files that it names are relative to its folder.
    ///
    /// # Errors
    /// All faults, with line and element: another root element, no network, numbers that are wrong.
    pub fn read(path: &Path, text: &str) -> Result<Self, Problems> {
        let file = path.display().to_string();
        let folder = path.parent().unwrap_or(Path::new(""));
        let document = parse(&file, text)?;
        let root = document.root_element();
        let mut xml = Reader::default();
        if !["configuration", "sumoConfiguration"].contains(&root.tag_name().name()) {
            xml.fault(root, || "expected the element `configuration`".to_owned());
        }
        let mut config = Self {
            net: PathBuf::new(),
            routes: Vec::new(),
            additional: Vec::new(),
            begin_s: 0.0,
            step_s: None,
            options: Vec::new(),
            left_out: Vec::new(),
        };
        for at in root.descendants().filter(|node| node.is_element()) {
            let Some(value) = at.attribute("value").or_else(|| at.attribute("v")) else { continue };
            let name = at.tag_name().name();
            let name = SHORT.iter().find(|(short, _)| *short == name).map_or(name, |(_, long)| long);
            let files = || -> Vec<PathBuf> {
                let names = value.split([',', ' ']).map(str::trim).filter(|name| !name.is_empty());
                names.map(|name| there(folder.join(name))).collect()
            };
            match name {
                "net-file" => config.net = there(folder.join(value.trim())),
                "route-files" => config.routes = files(),
                "additional-files" => config.additional = files(),
                "begin" => match seconds(value) {
                    Ok(begin_s) => config.begin_s = begin_s,
                    Err(message) => xml.fault_in(at, "value", || message),
                },
                "step-length" => match seconds(value) {
                    Ok(step_s) if step_s > 0.0 => config.step_s = Some(step_s),
                    Ok(_) => {
                        xml.fault_in(at, "value", || format!("expected a step, found {}", quoted(value)))
                    }
                    Err(message) => xml.fault_in(at, "value", || message),
                },
                passed if PASSED.contains(&passed) => {
                    config.options.push((name.to_owned(), value.to_owned()));
                }
                other => config.left_out.push(other.to_owned()),
            }
        }
        if config.net.as_os_str().is_empty() {
            xml.fault(root, || "expected the element `net-file` with the road network".to_owned());
        }
        let (faults, ..) = xml.finish(&file, text);
        if faults.count() == 0 { Ok(config) } else { Err(faults) }
    }
}

/// A file, or the one packed by gzip in its place.
fn there(path: PathBuf) -> PathBuf {
    let mut packed = path.clone().into_os_string();
    packed.push(".gz");
    let packed = PathBuf::from(packed);
    if !path.exists() && packed.exists() { packed } else { path }
}

/// Seconds, or `[days:]hours:minutes:seconds`.
fn seconds(text: &str) -> Result<f64, String> {
    let factors = [1.0, 60.0, 3_600.0, 86_400.0];
    let parts: Vec<&str> = text.trim().rsplit(':').collect();
    if parts.len() > factors.len() {
        return Err(format!("expected a time, found {}", quoted(text)));
    }
    let mut sum_s = 0.0;
    for (part, factor) in parts.into_iter().zip(factors) {
        sum_s += number(part)? * factor;
    }
    if (0.0..=1e8).contains(&sum_s) {
        Ok(sum_s)
    } else {
        Err(format!("expected a time, found {}", quoted(text)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_relative_to_the_configuration_and_outputs_left_out() {
        let text = "<configuration><input><net-file value=\"a.net.xml\"/><route-files value=\"b.rou.xml, c.rou.xml\"/>\
                    <additional-files v=\"d.xml\"/></input><output><tripinfo-output value=\"t.xml\"/></output>\
                    <time><begin value=\"0:01:02:03\"/><step-length value=\"0.5\"/></time>\
                    <processing><lateral-resolution value=\"0.4\"/></processing></configuration>";
        let config = SumoConfig::read(Path::new("town/x.sumocfg"), text).unwrap();
        assert_eq!(config.net, Path::new("town/a.net.xml"));
        assert_eq!(config.routes, ["town/b.rou.xml", "town/c.rou.xml"].map(PathBuf::from));
        assert_eq!(config.additional, ["town/d.xml"].map(PathBuf::from));
        assert_eq!((config.begin_s, config.step_s), (3_723.0, Some(0.5)));
        assert_eq!(config.options, [("lateral-resolution".to_owned(), "0.4".to_owned())]);
        assert_eq!(config.left_out, ["tripinfo-output"]);
    }

    #[test]
    fn wrong_configurations_are_refused_with_their_line() {
        let refused = |text: &str| SumoConfig::read(Path::new("x.sumocfg"), text).unwrap_err().to_string();
        for (text, expected) in [
            ("<net/>", "expected the element `configuration`"),
            ("<configuration>\n</configuration>", "expected the element `net-file`"),
            (
                "<configuration>\n<net-file value=\"n\"/>\n<begin value=\"NaN\"/></configuration>",
                "x.sumocfg:3:",
            ),
            (
                "<configuration><net-file value=\"n\"/><step-length value=\"0\"/></configuration>",
                "expected a step",
            ),
            (
                "<configuration><net-file value=\"n\"/><begin value=\"1:1:1:1:1\"/></configuration>",
                "expected a time",
            ),
            ("<configuration>", "too early"),
        ] {
            let message = refused(text);
            assert!(message.contains(expected), "{text}: {message}");
        }
    }
}
