//! Range checks of controller parameters.

use swerve_core::param::{ParamError, Ranges, require};

use crate::{Law, Params};

/// Longest horizon, in steps; beyond it a program takes far longer than a control period.
const HORIZON_MAX: usize = 200;

impl Params {
    /// Checks that all parameters are in range; returns the first that is not.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()?;
        let Self { pure_pursuit, mpc, .. } = self;
        let (reach, least) = (pure_pursuit.lookahead_max_m, pure_pursuit.lookahead_min_m);
        require("pure_pursuit.lookahead_max_m", reach, reach >= least, "at least lookahead_min_m")?;
        let fits = self.law != Law::Mpc || (1..=HORIZON_MAX).contains(&mpc.horizon);
        require("mpc.horizon", mpc.horizon, fits, "1 to 200")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_presets_are_in_range() {
        assert_eq!(Params::default().validate(), Ok(()));
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let check = |spoil: fn(&mut Params), want: &str| {
            let mut params = Params { law: Law::Mpc, ..Params::default() };
            spoil(&mut params);
            assert_eq!(params.validate().unwrap_err().to_string(), want);
        };
        check(|p| p.mpc.horizon = 0, "`mpc.horizon` is 0, expected 1 to 200");
        check(|p| p.mpc.dt_s = f64::NAN, "`mpc.dt_s` is NaN, expected 0.01 to 1");
        check(|p| p.pid.kp_spm = -1.0, "`pid.kp_spm` is -1, expected 0 to 1000");
        check(|p| p.stop.blind_after_s = 0.0, "`stop.blind_after_s` is 0, expected 0.001 to 60");
        check(
            |p| p.pure_pursuit.lookahead_max_m = 1.0,
            "`pure_pursuit.lookahead_max_m` is 1, expected at least lookahead_min_m",
        );
    }
}
