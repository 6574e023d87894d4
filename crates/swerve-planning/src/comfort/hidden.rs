//! Hidden places: less speed beside vehicles that may hide a person, and no overtaking beyond the sight along the other
//! lane.

use super::{BRAKE_SHARE, Comfort};
use crate::following::SpeedTable;
use crate::fot::line::OnLine;
use crate::occlusion::{Cap, Ego, Outline, hidden_place, sight_m};
use crate::request::Request;
use crate::traffic::{Mover, Traffic};

impl Comfort {
    /// The speeds along the line from `place` on, lowered for the hidden places ahead; sets the speed that they allow
    /// now, and the oncoming car that may be beyond the ego's sight.
    pub(super) fn in_sight(
        &mut self,
        request: &Request<'_>,
        place: &OnLine,
        traffic: &mut Traffic,
        speeds: SpeedTable,
    ) -> SpeedTable {
        let Some(params) = self.occlusion else { return speeds };
        let shape = request.shape;
        let ego = Ego {
            s_m: place.s_m,
            d_m: place.d_m,
            front_m: shape.length_m - shape.rear_overhang_m,
            half_width_m: 0.5 * shape.width_m,
        };
        let hides = |one: &&Mover| {
            let extent = traffic.predictions[one.index].extent;
            extent.height_m >= HIDES_M && !one.kind.is_person() && !one.closes(request.route, shape.width_m)
        };
        let (standing, moving): (Vec<&Mover>, Vec<&Mover>) =
            traffic.movers.iter().filter(hides).partition(|one| one.stands());
        let [standing, moving] =
            [standing, moving].map(|all| all.into_iter().map(outline).collect::<Vec<_>>());
        let caps: Vec<Cap> = standing
            .iter()
            .filter_map(|one| Some(params.cap(&hidden_place(one, &ego, &standing)?, &ego)))
            .collect();
        let all: Vec<Outline> = standing.into_iter().chain(moving).collect();
        let border_m = request.route.lane().left_m(place.s_m);
        let beside_m = [border_m + BESIDE_M, border_m + BESIDE_M + CAR_M];
        let ahead_m = sight_m(&all, &ego, 0.5 * (beside_m[0] + beside_m[1]), params.sight_m);
        traffic.unseen = Some(Mover::oncoming(place.s_m + ahead_m, beside_m, request.target_speed_mps));
        let brake_mps2 = BRAKE_SHARE * request.limits.brake_max_mps2;
        let speeds = speeds.capped(&caps, brake_mps2);
        self.sight_mps = speeds.before(place.s_m, request.start.speed_mps.max(0.0));
        speeds
    }
}

/// Outline of a road user now.
fn outline(one: &Mover) -> Outline {
    let now = one.knots[0];
    Outline { along_m: [now.from_m, now.to_m], beside_m: [now.right_m, now.left_m] }
}

/// Lowest vehicle that hides a person, metres: a child is about as high.
const HIDES_M: f64 = 1.2;

/// Width of an oncoming car that is not seen, and its distance from the line of the ego's lane, metres.
const CAR_M: f64 = 1.8;
const BESIDE_M: f64 = 0.6;
