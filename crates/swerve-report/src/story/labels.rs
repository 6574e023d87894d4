//! Label placement: the labels of a view are requested first, then placed by importance so that they overlap neither
//! each other nor lines.

use swerve_draw::{Anchor, At, Canvas, Color, Style, Text, color, width_of};

/// Priority of a label; the first variants are placed first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Importance {
    /// First sight, closest approach, collision: essential for the reader.
    Event,
    Badge,
    Name,
    Time,
}

/// Bounding box of a text: left, top, right, bottom, pixels.
pub(super) type Room = [f64; 4];

/// Labels of one view.
pub(super) struct Labels {
    room: Room,
    /// Boxes of signs that names and times must not cover.
    signs: Vec<Room>,
    /// Line segments that texts should not cross.
    lines: Vec<[At; 2]>,
    asked: Vec<Asked>,
}

struct Asked {
    importance: Importance,
    places: Vec<At>,
    text: String,
    how: Text,
    /// Colour of the disc behind a badge.
    disc: Option<Color>,
}

impl Labels {
    /// Creates the labels of a view from its top left corner and size.
    pub(super) fn new((x, y): At, (width, height): (f64, f64)) -> Self {
        Self {
            room: [x + 2.0, y + 2.0, x + width - 2.0, y + height - 2.0],
            signs: Vec::new(),
            lines: Vec::new(),
            asked: Vec::new(),
        }
    }

    /// Marks a drawn sign, which names and times avoid.
    pub(super) fn keep_off(&mut self, sign: Room) {
        self.signs.push(sign);
    }

    /// Marks a drawn line, which texts avoid if they can.
    pub(super) fn keep_off_line(&mut self, places: impl IntoIterator<Item = At>) {
        let mut places = places.into_iter();
        let Some(mut from) = places.next() else { return };
        let mut last = from;
        for place in places {
            last = place;
            if (place.0 - from.0).abs() + (place.1 - from.1).abs() > LINE_STEP {
                self.lines.push([from, place]);
                from = place;
            }
        }
        self.lines.push([from, last]);
    }

    /// Requests a text at the first free one of `places`; if none is free, it is left out.
    pub(super) fn ask(&mut self, importance: Importance, places: Vec<At>, text: String, how: Text) {
        self.asked.push(Asked { importance, places, text, how, disc: None });
    }

    /// Requests an event label as near to a point as possible.
    pub(super) fn event(&mut self, (x, y): At, text: String, paint: Color) {
        let how = Text { size: 11.0, color: paint, anchor: Anchor::Middle, bold: true, rim: true };
        let [left, top, right, bottom] = self.room;
        let y = y.min(bottom - 4.0).max(top + 12.0);
        let half = 0.5 * width_of(&text, how);
        let clamped = |x: f64| x.min(right - half).max(left + half);
        let mut places = Vec::new();
        for dx in [0.0, 70.0, -70.0, 140.0, -140.0, 280.0, -280.0] {
            for k in 0..14 {
                places.extend([1.0, -1.0].map(|sign| (clamped(x + dx), y + sign * 13.0 * f64::from(k))));
            }
        }
        // Nearest first; ties keep their order.
        let away = |p: &At| (p.0 - x).abs() * 0.5 + (p.1 - y).abs();
        places.sort_by(|a, b| away(a).total_cmp(&away(b)));
        self.ask(Importance::Event, places, text, how);
    }

    /// Requests a number in a disc, preferably above a point.
    pub(super) fn badge(&mut self, (x, y): At, number: usize, paint: Color) {
        let how = Text { size: 10.0, color: color::PAPER, anchor: Anchor::Middle, bold: true, rim: false };
        let shift = |k: i32| (x, y - 17.0 * f64::from(k));
        let places = (0..12).flat_map(|k| [shift(k), shift(-k)]).collect();
        let text = number.to_string();
        self.asked.push(Asked { importance: Importance::Badge, places, text, how, disc: Some(paint) });
    }

