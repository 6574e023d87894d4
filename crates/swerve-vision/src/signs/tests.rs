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

/// Digits and letters of a 5 x 7 matrix, not those of the reader's drawings.
fn matrix(letter: char) -> [u8; 7] {
    match letter {
        '0' => [0x0E, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0E],
        '2' => [0x0E, 0x11, 0x01, 0x02, 0x04, 0x08, 0x1F],
        '3' => [0x0E, 0x11, 0x01, 0x06, 0x01, 0x11, 0x0E],
        '5' => [0x1F, 0x10, 0x1E, 0x01, 0x01, 0x11, 0x0E],
        '7' => [0x1F, 0x01, 0x02, 0x04, 0x04, 0x04, 0x04],
        '8' => [0x0E, 0x11, 0x11, 0x0E, 0x11, 0x11, 0x0E],
        'S' => [0x0F, 0x10, 0x10, 0x0E, 0x01, 0x01, 0x1E],
        'T' => [0x1F, 0x04, 0x04, 0x04, 0x04, 0x04, 0x04],
        'P' => [0x1E, 0x11, 0x11, 0x1E, 0x10, 0x10, 0x10],
        _ => [0; 7],
    }
}

/// Returns true if a text in a box of this half size around the centre has ink at a point.
fn is_ink(text: &str, [x, y]: [f64; 2], [half_width, half_height]: [f64; 2]) -> bool {
    let columns = 6.0 * text.len() as f64 - 1.0;
    let [u, v] = [(x / half_width + 1.0) * 0.5 * columns, (y / half_height + 1.0) * 3.5];
    if u < 0.0 || u >= columns || !(0.0..7.0).contains(&v) {
        return false;
    }
    let letter = text.chars().nth(u as usize / 6).map(|letter| if letter == 'O' { '0' } else { letter });
    letter.is_some_and(|letter| {
        u as usize % 6 < 5 && matrix(letter)[v as usize] >> (4 - u as usize % 6) & 1 == 1
    })
}

/// Colour of a sign at a point, in radii from its centre; `None` beside it.
fn painted(sign: &str, [x, y]: [f64; 2], ring: f64) -> Option<[f64; 3]> {
    let (red, white, black) = ([185.0, 25.0, 35.0], [235.0, 235.0, 230.0], [18.0; 3]);
    let away = swerve_geom::math::hypot(x, y);
    match sign {
        "STOP" => {
            let out = x.abs().max(y.abs()).max((x.abs() + y.abs()) * core::f64::consts::FRAC_1_SQRT_2);
            let is_white = out > 0.96 || is_ink("STOP", [x, y], [0.74, 0.34]);
            (out < 1.0).then_some(if is_white { white } else { red })
        }
        "no entry" => {
            let is_white = away > 0.96 || (x.abs() < 0.74 && y.abs() < 0.2);
            (away < 1.0).then_some(if is_white { white } else { red })
        }
        "no overtaking" => {
            let is_car = (0.1..0.6).contains(&x.abs()) && y.abs() < 0.2;
            let inside = if is_car { if x < 0.0 { red } else { black } } else { white };
            (away < 1.0).then_some(if away > 1.0 - ring { red } else { inside })
        }
        "red lamp" => {
            let glow = (1.0 - away).max(0.0);
            (away < 1.0).then_some([250.0, 60.0 + 195.0 * glow, 60.0 + 180.0 * glow])
        }
        number => {
            let inside = if is_ink(number, [x, y], [0.56, 0.42]) { black } else { white };
            (away < 1.0).then_some(if away > 1.0 - ring { red } else { inside })
        }
    }
}

/// Images of a drawn sign, turned, seen from the side, blurred and noisy, in several sizes and lights.
fn drawn(sign: &str, case: i64) -> (usize, Vec<u8>) {
    let mut rng = swerve_core::Rng::keyed(3, sign, &[case]);
    let size = [20.0, 28.0, 40.0, 64.0, 100.0][case as usize % 5];
    let side = (2.0 * size) as usize;
    let (sin, cos) = swerve_geom::math::sin_cos(rng.uniform(-0.07, 0.07));
    let (narrow, ring, light) = (rng.uniform(0.8, 1.0), rng.uniform(0.16, 0.26), rng.uniform(0.5, 1.05));
    let middle = [0, 1].map(|_| size + rng.uniform(-0.1, 0.1) * size);
    let slope = rng.uniform(-0.5, 0.5);
    let mut bytes = Vec::new();
    for k in 0..side * side {
        let mut sum = [0.0; 3];
        // Nine looks within 1.5 pixels: the blur of a lens.
        for look in 0..9 {
            let at = [k % side, k / side].map(|at| at as f64 + 0.5);
            let at = [
                at[0] + 0.5 * (look % 3) as f64 - 0.5 - middle[0],
                at[1] + 0.5 * (look / 3) as f64 - 0.5 - middle[1],
            ];
            let [x, y] =
                [(at[0] * cos + at[1] * sin) / narrow, at[1] * cos - at[0] * sin].map(|at| 2.0 * at / size);
            let ground = [110.0, 120.0, 105.0].map(|level| level + slope * at[0]);
            let colour = painted(sign, [x, y], ring).unwrap_or(ground);
            sum = [0, 1, 2].map(|c| sum[c] + colour[c] * light / 9.0);
        }
        bytes.extend(sum.map(|level| (level + 4.0 * rng.normal()).clamp(0.0, 255.0) as u8));
    }
    (side, bytes)
}

#[test]
fn finder_reads_drawn_signs_and_rejects_others() {
    const CASES: i64 = 40;
    for (sign, meaning, floor) in [
        ("STOP", Some(Meaning::Stop), 0.9),
        ("no entry", Some(Meaning::NoEntry), 0.95),
        ("20", Some(Meaning::SpeedLimit(20)), 0.95),
        ("30", Some(Meaning::SpeedLimit(30)), 0.95),
        ("50", Some(Meaning::SpeedLimit(50)), 0.95),
        ("80", Some(Meaning::SpeedLimit(80)), 0.95),
        ("no overtaking", None, 0.0),
        ("red lamp", None, 0.0),
    ] {
        let (mut right, mut wrong) = (0, 0);
        for case in 0..CASES {
            let (side, bytes) = drawn(sign, case);
            for one in found(side, side, &bytes) {
                let is_right = Some(one.meaning) == meaning;
                right += u32::from(is_right);
                wrong += u32::from(!is_right);
            }
        }
        let share = f64::from(right) / CASES as f64;
        println!("floor: signs, drawn {sign:?}, read: {share:.3} >= {floor}; {wrong} wrong");
        assert!(share >= floor && wrong <= 1, "{sign}: {share} right, {wrong} wrong");
    }
}
