use super::*;

#[test]
fn rows_become_tracks_and_gaps_end_windows() {
    let mut text = String::new();
    for frame in (0..120).step_by(10).filter(|frame| *frame != 60) {
        text += &format!("{frame}.0\t1.0\t{}\t2.5\n{frame} 7 0 {}\n\n", 0.1 * f64::from(frame), frame);
    }
    let recording = eth_ucy(&text).unwrap();
    assert_eq!(recording.tracks.iter().map(|track| track.id.0).collect::<Vec<_>>(), [1, 7]);
    // Steps 0 to 5 and 7 to 11.
    let scenes = recording.scenes(&Protocol::whole(3, 2));
    let at: Vec<i64> = scenes.iter().map(|scene| scene.tracks.stamp.ns() / 400_000_000).collect();
    assert_eq!(at, [2, 3, 9]);
    let scene = &scenes[2];
    let first = &scene.tracks.tracks[0];
    assert_eq!((first.history.len(), first.history[0].at), (3, Time::from_ms(2800)));
    assert!((first.velocity_mps.x - 2.5).abs() < 1e-9);
    assert_eq!(scene.windows[0].truth, [Point2::new(10.0, 2.5), Point2::new(11.0, 2.5)]);
    // Shorter windows too, never across the gap; starts at every third sighting; at least three actors at once.
    let short = Protocol { predict: 9, predict_min: 1, ..Protocol::whole(3, 2) };
    let lengths: Vec<usize> =
        recording.scenes(&short).iter().map(|scene| scene.windows[0].truth.len()).collect();
    assert_eq!(lengths, [3, 2, 1, 2, 1]);
    assert_eq!(recording.scenes(&Protocol { stride: 3, ..Protocol::whole(3, 2) }).len(), 2);
    assert!(recording.scenes(&Protocol { actors_min: 3, ..Protocol::whole(3, 2) }).is_empty());
}

#[test]
fn recordings_are_played_faster_slower_and_backwards() {
    let text: String = (0..8).filter(|k| *k != 5).map(|k| format!("{} 1 {} 0\n", 10 * k, k * k)).collect();
    let recording = eth_ucy(&text).unwrap();
    let played = |speed: f64| {
        let samples = recording.played(speed).tracks.remove(0).samples;
        samples.into_iter().map(|(step, place)| (step, place.x_m)).collect::<Vec<_>>()
    };
    assert_eq!(recording.played(1.0), recording);
    // Step 5 is missing: there is nothing between 4 and 6.
    assert_eq!(played(2.0), [(0, 0.0), (1, 4.0), (2, 16.0), (3, 36.0)]);
    assert_eq!(played(1.5), [(0, 0.0), (1, 2.5), (2, 9.0), (4, 36.0)]);
    assert_eq!(played(0.5)[..3], [(0, 0.0), (1, 0.5), (2, 1.0)]);
    assert_eq!(played(-1.0), [(-7, 49.0), (-6, 36.0), (-4, 16.0), (-3, 9.0), (-2, 4.0), (-1, 1.0), (0, 0.0)]);
    assert!(recording.played(100.0).tracks[0].samples.len() == 1, "the first alone");
}

#[test]
fn actor_at_rest_keeps_the_heading_of_its_last_motion() {
    let x_m = |step: i32| -f64::from(step.min(4));
    let text: String = (0..9).map(|k| format!("{} 1 {} 0\n", 10 * k, x_m(k))).collect();
    let scenes = eth_ucy(&text).unwrap().scenes(&Protocol::whole(2, 1));
    let last = &scenes[scenes.len() - 1].tracks.tracks[0];
    assert_eq!((last.velocity_mps.norm(), last.pose.heading_rad.abs()), (0.0, core::f64::consts::PI));
}

#[test]
fn rows_are_separated_by_scenario() {
    let text = "scenario,id,type,length_m,width_m,step,x_m,y_m,heading_rad,speed_mps\n\
                B,500,car,6.10,2.56,0,87.4,-91.9,-0.7,13.3\nA,500,bus,12,2.5,0,1,2,0,3\nA,500,bus,12,2.5,1,2,2,0,3\n";
    let recordings = commonroad_csv(text).unwrap();
    assert_eq!(recordings.keys().collect::<Vec<_>>(), ["A", "B"]);
    let bus = &recordings["A"].tracks[0];
    assert_eq!((bus.kind, bus.extent.length_m, bus.samples.len()), (ActorKind::Truck, 12.0, 2));
    assert_eq!(recordings["A"].step, Span::from_ms(100));
}

