//! Places that the ego cannot see: where a person may step out from behind a standing vehicle, and where an oncoming car
//! may be.
//!
//! Set-based predictions of road users that may exist in hidden places (Orzechowski, Meyer and Lauer, "Tackling
//! occlusions & limited sensor range with set-based safety verification", ITSC 2018; Koschi and Althoff, "Set-based
//! prediction of traffic participants considering occlusions and traffic rules", IEEE T-IV 2021), restricted to the
//! nearest hidden place behind each vehicle and to the first one in the other lane. All positions are arc lengths and
//! offsets along a line, in which rays of sight are taken as straight.

/// Road users that may be in hidden places, and the ego's answer to them.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Params {
    /// Speed of a person who steps out, m/s.
    pub phantom_speed_mps: f64,
    /// Time from the first sight of a person until the ego brakes, seconds.
    pub reaction_s: f64,
    /// Deceleration of that stop, m/s².
    pub brake_mps2: f64,
    /// The ego is not slowed below this speed, m/s.
    pub least_speed_mps: f64,
    /// Range of sight along the road, metres.
    pub sight_m: f64,
}

/// Outline of a road user along the line: rear and front, right and left side, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Outline {
    pub(crate) along_m: [f64; 2],
    pub(crate) beside_m: [f64; 2],
}

/// The ego along the line; its eye is at its origin.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Ego {
    pub(crate) s_m: f64,
    pub(crate) d_m: f64,
    /// Distance from the origin to the front, metres.
    pub(crate) front_m: f64,
    pub(crate) half_width_m: f64,
}

/// A person who may stand just beyond a vehicle, at the edge of what the ego sees.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct HiddenPlace {
    /// Rear edge of the person along the line, metres: the far edge of the vehicle.
    pub(crate) s_m: f64,
    /// Distance to the side of the ego, metres; 0 in its way.
    pub(crate) aside_m: f64,
}

/// A speed limit on a stretch of the line, for the ego's origin.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Cap {
    pub(crate) along_m: [f64; 2],
    pub(crate) speed_mps: f64,
}

/// Width of a person, metres.
const PERSON_M: f64 = 0.5;

/// Step along the other lane in the search for its first hidden place, metres.
const LOOK_M: f64 = 2.0;

/// The nearest place beyond a vehicle that hides a person from the ego; `None` if the ego sees behind the vehicle, or
/// if one of `others` stands there.
pub(crate) fn hidden_place(vehicle: &Outline, ego: &Ego, others: &[Outline]) -> Option<HiddenPlace> {
    let [_, far_m] = vehicle.along_m;
    let ahead_m = far_m - ego.s_m;
    if ahead_m <= 0.0 {
        return None;
    }
    let [right_m, left_m] = vehicle.beside_m;
    let is_left = right_m + left_m > 2.0 * ego.d_m;
    let side = if is_left { 1.0 } else { -1.0 };
    let edge_m = if is_left { right_m } else { left_m };
    // The ray from the eye past the corner, at the middle of the person.
    let shadow_m = edge_m + (edge_m - ego.d_m) * (0.5 * PERSON_M / ahead_m);
    let center_m = shadow_m + side * 0.5 * PERSON_M;
    let stands_there = |other: &Outline| {
        let overlaps = |[from_m, to_m]: [f64; 2], [low_m, high_m]: [f64; 2]| from_m < high_m && to_m > low_m;
        let half_m = 0.5 * PERSON_M;
        overlaps(other.along_m, [far_m, far_m + PERSON_M])
            && overlaps(other.beside_m, [center_m - half_m, center_m + half_m])
    };
    if left_m - right_m < PERSON_M || others.iter().any(stands_there) {
        return None;
    }
    Some(HiddenPlace { s_m: far_m, aside_m: (side * (shadow_m - ego.d_m) - ego.half_width_m).max(0.0) })
}

impl Params {
    /// Speed at which the ego answers a person who steps out of a hidden place: it stops before the person, or is there
    /// before the person reaches its side.
    ///
    /// An ego that is nearer than its stopping distance `v t + v² / 2b` when the person comes into sight cannot stop;
    /// it is there first if that distance takes no longer than the person's way to its side.
    pub(crate) fn speed_mps(&self, place: &HiddenPlace) -> f64 {
        let enters_s = place.aside_m / self.phantom_speed_mps;
        (2.0 * self.brake_mps2 * (enters_s - self.reaction_s)).max(self.least_speed_mps)
    }

    /// Speed limit for a hidden place: from the stopping distance before it until the front is past it.
    pub(crate) fn cap(&self, place: &HiddenPlace, ego: &Ego) -> Cap {
        let v = self.speed_mps(place);
        let stop_m = v * self.reaction_s + v * v / (2.0 * self.brake_mps2);
        let at_m = place.s_m - ego.front_m;
        Cap { along_m: [at_m - stop_m, at_m + PERSON_M], speed_mps: v }
    }
}

/// Distance from the ego's origin to the first place at the offset `at_d_m` ahead of it that a vehicle hides, metres; at
/// most `most_m`.
pub(crate) fn sight_m(vehicles: &[Outline], ego: &Ego, at_d_m: f64, most_m: f64) -> f64 {
    let steps = (most_m / LOOK_M).floor() as usize;
    let is_hidden = |ahead_m: &f64| vehicles.iter().any(|one| hides(one, ego, [*ahead_m, at_d_m]));
    (1..=steps).map(|k| k as f64 * LOOK_M).find(is_hidden).unwrap_or(most_m)
}

