//! Vehicle classes that may use a lane, and the kind of lane that follows from them.

use swerve_map::LaneKind;

/// Classes of motor vehicles on roads.
const MOTOR: [&str; 18] = [
    "private",
    "emergency",
    "authority",
    "army",
    "vip",
    "passenger",
    "hov",
    "taxi",
    "bus",
    "coach",
    "delivery",
    "truck",
    "trailer",
    "motorcycle",
    "moped",
    "evehicle",
    "custom1",
    "custom2",
];

/// Classes of [`MOTOR`] that may use lanes closed for all others, such as hard shoulders.
const SERVICES: [&str; 2] = ["emergency", "authority"];

/// Kind of a lane by its attributes `allow` and `disallow`; `None` for lanes without traffic on roads, such as rails.
///
/// Without attributes, all classes are allowed. Lanes for motor vehicles are for driving; for emergency services only,
/// shoulders. Of the others, lanes with pedestrians are for walking, lanes with bicycles for cycling.
pub(super) fn kind_of(allow: Option<&str>, disallow: Option<&str>) -> Option<LaneKind> {
    let lists = |list: &str, class: &str| list.split_whitespace().any(|one| one == class || one == "all");
    let is_allowed = |class: &str| match (allow, disallow) {
        (Some(allow), _) => lists(allow, class),
        (None, Some(disallow)) => !lists(disallow, class),
        (None, None) => true,
    };
    if MOTOR.iter().any(|class| !SERVICES.contains(class) && is_allowed(class)) {
        Some(LaneKind::Driving)
    } else if SERVICES.into_iter().any(is_allowed) {
        Some(LaneKind::Shoulder)
    } else if ["pedestrian", "wheelchair"].into_iter().any(is_allowed) {
        Some(LaneKind::Walking)
    } else if ["bicycle", "scooter"].into_iter().any(is_allowed) {
        Some(LaneKind::Cycling)
    } else {
        None
    }
}

/// True if cars may leave a lane by its attribute `changeLeft` or `changeRight`, a list of classes.
pub(super) fn may_change(classes: Option<&str>) -> bool {
    let mut classes = classes.unwrap_or_default().split_whitespace().peekable();
    classes.peek().is_none() || classes.any(|class| class == "passenger" || class == "all")
}