#[test]
fn invalid_row_is_reported_with_its_line() {
    let eth = |text: &str| eth_ucy(text).unwrap_err().to_string();
    assert_eq!(eth("0 1 2 3\n0 1 2"), "2: expected `frame person x y`, found 3 words");
    assert_eq!(eth("0 1 NaN 3"), "1: x: expected a number of at most 10000000, found `NaN`");
    assert_eq!(eth("5 1 2 3"), "1: frame: expected a multiple of 10, found `5`");
    assert_eq!(eth("0.5 1 2 3"), "1: frame: expected a whole number, found `0.5`");
    assert_eq!(eth("0 -1 2 3"), "1: person: expected no negative number, found `-1`");
    assert_eq!(eth("0 1 2 3\n\n0 1 2 3"), "3: 1 is a second time at one instant");
    let head = "scenario,id,type,length_m,width_m,step,x_m,y_m,heading_rad,speed_mps";
    let road = |text: &str| commonroad_csv(&format!("{head}\n{text}")).unwrap_err().to_string();
    assert!(road("A,1,boat,1,1,0,0,0,0,0").starts_with("2: type: expected one of car, taxi"));
    assert_eq!(road("A,1"), "2: expected 10 columns, found 2");
    assert!(commonroad_csv("frame person").unwrap_err().to_string().starts_with("1: expected `scenario,id"));
    assert_eq!(eth_ucy("").unwrap().tracks, []);
}

#[test]
fn made_recording_moves_like_traffic() {
    let recording = made(1, 12);
    assert_eq!(recording, made(1, 12), "the same twice");
    assert_ne!(recording, made(2, 12));
    assert_eq!(recording.step, Span::from_ms(400));
    let (mut people, mut cars, mut stands, mut bends) = (0, 0, 0, 0);
    for track in &recording.tracks {
        let moved: Vec<f64> = track.samples.windows(2).map(|two| two[0].1.distance(two[1].1)).collect();
        let (most, walks) = (moved.iter().copied().fold(0.0, f64::max), track.kind == ActorKind::Pedestrian);
        assert!(most < if walks { 1.3 } else { 6.5 }, "{:?} {most}", track.kind);
        assert!(track.samples.windows(2).all(|two| two[1].0 == two[0].0 + 1), "without a gap");
        people += usize::from(walks);
        cars += usize::from(!walks);
        stands += usize::from(!walks && moved.iter().any(|moved| *moved < 0.05));
        let (first, last) = (track.samples[0].1, track.samples[track.samples.len() - 1].1);
        let both_m = (first.x_m - last.x_m).abs().min((first.y_m - last.y_m).abs());
        bends += usize::from(!walks && both_m > 20.0);
    }
    assert!(people > 15 && cars > 15 && stands > 3 && bends > 3, "{people} {cars} {stands} {bends}");
    // Cars keep apart: no two are at the same position at the same instant.
    let mut least_m = f64::INFINITY;
    let cars: Vec<_> = recording.tracks.iter().filter(|one| one.kind == ActorKind::Car).collect();
    for (k, a) in cars.iter().enumerate() {
        for b in &cars[..k] {
            for (step, at) in &a.samples {
                let other = b.samples.iter().find(|(other, _)| other == step);
                least_m = other.map_or(least_m, |(_, other)| least_m.min(at.distance(*other)));
            }
        }
    }
    assert!(least_m > 1.0, "{least_m}");
}

#[test]
fn written_recording_is_read_again() {
    let (fine, coarse) = (made_finely(7, 3), made(7, 3));
    assert_eq!((fine.step, coarse.step), (Span::from_ms(100), Span::from_ms(400)));
    // The same minute: every fourth position.
    let id = coarse.tracks[0].id;
    let same = fine.tracks.iter().find(|track| track.id == id).unwrap();
    for (step, place) in &coarse.tracks[0].samples {
        let at = same.samples.binary_search_by_key(&(4 * step), |(at, _)| *at).unwrap();
        assert_eq!(same.samples[at].1, *place);
    }
    let mut still = fine.tracks[0].clone();
    (still.id, still.kind) = (ActorId(9999), ActorKind::Static);
    let mut written = fine.clone();
    written.tracks.push(still);
    let text = commonroad_text(&[("a, minute".to_owned(), written)]).unwrap();
    let read = commonroad_csv(&text).unwrap();
    let read = &read["a  minute"];
    assert_eq!(read.tracks.len(), fine.tracks.len(), "what stands for good is left out");
    for (read, fine) in read.tracks.iter().zip(&fine.tracks) {
        assert_eq!((read.id, read.kind, read.samples.len()), (fine.id, fine.kind, fine.samples.len()));
        for ((a, p), (b, q)) in read.samples.iter().zip(&fine.samples) {
            assert!(a == b && p.distance(*q) < 1e-4);
        }
    }
    assert_eq!(
        commonroad_text(&[("x".to_owned(), coarse)]).unwrap_err().to_string(),
        "a step of 400 ms in place of 0.1 s"
    );
}