/// Returns true if a vehicle is in the way of the ray from the eye to a place `ahead_m` of it at an offset.
fn hides(one: &Outline, ego: &Ego, [ahead_m, at_d_m]: [f64; 2]) -> bool {
    let [from_m, to_m] = [(one.along_m[0] - ego.s_m).max(0.0), (one.along_m[1] - ego.s_m).min(ahead_m)];
    let ray_m = |at_m: f64| ego.d_m + (at_d_m - ego.d_m) * at_m / ahead_m;
    let (a, b) = (ray_m(from_m), ray_m(to_m));
    from_m < to_m && a.max(b) > one.beside_m[0] && a.min(b) < one.beside_m[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    const EGO: Ego = Ego { s_m: 0.0, d_m: 0.0, front_m: 4.0, half_width_m: 1.0 };
    const PARAMS: Params = Params {
        phantom_speed_mps: 2.0,
        reaction_s: 0.5,
        brake_mps2: 6.0,
        least_speed_mps: 3.0,
        sight_m: 100.0,
    };

    fn outline(along_m: [f64; 2], beside_m: [f64; 2]) -> Outline {
        Outline { along_m, beside_m }
    }

    /// A truck from 20 to 25 m, 2 m to 4.5 m to the right: the ray past its far left corner, 25 m ahead and 2 m aside,
    /// is 2.02 m aside a quarter of a metre further on. Half of the ego's width is 1 m: 1.02 m are left.
    #[test]
    fn shadow_begins_at_the_far_corner_on_the_side_of_the_lane() {
        let right = outline([20.0, 25.0], [-4.5, -2.0]);
        let place = hidden_place(&right, &EGO, &[]).unwrap();
        assert!(place.s_m == 25.0 && (place.aside_m - 1.02).abs() < 1e-12, "{place:?}");
        let left = outline([20.0, 25.0], [2.0, 4.5]);
        assert_eq!(hidden_place(&left, &EGO, &[]), Some(place));
        // From half a metre before the corner, the ray is 1 m further aside a quarter of a metre beyond it.
        let near = Ego { s_m: 24.5, ..EGO };
        let place = hidden_place(&right, &near, &[]).unwrap();
        assert!((place.aside_m - 2.0).abs() < 1e-12, "{place:?}");
        assert_eq!(hidden_place(&right, &Ego { s_m: 25.0, ..EGO }, &[]), None);
    }

    #[test]
    fn gap_narrower_than_a_person_hides_nobody() {
        let [first, second] = [20.0, 25.4].map(|from_m| outline([from_m, from_m + 5.0], [-4.5, -2.0]));
        assert_eq!(hidden_place(&first, &EGO, &[second]), None);
        assert!(hidden_place(&first, &EGO, &[outline([25.5, 30.5], [-4.5, -2.0])]).is_some());
        assert!(hidden_place(&second, &EGO, &[first]).is_some());
        assert_eq!(hidden_place(&outline([20.0, 25.0], [-2.3, -2.0]), &EGO, &[]), None);
    }

    /// At 2 m/s a person needs 1.2 s for 2.4 m. At 8.4 m/s the ego needs 4.2 + 5.88 = 10.08 m to stop, which it drives in
    /// 1.2 s.
    #[test]
    fn speed_is_the_largest_at_which_the_stopping_distance_takes_as_long_as_the_person() {
        let place = HiddenPlace { s_m: 50.0, aside_m: 2.4 };
        let v = PARAMS.speed_mps(&place);
        assert!((v - 8.4).abs() < 1e-9, "{v}");
        let Cap { along_m: [from_m, to_m], speed_mps } = PARAMS.cap(&place, &EGO);
        assert!((from_m - (46.0 - 10.08)).abs() < 1e-9 && to_m == 46.5 && speed_mps == v);
        let near = HiddenPlace { aside_m: 1.0, ..place };
        assert_eq!(PARAMS.speed_mps(&near), 3.0);
    }

    /// Behind a truck 1.25 m to its left, 20 m ahead of the eye, the ray past its corner is 3.5 m aside after 56 m; from
    /// an eye 1 m to the left it is 3.5 m aside after 20 * 2.5 / 0.25 = 200 m.
    #[test]
    fn sight_along_the_other_lane_ends_at_the_shadow_of_the_vehicle_ahead() {
        let truck = outline([20.0, 28.0], [-1.25, 1.25]);
        assert_eq!(sight_m(&[], &EGO, 3.5, 100.0), 100.0);
        assert_eq!(sight_m(&[truck], &EGO, 3.5, 100.0), 58.0);
        assert_eq!(sight_m(&[truck], &Ego { d_m: 1.0, ..EGO }, 3.5, 100.0), 100.0);
        // Behind the ego it hides nothing, and a car in the other lane hides the lane beyond its rear.
        assert_eq!(sight_m(&[truck], &Ego { s_m: 30.0, ..EGO }, 3.5, 100.0), 100.0);
        assert_eq!(sight_m(&[outline([41.0, 46.0], [2.6, 4.4])], &EGO, 3.5, 100.0), 42.0);
    }
}