    /// Places and draws the labels. The first free position clear of all lines is used. Failing that, a time label is
    /// left out, since its neighbours imply it; other texts take the first free position, on a plate that hides the
    /// lines.
    pub(super) fn draw(mut self, canvas: &mut Canvas) {
        self.asked.sort_by_key(|asked| asked.importance);
        let mut taken: Vec<Room> = Vec::new();
        for asked in &self.asked {
            let Asked { importance, places, text, how, disc } = asked;
            let signs = if *importance >= Importance::Name { &self.signs[..] } else { &[] };
            let width = width_of(text, *how);
            let room = |at: At| asked.room(at, width);
            let is_free = |at: &At| {
                let r = room(*at);
                is_within(&r, &self.room) && !taken.iter().chain(signs).any(|t| overlap(t, &r))
            };
            let free = || places.iter().copied().filter(is_free);
            if let Some(paint) = disc {
                let Some(at) = free().next() else { continue };
                taken.push(room(at));
                badge(canvas, at, text, *paint);
                continue;
            }
            let crosses = |at: At| {
                let room = room(at);
                self.lines.iter().any(|line| is_crossed(&room, *line))
            };
            let clear = free().take(CLEAR_AMONG).find(|at| !crosses(*at));
            let fallback = || free().next().filter(|_| *importance != Importance::Time);
            let Some(at) = clear.or_else(fallback) else { continue };
            let room = room(at);
            taken.push(room);
            if clear.is_none() {
                let [left, top, right, bottom] = room;
                let plate = Style::fill(color::PAPER).filled_by(0.9).rounded(2.0);
                canvas.rect((left - 2.0, top), (right - left + 4.0, bottom - top), plate);
            }
            canvas.text(at, text, *how);
        }
    }
}

impl Asked {
    /// Bounding box of the label at a position, given the width of its text.
    fn room(&self, at: At, width: f64) -> Room {
        match self.disc {
            Some(_) => [at.0 - 8.0, at.1 - 8.0, at.0 + 8.0, at.1 + 8.0],
            None => room_of(at, width, self.how),
        }
    }
}

/// Resolution of lines, pixels.
const LINE_STEP: f64 = 3.0;
/// Number of free positions searched for one clear of all lines; farther ones would be ambiguous.
const CLEAR_AMONG: usize = 24;

/// True if a line segment crosses a box (Liang and Barsky, "A new concept and method for line clipping", 1984).
fn is_crossed(room: &Room, [from, to]: [At; 2]) -> bool {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let edges =
        [(-dx, from.0 - room[0]), (dx, room[2] - from.0), (-dy, from.1 - room[1]), (dy, room[3] - from.1)];
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (p, q) in edges {
        if p == 0.0 {
            if q < 0.0 {
                return false;
            }
        } else if p < 0.0 {
            enter = enter.max(q / p);
        } else {
            leave = leave.min(q / p);
        }
    }
    enter <= leave
}

/// Bounding box of a text of this width whose baseline is at a position.
fn room_of((x, y): At, width: f64, how: Text) -> Room {
    let left = match how.anchor {
        Anchor::Middle => x - 0.5 * width,
        Anchor::End => x - width,
        Anchor::Start => x,
    };
    [left, y - 0.8 * how.size, left + width, y + 0.2 * how.size]
}

/// Horizontal space between two labels, pixels: letters of another font may be wider.
const BESIDE: f64 = 4.0;

fn overlap(a: &Room, b: &Room) -> bool {
    a[0] < b[2] + BESIDE && b[0] < a[2] + BESIDE && a[1] < b[3] && b[1] < a[3]
}

fn is_within(r: &Room, all: &Room) -> bool {
    r[0] >= all[0] && r[1] >= all[1] && r[2] <= all[2] && r[3] <= all[3]
}

/// Draws a number in a filled circle.
pub(super) fn badge(canvas: &mut Canvas, (x, y): At, number: &str, paint: Color) {
    canvas.circle((x, y), 7.0, Style::fill(paint).outlined(color::PAPER, 1.0));
    let how = Text { size: 10.0, color: color::PAPER, anchor: Anchor::Middle, bold: true, ..Text::default() };
    canvas.text((x, y + 3.6), number, how);
}
