use swerve_core::{Span, Time};
use swerve_draw::color;
use swerve_geom::{Pose2, Vector2};
use swerve_msg::{ActorId, ActorKind, EgoState, Extent, Plan, PlanPoint, Track, TrackList};

use super::{Collector, Figures, Message, Page, RunPage, data_of};

fn at(ms: i64) -> Time {
    Time::ZERO + Span::from_ms(ms)
}

fn message<'a>(stream: &'a str, operator: &'a str, ms: i64) -> Message<'a> {
    Message { stream, operator, stamp: at(ms), at: at(ms + 5), origin: Some(at(ms)) }
}

#[test]
fn page_round_trips_texts_without_markup() {
    let nasty = "</script><script>alert(1)</script><!-- & \u{2028} \"";
    let figures = Figures { command: nasty.into(), rows: vec![vec![nasty.into()]], ..Figures::default() };
    let html = Page::new("figures", nasty, figures).html();
    let data = data_of(&html).unwrap();
    assert!(!data.contains('<'), "{data}");
    let back: serde_json::Value = serde_json::from_str(data).unwrap();
    assert_eq!(
        (&back["command"], &back["title"], &back["rows"][0][0]),
        (&nasty.into(), &nasty.into(), &nasty.into())
    );
    // One element holds the data and one the program, whatever the texts contain.
    assert_eq!(html.matches("<script").count(), 2);
    assert_eq!(html.matches("</script").count(), 2);
    assert!(html.contains("<title>&lt;/script&gt;"), "the title is escaped");
    assert!(data_of("<p>another page</p>").is_none());
}

#[test]
fn page_fetches_nothing() {
    let html = Page::new("figures", "t", Figures::default()).html();
    // The only URL in the page is the SVG namespace.
    assert_eq!(html.matches("://").count(), html.matches("\"http://www.w3.org/2000/svg\"").count());
}

#[test]
fn verdict_colours_match_the_pictures() {
    let html = Page::new("figures", "t", Figures::default()).html();
    for (name, color) in [
        ("good", color::GOOD),
        ("stopped", color::STOPPED),
        ("alarm", color::ALARM),
        ("left-road", color::LEFT_ROAD),
        ("soft", color::SOFT),
    ] {
        let said = format!("--{name}: {color};").to_lowercase();
        assert!(html.contains(&said), "style.css has no `{said}`");
    }
}

#[test]
fn collector_rounds_and_thins_numbers() {
    let mut collector = Collector::new();
    for k in 0..20 {
        let pose = Pose2::new(0.1 * f64::from(k), -1.234, 0.5);
        let state = EgoState { stamp: at(5 * i64::from(k)), pose, speed_mps: 20.0, ..EgoState::default() };
        collector.message(message("pose", "pose", 5 * i64::from(k)), Some(&state));
    }
    let point = |k: u32| PlanPoint { pose: Pose2::new(f64::from(k), 0.0, 0.0), ..PlanPoint::default() };
    let plan = Plan { stamp: at(50), points: (0..100).map(point).collect(), ..Plan::default() };
    collector.message(message("planner", "planner", 50), Some(&plan));
    // The plan with injected faults is not a second plan.
    collector.message(message("planner.fault", "fault", 50), Some(&plan));
    let track = Track {
        id: ActorId(3),
        kind: ActorKind::Pedestrian,
        pose: Pose2::new(1.0, 2.0, 0.0),
        extent: Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 },
        velocity_mps: Vector2::new(-1.5, 0.0),
        history: Vec::new(),
    };
    collector
        .message(message("tracker", "tracker", 50), Some(&TrackList { stamp: at(50), tracks: vec![track] }));
    collector.step("planner", at(50), at(50), at(55), true);
    let page = collector.finish();
    assert_eq!(page.ego.t, [0, 20_000, 40_000, 60_000, 80_000], "every 20 ms");
    assert_eq!((page.ego.x[1], page.ego.y[1], page.ego.h[1], page.ego.v[1]), (40, -123, 500, 20_000));
    assert_eq!(page.plans.len(), 1);
    let line = &page.plans[0].line;
    assert_eq!((line.len(), line[0], line[line.len() - 2]), (48, 0, 9900), "24 points, the ends among them");
    assert_eq!(page.tracks[0].of, [[3, 100, 200, 0, 50, 50, -1500, 0]]);
    let names: Vec<_> = page.operators.iter().map(|operator| operator.name.as_str()).collect();
    assert_eq!(names, ["pose", "planner", "fault", "tracker"]);
    assert_eq!((page.steps.took, page.steps.late), (vec![5000], vec![0]));
    assert_eq!(
        (page.messages.stamp[20], page.messages.at[20], page.messages.origin[20]),
        (50_000, 55_000, 50_000)
    );
}

#[test]
fn page_without_a_drive_is_valid() {
    let page = Page::new("run", "empty", RunPage::default());
    let data: serde_json::Value = serde_json::from_str(data_of(&page.html()).unwrap()).unwrap();
    assert_eq!((&data["kind"], &data["road"]), (&"run".into(), &serde_json::Value::Null));
}

/// The light theme has the palette and the font of the pictures.
#[test]
fn page_colours_match_the_pictures() {
    use swerve_draw::color;
    let html = Page::new("figures", "t", Figures::default()).html();
    let names = [
        ("paper", color::PAPER),
        ("ink", color::INK),
        ("soft", color::SOFT),
        ("rule", color::GRID),
        ("ego", color::EGO),
        ("person", color::PERSON),
        ("vehicle", color::VEHICLE),
        ("plan", color::PLAN),
        ("fallback", color::FALLBACK),
        ("sight", color::SIGHT),
        ("alarm", color::ALARM),
        ("ground", color::GROUND),
        ("road", color::ROAD),
        ("edge", color::ROAD_EDGE),
        ("lane", color::LANE),
    ];
    let lines = (1..5).zip(color::SERIES).map(|(k, look)| (format!("line-{k}"), look.color));
    for (name, color) in names.map(|(name, color)| (name.to_owned(), color)).into_iter().chain(lines) {
        let said = format!("--{name}: {}", color.to_string().to_lowercase());
        let first = html.split(&format!("--{name}: ")).nth(1).unwrap();
        assert!(html.contains(&said) && first.starts_with(&said[name.len() + 4..]), "{said}");
    }
    assert!(html.contains(swerve_draw::STACK));
}
