//! Localization of the ego: `[localization]`.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{OperatorConfig, Reads};
use crate::named::Name;

/// Localizer name for the simulated or reported pose.
pub(crate) const TRUTH: &str = "truth";

/// Name of a localizer: a built-in one, or one that [`Registry::with_localizer`](crate::Registry::with_localizer) adds.
pub type LocalizerName = Name<BuiltInLocalizer>;

/// Built-in localizers.
#[derive(Clone, PartialEq, Debug, JsonSchema)]
#[schemars(rename = "LocalizerName", rename_all = "snake_case")]
pub enum BuiltInLocalizer {
    /// The simulator, with the errors of `sensing.pose`; for `swerve live` the pose reported by the vehicle.
    Truth,
    /// An error-state Kalman filter over inertial unit, satellite fixes and wheels.
    Eskf,
    /// Matches of lidar sweeps with a map; dead reckoning by wheels and gyroscopes in between.
    Ndt,
    /// The filter with those matches among its measurements.
    EskfNdt,
    /// Lidar odometry from the first satellite fix on, without a map.
    Odometry,
}

/// Poses of the ego by a lidar, which a localizer reads.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LidarPoses {
    /// Matches of sweeps with a map, by an operator `scan_matcher`.
    Matches,
    /// Lidar odometry without a map, by an operator `lidar_odometry`.
    Odometry,
}

impl LidarPoses {
    /// Name of the operator, which is its kind.
    fn name(self) -> &'static str {
        match self {
            Self::Matches => "scan_matcher",
            Self::Odometry => "lidar_odometry",
        }
    }

    /// Operator with its name.
    pub(crate) fn operator(self) -> (String, OperatorConfig) {
        (self.name().to_owned(), of_kind(self.name(), true))
    }
}

/// Operators that a localizer adds to the pipeline, and the inputs that it requires.
#[derive(Clone, Debug)]
pub(crate) struct LocalizerOperators {
    /// Poses by a lidar that it reads.
    pub(crate) lidar: Option<LidarPoses>,
    /// True if it starts from `localization.stored_pose`.
    pub(crate) starts_stored: bool,
    /// Operator that publishes the pose.
    pub(crate) operator: OperatorConfig,
}

impl LocalizerOperators {
    /// Localizer with an operator of this kind, which may have a port for wheel speeds.
    pub(crate) fn new(kind: &str, wheels: bool, lidar: Option<LidarPoses>, starts_stored: bool) -> Self {
        Self { lidar, starts_stored, operator: of_kind(kind, wheels) }
    }
}

/// Port for wheel speeds, which are those of the sensor.
pub(crate) const WHEELS: &str = "wheels";

/// An operator of this kind.
fn of_kind(kind: &str, wheels: bool) -> OperatorConfig {
    let reads = wheels.then(|| (WHEELS.to_owned(), Reads::Stream("odometry".to_owned())));
    OperatorConfig {
        kind: Some(kind.to_owned()),
        reads: reads.into_iter().collect(),
        ..OperatorConfig::default()
    }
}

/// Localization of the ego.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LocalizationConfig {
    /// Localizer. All but `truth` replace `pose` by an operator `localizer`; `[operator.localizer]` sets its sensor
    /// models, `[sensing]` the actual errors. All but `eskf` read a lidar, by an operator `scan_matcher` or
    /// `lidar_odometry` with a run time as for other operators.
    pub localizer: LocalizerName,
    /// Map that lidar sweeps are matched with, from `swerve map build`: a path from the folder of the configuration.
    /// Without one the simulated road is mapped before the drive, without actors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map: Option<PathBuf>,
    /// Standard deviations of a pose stored from the drive before: position (each axis, metres) and heading (degrees).
    /// The filter starts from it instead of the first fix and the lane's heading. A simulated drive draws its errors by
    /// the seed. No stored pose when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stored_pose: Option<[f64; 2]>,
}

impl Default for LocalizationConfig {
    fn default() -> Self {
        Self { localizer: LocalizerName::new(TRUTH), map: None, stored_pose: None }
    }
}

impl LocalizationConfig {
    /// Returns true if the pose is estimated from the ego's own sensors.
    pub fn estimates(&self) -> bool {
        self.localizer.as_str() != TRUTH
    }

    /// Returns true if the localizer replaces the pipeline's own operator of this name.
    pub(crate) fn replaces(&self, operator: &str) -> bool {
        self.estimates() && operator == "pose"
    }
}

#[cfg(test)]
mod tests {
    use crate::Setup;
    use crate::assembly::Assembly;
    use crate::config::tests::config;

    /// Operators by name and kind with their inputs.
    fn graph(config: &Setup) -> Vec<String> {
        let assembly = Assembly::new(config).unwrap();
        let one = |placed: &crate::assembly::Placed| format!("{} {:?}", placed.name, placed.inputs);
        assembly.operators().iter().map(one).collect()
    }

    #[test]
    fn localizer_key_makes_the_graph_of_explicit_operators() {
        let by_key = config("[localization]\nlocalizer = \"eskf\"\n", &[]).unwrap();
        let by_hand = "[operator.localizer]\nkind = \"localizer\"\nreads = { wheels = \"odometry\" }\n\
                       [operator.pose]\nenabled = false\n";
        let by_hand = config(by_hand, &[]).unwrap();
        assert_eq!(graph(&by_key), graph(&by_hand));
        assert!(graph(&by_key).iter().any(|one| one.starts_with("localizer ")));
        let usual = config("[localization]\nlocalizer = \"truth\"\n", &[]).unwrap();
        assert_eq!(graph(&usual), graph(&Setup::default()));
        assert_ne!(graph(&usual), graph(&by_key));
        // Key and explicit operators together make the same graph.
        let both = config(&by_hand.to_text(), &["localization.localizer=eskf"]).unwrap();
        assert_eq!(graph(&both), graph(&by_key));
    }

