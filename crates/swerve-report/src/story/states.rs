//! States of the behaviour planner as a strip over time.

use swerve_eval::StateChange;
use swerve_msg::DrivingState;

use super::panels;
use super::record::Story;
use super::view::View;
use swerve_draw::{Anchor, Axes, Canvas, Color, Entry, Sign, Style, Text, color, width_of};

/// Height of the strip, and of its row including the gap, pixels.
const STRIP: f64 = 15.0;
const ROW: f64 = 22.0;
/// Width below which a span is drawn as part of the one before, pixels.
const WIDTH_MIN: f64 = 4.0;

/// Groups of states that have one colour.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Group {
    Free,
    Follows,
    Waits,
    Moves,
    Emergency,
}

impl Group {
    const ALL: [Self; 5] = [Self::Free, Self::Follows, Self::Waits, Self::Moves, Self::Emergency];

    fn of(state: DrivingState) -> Self {
        use DrivingState as State;
        match state {
            State::Cruise | State::InJunction => Self::Free,
            State::Follow => Self::Follows,
            State::ApproachLight
            | State::WaitAtLight
            | State::GiveWay
            | State::WaitForGap
            | State::Creep
            | State::StopSign
            | State::WaitForRoom
            | State::WaitForPedestrian => Self::Waits,
            State::Merge | State::LaneChange | State::Overtake => Self::Moves,
            State::EmergencyStop => Self::Emergency,
        }
    }

    fn color(self) -> Color {
        match self {
            Self::Free => color::EGO,
            Self::Follows => color::VEHICLE,
            Self::Waits => color::SIGHT,
            Self::Moves => color::PLAN,
            Self::Emergency => color::ALARM,
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Free => "drives freely",
            Self::Follows => "follows",
            Self::Waits => "stops or waits",
            Self::Moves => "changes lane or overtakes",
            Self::Emergency => "brakes hard",
        }
    }

    fn style(self) -> Style {
        Style::fill(self.color()).filled_by(0.25).outlined(self.color(), 0.6)
    }
}

/// Part of the strip, from left to right, pixels.
#[derive(Clone, PartialEq, Debug)]
struct Part<'a> {
    left: f64,
    right: f64,
    change: &'a StateChange,
    state: DrivingState,
}

fn changes(story: &Story) -> &[StateChange] {
    story.metrics.as_ref().and_then(|metrics| metrics.behaviour.as_ref()).map_or(&[][..], |of| &of.changes)
}

/// Parts of the strip over a time axis; those too narrow to see belong to the one before, except emergencies.
fn parts<'a>(story: &'a Story, frame: &Axes) -> Vec<Part<'a>> {
    let changes = changes(story);
    let end_s = story.ego.last().map_or(frame.x.1, |ego| ego.stamp.as_secs());
    let ends = changes.iter().skip(1).map(|change| change.at_s).chain([end_s]);
    let x = |at_s: f64| frame.at(at_s.clamp(frame.x.0, frame.x.1), 0.0).0;
    let mut parts: Vec<Part<'_>> = Vec::new();
    for (change, until_s) in changes.iter().zip(ends) {
        let Some(state) = change.state else { continue };
        let (left, right) = (x(change.at_s), x(until_s));
        if right <= left {
            continue;
        }
        match parts.last_mut().filter(|last| last.right == left) {
            Some(last) if right - left < WIDTH_MIN && Group::of(state) != Group::Emergency => {
                last.right = right;
            }
            _ => parts.push(Part { left, right, change, state }),
        }
    }
    parts
}

/// Draws the states over a time axis, from `top` down. Returns the height used: none without states in view.
pub(super) fn strip(canvas: &mut Canvas, story: &Story, frame: &Axes, top: f64) -> f64 {
    let parts = parts(story, frame);
    if parts.is_empty() {
        return 0.0;
    }
    let named = Text { size: 11.0, color: color::INK, anchor: Anchor::End, ..Text::default() };
    canvas.text((frame.corner.0 - 8.0, top + 11.0), "behaviour", named);
    let how = Text { size: 10.0, anchor: Anchor::Middle, color: color::INK, ..Text::default() };
    for Part { left, right, change, state } in parts {
        canvas.rect((left, top), (right - left, STRIP), Group::of(state).style());
        let labels = [change.words(), state.words().to_owned()];
        if let Some(label) = labels.iter().find(|label| width_of(label, how) + 6.0 < right - left) {
            canvas.text((0.5 * (left + right), top + 11.0), label, how);
        }
    }
    ROW
}

/// Legend entries of the groups of states in view.
pub(super) fn legend(story: &Story, view: &View) -> Vec<Entry> {
    let (from_s, to_s) = panels::time_axis(story, view);
    let changes = changes(story);
    let ends = changes.iter().skip(1).map(|change| change.at_s).chain([f64::INFINITY]);
    let shown = changes.iter().zip(ends).filter(|(change, until_s)| change.at_s < to_s && *until_s > from_s);
    let groups: Vec<Group> = shown.filter_map(|(change, _)| change.state.map(Group::of)).collect();
    let there = Group::ALL.into_iter().filter(|group| groups.contains(group));
    there.map(|group| (Sign::Block(group.style()), group.words().to_owned())).collect()
}
