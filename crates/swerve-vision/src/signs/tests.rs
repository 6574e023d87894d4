use super::*;

/// Image of one colour.
fn plain(width: usize, height: usize, rgb: [u8; 3]) -> Vec<u8> {
    rgb.iter().copied().cycle().take(3 * width * height).collect()
}

fn found(width: usize, height: usize, bytes: &[u8]) -> Vec<Sign> {
    let mut found = Vec::new();
    SignFinder::default().find(Rgb::new(width, height, bytes).unwrap(), &mut found);
    found
}

#[test]
fn finder_reports_no_sign_on_other_red_objects() {
    for (width, height) in [(0, 0), (1, 1), (40, 30)] {
        for rgb in [[0; 3], [255; 3], [255, 0, 0], [128; 3]] {
            assert_eq!(found(width, height, &plain(width, height, rgb)), [], "{width} x {height} of {rgb:?}");
        }
    }
    // The side of a red car (a box), a red ball (no text), and an empty ring.
    let mut car = plain(60, 40, [90, 90, 95]);
    let mut ball = car.clone();
    let mut ring = car.clone();
    for k in 0..60 * 40 {
        let (x, y) = (k % 60, k / 60);
        let away = swerve_geom::math::hypot(x as f64 - 30.0, y as f64 - 20.0);
        let red = [180, 20, 25];
        if (10..50).contains(&x) && (5..35).contains(&y) {
            car[3 * k..3 * k + 3].copy_from_slice(&red);
        }
        if away < 15.0 {
            ball[3 * k..3 * k + 3].copy_from_slice(&red);
            ring[3 * k..3 * k + 3].copy_from_slice(if away > 12.0 { &red } else { &[220; 3] });
        }
    }
    // A red brick house with a white window: fills its box like an octagon, but has another shape.
    let mut house = plain(60, 40, [90, 90, 95]);
    for k in 0..60 * 40 {
        let (x, y) = (k % 60, k / 60);
        let half = if y < 12 { 3 * y / 2 } else { 18 };
        if x + half >= 30 && x < 30 + half && y < 38 {
            let is_window = (22..32).contains(&x) && (18..30).contains(&y);
            house[3 * k..3 * k + 3].copy_from_slice(if is_window { &[220; 3] } else { &[180, 20, 25] });
        }
    }
    let mut finder = SignFinder::default();
    for bytes in [&car, &ball, &ring, &house] {
        assert_eq!(found(60, 40, bytes), []);
        finder.find(Rgb::new(60, 40, bytes).unwrap(), &mut Vec::new());
    }
    let again = allocation_counter::measure(|| {
        for bytes in [&car, &ball, &ring] {
            finder.find(Rgb::new(60, 40, bytes).unwrap(), &mut Vec::new());
        }
    });
    assert_eq!(again.count_total, 0);
}

/// Searches random images without a panic.
#[test]
fn finder_accepts_noise() {
    let mut rng = swerve_core::Rng::keyed(1, "noise", &[]);
    for size in [1, 7, 64] {
        let bytes: Vec<u8> = (0..3 * size * size).map(|_| (256.0 * rng.unit()) as u8).collect();
        let _whatever = found(size, size, &bytes);
    }
}
