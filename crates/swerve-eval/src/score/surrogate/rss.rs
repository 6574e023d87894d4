//! Safe distances of the responsibility-sensitive safety model.
//!
//! Source: Shalev-Shwartz, Shammah, Shashua, "On a formal model of safe and scalable self-driving cars" (2017),
//! definitions 1, 2 and 6 (arXiv 1708.06374).

/// Parameters of the model.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RssParams {
    /// Response time, seconds.
    pub response_s: f64,
    /// Maximum acceleration during the response, m/s².
    pub accel_mps2: f64,
    /// Deceleration with which the rear vehicle brakes at least, m/s².
    pub brake_min_mps2: f64,
    /// Deceleration with which the front vehicle brakes at most, m/s².
    pub brake_max_mps2: f64,
    /// Deceleration of a vehicle in its own lane against oncoming traffic, m/s².
    pub brake_correct_mps2: f64,
    /// Maximum lateral acceleration during the response, m/s².
    pub lat_accel_mps2: f64,
    /// Minimum lateral deceleration after it, m/s².
    pub lat_brake_mps2: f64,
    /// Lateral distance that remains, metres.
    pub margin_m: f64,
}

impl RssParams {
    /// Values of the UN R157 comparison of driver models: `ec-jrc/JRC-FSM` (01b05c2), `utility/vehicle.py`; esmini's
    /// `ControllerALKS_R157SM` has the same. It has no oncoming traffic: the deceleration against it is that of braking.
    pub const R157: Self = Self {
        response_s: 0.75,
        accel_mps2: 3.0,
        brake_min_mps2: 6.0,
        brake_max_mps2: 6.0,
        brake_correct_mps2: 6.0,
        lat_accel_mps2: 1.0,
        lat_brake_mps2: 1.0,
        margin_m: 0.3,
    };

    /// Safe distance to a vehicle ahead in the same direction, metres: the rear vehicle accelerates during the response
    /// and then brakes with its minimum, the front vehicle brakes with its maximum at once.
    pub fn longitudinal_m(&self, rear_mps: f64, front_mps: f64) -> f64 {
        let stop_m = self.response_m(rear_mps, self.brake_min_mps2);
        (stop_m - front_mps * front_mps / (2.0 * self.brake_max_mps2)).max(0.0)
    }

    /// Safe distance to oncoming traffic, metres, from the magnitudes of the speeds: of the vehicle in its own lane and
    /// of the other one, both positive.
    pub fn oncoming_m(&self, own_mps: f64, other_mps: f64) -> f64 {
        self.response_m(own_mps, self.brake_correct_mps2) + self.response_m(other_mps, self.brake_min_mps2)
    }

    /// Safe lateral distance, metres, from the lateral speeds towards each other: both accelerate towards each other
    /// during the response and then brake.
    pub fn lateral_m(&self, one_mps: f64, other_mps: f64) -> f64 {
        self.margin_m + (self.lateral_way_m(one_mps) + self.lateral_way_m(other_mps)).max(0.0)
    }

    /// Safe lateral distance as in the UN R157 comparison, metres: only the vehicle that cuts in moves sideways, with
    /// the magnitude of its lateral speed.
    pub fn lateral_to_cut_in_m(&self, cut_in_mps: f64) -> f64 {
        self.margin_m + self.lateral_way_m(cut_in_mps.abs())
    }

    /// Way of a vehicle until it stands, metres.
    fn response_m(&self, speed_mps: f64, brake_mps2: f64) -> f64 {
        let faster_mps = speed_mps + self.response_s * self.accel_mps2;
        0.5 * (speed_mps + faster_mps) * self.response_s + faster_mps * faster_mps / (2.0 * brake_mps2)
    }

    /// Way towards the other one until the lateral speed is zero, metres; negative if it goes away all the time.
    fn lateral_way_m(&self, towards_mps: f64) -> f64 {
        let faster_mps = towards_mps + self.response_s * self.lat_accel_mps2;
        0.5 * (towards_mps + faster_mps) * self.response_s
            + faster_mps * faster_mps.abs() / (2.0 * self.lat_brake_mps2)
    }
}

/// Gap between two road users, and their speeds along and across the lane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RssGap {
    /// Longitudinal gap between the outlines, metres; negative if they overlap along the lane.
    pub lon_m: f64,
    /// Lateral gap between the outlines, metres; negative if they overlap across the lane.
    pub lat_m: f64,
    /// Speed along the lane of the rear one, m/s.
    pub rear_mps: f64,
    /// Speed along the lane of the front one, m/s.
    pub front_mps: f64,
    /// Lateral speeds towards each other, m/s.
    pub towards_mps: [f64; 2],
}

impl RssGap {
    /// Returns true if the situation is dangerous: both distances are below the safe ones.
    pub fn is_dangerous(&self, params: &RssParams) -> bool {
        let [one_mps, other_mps] = self.towards_mps;
        self.lon_m < params.longitudinal_m(self.rear_mps, self.front_mps)
            && self.lat_m < params.lateral_m(one_mps, other_mps)
    }
}
