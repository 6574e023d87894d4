//! State that a drive leaves with the transport process, which stops the vehicle if the program dies.

use serde::{Deserialize, Serialize};
use swerve_control::safety_gate::GateParams;
use swerve_msg::GateOutput;

/// State of a drive that is needed to stop it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Legacy {
    /// Last command.
    pub last: GateOutput,
    /// Parameters of the stop.
    pub stop: GateParams,
}