    #[test]
    fn localizer_keys_apply_without_its_kind() {
        let text =
            "[localization]\nlocalizer = \"eskf\"\n[operator.localizer]\nparams = { lost_sigma_m = 1.0 }\n";
        assert!(config(text, &[]).is_ok());
        let said = config(&text.replace("lost_sigma_m = 1.0", "lost_sigma_m = -1.0"), &[]).unwrap_err();
        assert!(said.contains("operator.localizer.params.lost_sigma_m"), "{said}");
    }

    #[test]
    fn unknown_localizers_are_reported_with_all_names() {
        let said = config("[localization]\nlocalizer = \"ukf\"\n", &[]).unwrap_err();
        assert!(said.starts_with("c.toml:2: localization.localizer: expected "), "{said}");
        assert!(said.contains("\"truth\"") && said.contains("\"eskf\""), "{said}");
        let ros2 = "[ego]\ndriver = \"ros2\"\n[clock]\nsource = \"wall\"\n[gate]\nenabled = true\n";
        assert!(config(ros2, &[]).is_ok());
        let said = config(ros2, &["localization.localizer=eskf"]).unwrap_err();
        assert!(said.contains("localization.localizer: expected \"truth\""), "{said}");
    }
    const ROOF: &str = "[lidar.roof]\npreset = \"vlp_32\"\n";

    #[test]
    fn lidar_localizers_add_their_operators() {
        for (localizer, by, kind) in [
            ("ndt", "scan_matcher", "dead_reckoning"),
            ("eskf_ndt", "scan_matcher", "localizer"),
            ("odometry", "lidar_odometry", "dead_reckoning"),
        ] {
            let set = format!("localization.localizer={localizer}");
            let config = config(ROOF, &[&set]).unwrap();
            let assembly = Assembly::new(&config).unwrap();
            let reads = |name: &str| -> Vec<String> {
                let placed = assembly.operator(name).unwrap();
                let edges = placed.inputs.iter().flat_map(|input| &input.from);
                edges.map(|edge| edge.stream.clone()).collect()
            };
            assert_eq!(assembly.node("localizer").unwrap().kind, kind);
            assert!(reads("localizer").contains(&by.to_owned()), "{:?}", reads("localizer"));
            assert_eq!(reads(by)[0], "roof.points", "{localizer}");
            assert!(!assembly.has("pose") && reads("planner").contains(&"localizer.state".to_owned()));
        }
    }

    #[test]
    fn slowing_deviations_must_be_in_order() {
        assert!(config("", &["planning.slow_by_sigma_m=[0.2, 0.2]"]).is_ok());
        let said = config("", &["planning.lane_sigmas=-1.0"]).unwrap_err();
        assert!(said.contains("planning.lane_sigmas: expected 0 to 10, found -1"), "{said}");
        for (wrong, expected) in [
            ("[0.4, 0.2]", "expected two deviations in order"),
            ("[-1, 2]", "expected 0 to 1000000, found -1"),
            ("[0, nan]", "expected 0 to 1000000, found NaN"),
        ] {
            let said = config("", &[&format!("planning.slow_by_sigma_m={wrong}")]).unwrap_err();
            assert!(said.contains(&format!("planning.slow_by_sigma_m: {expected}")), "{said}");
        }
    }

    #[test]
    fn missing_lidar_is_reported_with_the_key_that_adds_one() {
        let said = config("[localization]\nlocalizer = \"ndt\"\n", &[]).unwrap_err();
        let expected = "operator.scan_matcher.reads.points: reads `PointCloud`, which no operator publishes: `[lidar.NAME]`";
        assert!(said.contains(expected), "{said}");
        let two = format!("{ROOF}[lidar.bumper]\nat_m = [4.0, 0.0, 0.6]\n");
        let said = config(&two, &["localization.localizer=eskf_ndt"]).unwrap_err();
        assert!(said.contains("several streams carry `PointCloud`"), "{said}");
    }

    #[test]
    fn map_is_refused_without_scan_matching() {
        let said = config("[localization]\nmap = \"street.map\"\n", &[]).unwrap_err();
        assert!(
            said.starts_with("c.toml:2: localization.map: is for `localization.localizer = \"ndt\"`"),
            "{said}"
        );
        let text = format!("{ROOF}[localization]\nlocalizer = \"ndt\"\nmap = \"maps/street.map\"\n");
        let map = config(&text, &[]).unwrap().localization.map.clone().unwrap();
        assert!(map.is_absolute() && map.ends_with("maps/street.map"), "{}", map.display());
    }

    #[test]
    fn stored_pose_needs_a_filter_and_a_simulated_car() {
        let eskf = "localization.localizer=\"eskf\"";
        assert!(config("", &[eskf, "localization.stored_pose=[0.3, 0.5]"]).is_ok());
        for (set, why) in [
            (vec!["localization.stored_pose=[0.3, 0.5]"], "is for `localization.localizer = \"eskf\"`"),
            (
                vec![eskf, "localization.stored_pose=[0.0, 0.5]"],
                "expected 0.001 to 10 m and 0.01 to 30 degrees",
            ),
            (vec![eskf, "localization.stored_pose=[0.3, 31.0]"], "found 0.3 and 31"),
        ] {
            let error = config("", &set).unwrap_err();
            assert!(error.contains("localization.stored_pose: ") && error.contains(why), "{error}");
        }
    }
}
