use core::f64::consts::FRAC_PI_2;

use super::*;

/// A road of 40 m straight ahead and a quarter of a circle to the left with a radius of 20 m, with patches on it.
fn on_a_bend(patches: &str) -> Scenario {
    let text = format!(
        "name = \"bend\"\nego = {{ target_speed_mps = 5.0, end_m = 60.0 }}\n{patches}\n[road]\n\
         segments = [{{ length_m = 40.0 }}, {{ length_m = {}, curvature_1pm = 0.05 }}]\nlane_width_m = 3.0\n",
        20.0 * FRAC_PI_2
    );
    Scenario::parse("bend.toml", &text).unwrap_or_else(|problems| panic!("{problems:#?}"))
}

fn patch(name: &str, keys: &str) -> String {
    format!("[[slippery]]\nname = \"{name}\"\n{keys}\n")
}

/// Point at a distance from the centre of the bend, after a turn by an angle.
fn on_circle(radius_m: f64, turn_rad: f64) -> Point2 {
    let (sin, cos) = swerve_geom::math::sin_cos(turn_rad);
    Point2::new(40.0 + radius_m * sin, 20.0 - radius_m * cos)
}

#[test]
fn patch_covers_its_length_and_width_and_nothing_beside() {
    let scenario =
        on_a_bend(&patch("ice", "friction = 0.2\ns_m = 10.0\nlength_m = 5.0\nd_m = 0.5\nwidth_m = 2.0"));
    for (x_m, y_m, wanted) in [
        (10.01, 0.5, Some(0.2)),
        (14.99, 0.5, Some(0.2)),
        (9.99, 0.5, None),
        (15.01, 0.5, None),
        (12.0, 1.49, Some(0.2)),
        (12.0, -0.49, Some(0.2)),
        (12.0, 1.51, None),
        (12.0, -0.51, None),
    ] {
        assert_eq!(scenario.slippery_at(Point2::new(x_m, y_m)), wanted, "at {x_m}, {y_m}");
    }
}

/// The patch begins 10 m before the bend and ends after 45° of it. It is as wide as the lane.
#[test]
fn patch_follows_the_bend_of_its_lane() {
    let keys = format!("friction = 0.2\ns_m = 30.0\nlength_m = {}", 10.0 + 10.0 * FRAC_PI_2);
    let scenario = on_a_bend(&patch("ice", &keys));
    assert_eq!(scenario.slippery[0].width_m, 3.0, "that of the lane");
    for turn_deg in [5.0_f64, 20.0, 44.0] {
        for (radius_m, wanted) in [(18.4, None), (18.6, Some(0.2)), (21.4, Some(0.2)), (21.6, None)] {
            let at = on_circle(radius_m, turn_deg.to_radians());
            assert_eq!(scenario.slippery_at(at), wanted, "{radius_m} m from the centre, {turn_deg} deg");
        }
    }
    for (turn_deg, wanted) in [(43.5_f64, Some(0.2)), (46.5, None), (60.0, None)] {
        let at = on_circle(20.0, turn_deg.to_radians());
        assert_eq!(scenario.slippery_at(at), wanted, "{turn_deg} deg");
    }
    assert_eq!(scenario.slippery_at(Point2::new(50.0, 0.0)), None, "straight on from the begin");
}

/// The outline of a patch on a bend is a sector of a ring: its area is length times width about the middle radius.
#[test]
fn outline_encloses_the_area_of_the_patch() {
    let keys = format!("friction = 0.2\ns_m = 40.0\nlength_m = {}\nd_m = 1.0", 10.0 * FRAC_PI_2);
    let scenario = on_a_bend(&patch("ice", &keys));
    let corners = scenario.slippery[0].outline();
    let pairs = corners.iter().zip(corners.iter().cycle().skip(1));
    let area_m2: f64 = pairs.map(|(a, b)| 0.5 * (a.x_m * b.y_m - b.x_m * a.y_m)).sum();
    let wanted_m2 = 0.5 * (20.5_f64.powi(2) - 17.5_f64.powi(2)) * 0.5 * FRAC_PI_2;
    assert!((area_m2 / wanted_m2 - 1.0).abs() < 0.01, "{area_m2} m², expected {wanted_m2} m²");
}

#[test]
fn lowest_friction_counts_where_patches_overlap() {
    let [wet, ice] = [(0.5, 10.0), (0.1, 14.0)].map(|(friction, s_m)| {
        patch(&format!("at_{s_m}"), &format!("friction = {friction}\ns_m = {s_m:?}\nlength_m = 10.0"))
    });
    for patches in [wet.clone() + &ice, ice + &wet] {
        let scenario = on_a_bend(&patches);
        let at = |x_m: f64| scenario.slippery_at(Point2::new(x_m, 0.0));
        assert_eq!([at(12.0), at(18.0), at(22.0), at(25.0)], [Some(0.5), Some(0.1), Some(0.1), None]);
    }
}
