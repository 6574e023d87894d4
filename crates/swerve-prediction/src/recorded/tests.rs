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
    // Shorter ones too, never over the gap; beginning at every third sighting; two at once at least.
    let short = Protocol { predict: 9, predict_min: 1, ..Protocol::whole(3, 2) };
    let lengths: Vec<usize> =
        recording.scenes(&short).iter().map(|scene| scene.windows[0].truth.len()).collect();
    assert_eq!(lengths, [3, 2, 1, 2, 1]);
    assert_eq!(recording.scenes(&Protocol { stride: 3, ..Protocol::whole(3, 2) }).len(), 2);
    assert!(recording.scenes(&Protocol { actors_min: 3, ..Protocol::whole(3, 2) }).is_empty());
}

#[test]
fn scenarios_are_told_apart() {
    let text = "scenario,id,type,length_m,width_m,step,x_m,y_m,heading_rad,speed_mps\n\
                B,500,car,6.10,2.56,0,87.4,-91.9,-0.7,13.3\nA,500,bus,12,2.5,0,1,2,0,3\nA,500,bus,12,2.5,1,2,2,0,3\n";
    let recordings = commonroad_csv(text).unwrap();
    assert_eq!(recordings.keys().collect::<Vec<_>>(), ["A", "B"]);
    let bus = &recordings["A"].tracks[0];
    assert_eq!((bus.kind, bus.extent.length_m, bus.samples.len()), (ActorKind::Truck, 12.0, 2));
    assert_eq!(recordings["A"].step, Span::from_ms(100));
}

#[test]
fn a_bad_row_is_told_with_its_line() {
    let eth = |text: &str| eth_ucy(text).unwrap_err().to_string();
    assert_eq!(eth("0 1 2 3\n0 1 2"), "2: expected `frame person x y`, found 3 words");
    assert_eq!(eth("0 1 NaN 3"), "1: x: expected a number of at most 1000000, found `NaN`");
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
fn packed_text_is_unpacked_and_broken_is_told() {
    // `printf '0 1 2 3\n' | gzip -n`, and the same with a name.
    let body = [0x33, 0x50, 0x30, 0x54, 0x30, 0x52, 0x30, 0xe6, 0x02, 0x00, 0, 0, 0, 0, 8, 0, 0, 0];
    let head = |flags| vec![0x1f, 0x8b, 8, flags, 0, 0, 0, 0, 0, 3];
    for name in [head(0), [head(8), b"a.txt\0".to_vec()].concat()] {
        assert_eq!(text([name, body.to_vec()].concat()).unwrap(), "0 1 2 3\n");
    }
    assert_eq!(text(b"plain".to_vec()).unwrap(), "plain");
    for broken in [vec![0x1f, 0x8b], head(8), [head(0), vec![0xff; 9]].concat()] {
        assert!(text(broken).unwrap_err().contains("gzip"));
    }
    assert!(text(vec![0xff]).unwrap_err().contains("UTF-8"));
}
