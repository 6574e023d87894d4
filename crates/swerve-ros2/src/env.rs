//! Network settings from environment variables, which the transport does not read itself.

use serde::{Deserialize, Serialize};
use std::net::{IpAddr, Ipv4Addr};

/// Highest domain whose ports are below the ephemeral ports in DDS's port formula.
const DOMAIN_MAX: u16 = 232;

/// Network settings of discovery.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Network {
    /// ROS domain; participants of other domains are invisible.
    pub domain: u16,
    /// True to use only the loopback interface.
    pub localhost_only: bool,
}

/// An environment variable with an invalid value.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the environment variable {variable} is `{value}`; {expected}")]
pub struct EnvError {
    /// Name of the variable.
    pub variable: &'static str,
    /// Its value.
    pub value: String,
    /// Accepted values.
    pub expected: &'static str,
}

impl Network {
    /// Reads `ROS_DOMAIN_ID`, `ROS_LOCALHOST_ONLY` and `ROS_AUTOMATIC_DISCOVERY_RANGE` through `get`.
    ///
    /// # Errors
    /// If a variable has a value that ROS does not accept.
    pub fn from_variables(get: impl Fn(&str) -> Option<String>) -> Result<Self, EnvError> {
        let set = |variable| get(variable).filter(|value| !value.is_empty());
        let mut network = Self::default();
        if let Some(value) = set("ROS_DOMAIN_ID") {
            let domain = value.parse::<u16>().ok().filter(|domain| *domain <= DOMAIN_MAX);
            let expected = "a number from 0 to 232 was expected";
            network.domain = domain.ok_or(EnvError { variable: "ROS_DOMAIN_ID", value, expected })?;
        }
        if let Some(value) = set("ROS_AUTOMATIC_DISCOVERY_RANGE") {
            network.localhost_only = match value.as_str() {
                "LOCALHOST" => true,
                "SUBNET" | "SYSTEM_DEFAULT" => false,
                _ => {
                    let variable = "ROS_AUTOMATIC_DISCOVERY_RANGE";
                    return Err(EnvError { variable, value, expected: "LOCALHOST or SUBNET was expected" });
                }
            };
        }
        // The older variable takes precedence, as in ROS.
        if let Some(value) = set("ROS_LOCALHOST_ONLY") {
            network.localhost_only = match value.as_str() {
                "0" => network.localhost_only,
                "1" => true,
                _ => {
                    let variable = "ROS_LOCALHOST_ONLY";
                    return Err(EnvError { variable, value, expected: "0 or 1 was expected" });
                }
            };
        }
        Ok(network)
    }

    /// Addresses to use; `None` for all.
    pub(crate) fn addresses(self) -> Option<[IpAddr; 1]> {
        self.localhost_only.then_some([IpAddr::V4(Ipv4Addr::LOCALHOST)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(variables: &[(&str, &str)], wanted: Result<(u16, bool), &str>) {
        let get = |name: &str| variables.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_owned());
        let found =
            Network::from_variables(get).map(|n| (n.domain, n.localhost_only)).map_err(|e| e.to_string());
        assert_eq!(found, wanted.map_err(str::to_owned), "{variables:?}");
    }

    #[test]
    fn network_reads_environment_variables_as_ros_does() {
        check(&[], Ok((0, false)));
        check(&[("ROS_DOMAIN_ID", "42"), ("ROS_LOCALHOST_ONLY", "1")], Ok((42, true)));
        check(&[("ROS_DOMAIN_ID", ""), ("ROS_LOCALHOST_ONLY", "0")], Ok((0, false)));
        check(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")], Ok((0, true)));
        check(
            &[("ROS_DOMAIN_ID", "300")],
            Err("the environment variable ROS_DOMAIN_ID is `300`; a number from 0 to 232 was expected"),
        );
        check(
            &[("ROS_LOCALHOST_ONLY", "yes")],
            Err("the environment variable ROS_LOCALHOST_ONLY is `yes`; 0 or 1 was expected"),
        );
    }
}
