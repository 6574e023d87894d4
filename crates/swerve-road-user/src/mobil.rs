//! Lane changes by MOBIL, "minimizing overall braking induced by lane changes".
//! Source: Kesting, Treiber and Helbing, "General lane-changing model MOBIL for car-following models", Transportation
//! Research Record 1999 (2007), equations 2 and 3.

/// Parameters of a driver.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Mobil {
    /// Weight of the disadvantages of others, from 0.
    pub politeness: f64,
    /// Advantage below which a change is not worth it, m/s².
    pub threshold_mps2: f64,
    /// Largest deceleration that a change may impose on the new follower, m/s².
    pub safe_mps2: f64,
}

/// Accelerations of a driver and of two followers without and with a change, m/s².
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Accelerations {
    /// Of the driver.
    pub own_mps2: [f64; 2],
    /// Of the follower on the lane that it would change to; zeros without one.
    pub new_follower_mps2: [f64; 2],
    /// Of the follower on its present lane; zeros without one.
    pub old_follower_mps2: [f64; 2],
}

impl Mobil {
    /// Safety criterion: the new follower does not have to brake harder than is safe.
    pub fn is_safe(&self, with: &Accelerations) -> bool {
        with.new_follower_mps2[1] >= -self.safe_mps2
    }

    /// Incentive, m/s²: the advantage of the driver and, weighted, of the two followers, less the threshold. `bias_mps2`
    /// is added for lanes that are to be preferred.
    pub fn incentive_mps2(&self, with: &Accelerations, bias_mps2: f64) -> f64 {
        let gain = |[before, after]: [f64; 2]| after - before;
        let others = gain(with.new_follower_mps2) + gain(with.old_follower_mps2);
        gain(with.own_mps2) + self.politeness * others - self.threshold_mps2 + bias_mps2
    }

    /// True if a change is safe and worth it.
    pub fn changes(&self, with: &Accelerations, bias_mps2: f64) -> bool {
        self.is_safe(with) && self.incentive_mps2(with, bias_mps2) > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVER: Mobil = Mobil { politeness: 0.5, threshold_mps2: 0.1, safe_mps2: 2.0 };

    #[test]
    fn a_change_is_safe_and_worth_it() {
        for (own_mps2, new_follower_mps2, old_follower_mps2, bias_mps2, changes, why) in [
            ([0.0, 0.2], [0.0, 0.0], [0.0, 0.0], 0.0, true, "more than the threshold"),
            ([0.0, 0.1], [0.0, 0.0], [0.0, 0.0], 0.0, false, "the threshold itself"),
            ([0.0, 0.2], [0.0, -0.4], [0.0, 0.0], 0.0, false, "the new follower loses as much, weighted"),
            ([0.0, 0.2], [0.0, -0.4], [0.0, 0.4], 0.0, true, "the old follower gains it back"),
            ([0.0, 0.0], [0.0, 0.0], [-0.3, 0.0], 0.0, true, "the old follower alone gains"),
            ([0.0, 0.0], [0.0, 0.0], [0.0, 0.0], 0.2, true, "the lane is preferred"),
            ([-3.0, 1.0], [0.0, -2.0], [0.0, 0.0], 0.0, true, "the new follower brakes as hard as is safe"),
            ([-3.0, 1.0], [0.0, -2.001], [0.0, 0.0], 9.0, false, "the new follower would brake harder"),
        ] {
            let with = Accelerations { own_mps2, new_follower_mps2, old_follower_mps2 };
            assert_eq!(DRIVER.changes(&with, bias_mps2), changes, "{why}");
        }
    }
}
