use super::*;

const KINDS: [MarkKind; 11] = [
    MarkKind::None,
    MarkKind::Solid,
    MarkKind::Broken,
    MarkKind::SolidSolid,
    MarkKind::SolidBroken,
    MarkKind::BrokenSolid,
    MarkKind::BrokenBroken,
    MarkKind::Dots,
    MarkKind::Kerb,
    MarkKind::Edge,
    MarkKind::Barrier,
];

#[test]
fn mark_holds_from_its_begin_to_the_next() {
    let left = vec![Mark::new(0.0, MarkKind::Broken), Mark::new(20.0, MarkKind::Solid)];
    let marks = LaneMarks::new(left, vec![Mark::new(5.0, MarkKind::Kerb)]).unwrap();
    let kind = |side, s_m| marks.at(side, s_m).map(|mark| mark.kind);
    assert_eq!(kind(Side::Left, -1.0), None);
    assert_eq!(kind(Side::Left, 0.0), Some(MarkKind::Broken));
    assert_eq!(kind(Side::Left, 19.9), Some(MarkKind::Broken));
    assert_eq!(kind(Side::Left, 20.0), Some(MarkKind::Solid));
    assert_eq!((kind(Side::Right, 4.0), kind(Side::Right, 99.0)), (None, Some(MarkKind::Kerb)));
}

#[test]
fn line_nearer_to_the_lane_decides_unless_the_map_does() {
    let crossed: Vec<MarkKind> = KINDS.into_iter().filter(|kind| kind.may_be_crossed()).collect();
    use MarkKind as K;
    assert_eq!(crossed, [K::None, K::Broken, K::BrokenSolid, K::BrokenBroken, K::Dots]);
    let of_other_lane: Vec<MarkKind> =
        KINDS.into_iter().filter(|kind| kind.mirrored().may_be_crossed()).collect();
    assert_eq!(of_other_lane, [K::None, K::Broken, K::SolidBroken, K::BrokenBroken, K::Dots]);
    for (kind, permission) in [(K::Solid, true), (K::Broken, false)] {
        let mark = Mark { permission: Some(permission), ..Mark::new(0.0, kind) };
        assert_eq!(mark.may_be_crossed(), permission);
    }
}

#[test]
fn marks_out_of_order_or_without_length_are_rejected() {
    let solid = |from_m| Mark::new(from_m, MarkKind::Solid);
    let right = |marks: &[Mark]| LaneMarks::new(vec![solid(0.0)], marks.to_vec()).unwrap_err();
    assert_eq!(right(&[solid(3.0), solid(2.0)]), MarkError::Order(1));
    assert_eq!(right(&[solid(0.0), solid(2.0), solid(2.0)]), MarkError::Order(2));
    assert_eq!(right(&[solid(f64::NAN)]), MarkError::Length(0));
    assert_eq!(right(&[solid(0.0), Mark { width_m: -0.1, ..solid(1.0) }]), MarkError::Length(1));
    let text = r#"{"left":[{"kind":"solid","from_m":2},{"kind":"broken"}]}"#;
    let error = serde_json::from_str::<LaneMarks>(text).unwrap_err();
    assert!(error.to_string().contains("mark 1"), "{error}");
}

#[test]
fn text_of_marks_leaves_out_what_is_usual() {
    let left = vec![Mark::new(0.0, MarkKind::BrokenSolid)];
    let marks = LaneMarks::new(left, Vec::new()).unwrap();
    let text = r#"{"left":[{"from_m":0.0,"kind":"broken_solid","width_m":0.12}]}"#;
    assert_eq!(serde_json::to_string(&marks).unwrap(), text);
    assert_eq!(serde_json::from_str::<LaneMarks>(text).unwrap(), marks);
    assert_eq!(serde_json::from_str::<LaneMarks>(r#"{"left":[{"kind":"broken_solid"}]}"#).unwrap(), marks);
    let full =
        r#"{"right":[{"from_m":1.5,"kind":"solid","colour":"yellow","width_m":0.25,"permission":true}]}"#;
    let marks: LaneMarks = serde_json::from_str(full).unwrap();
    let expected = Mark {
        colour: MarkColour::Yellow,
        width_m: 0.25,
        permission: Some(true),
        ..Mark::new(1.5, MarkKind::Solid)
    };
    assert_eq!(marks.of(Side::Right), [expected]);
    assert_eq!(serde_json::to_string(&marks).unwrap(), full);
}
