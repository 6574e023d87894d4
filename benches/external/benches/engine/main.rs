//! Cost of a hop in the dataflow engine, in copper (`cu29`) and in a bare bounded channel.
//!
//! Each engine runs chains of a source, 1, 2, 4 or 8 operators and a sink over 64 bytes, in one thread. A hop is the
//! cost of one more operator per frame: the slope of the least-squares line through the four lengths. All run
//! alternately, round by round, so that host noise affects all of them; ratios are computed within a round.

use std::hint::black_box;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, now};

mod copper;
mod ours;

const ROUNDS: usize = 15;

/// Lengths of the chains: operators between source and sink.
const LENGTHS: [usize; 4] = [1, 2, 4, 8];

/// Payload: 64 bytes, the number of the frame first.
type Small = [u64; 8];

/// First word received by the last sink: proof that the frames passed through.
static SEEN: AtomicU64 = AtomicU64::new(0);

/// Operation of each operator.
fn changed(small: &Small) -> Small {
    let mut small = *small;
    small[0] = small[0].wrapping_add(1);
    small
}

/// Operation of each sink.
fn see(small: &Small) {
    SEEN.store(black_box(small)[0], Ordering::Relaxed);
}

/// Checks that `frames` passed through operators that added `added` in total.
fn check(frames: u64, added: usize) {
    assert_eq!(SEEN.load(Ordering::Relaxed), frames - 1 + added as u64, "a frame was lost");
}

/// Slope and first value (at one operator) of the least-squares line through the figures of the four lengths.
fn line(figures: [f64; LENGTHS.len()]) -> Line {
    let n = LENGTHS.len() as f64;
    let points = || LENGTHS.iter().map(|&x| x as f64).zip(figures);
    let (mean_x, mean_y) = points().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (xy, xx) = points().fold((0.0, 0.0), |(xy, xx), (x, y)| {
        (xy + (x - mean_x) * (y - mean_y), xx + (x - mean_x) * (x - mean_x))
    });
    Line { hop_ns: xy / xx, frame_ns: mean_y + xy / xx * (1.0 - mean_x) }
}

/// Cost of a chain.
struct Line {
    /// One more operator, nanoseconds.
    hop_ns: f64,
    /// A frame of source, one operator and sink, nanoseconds.
    frame_ns: f64,
}

/// Rounds of one engine.
#[derive(Default)]
struct Rounds {
    hop_ns: Vec<f64>,
    frame_ns: Vec<f64>,
}

impl Rounds {
    fn push(&mut self, line: &Line) {
        self.hop_ns.push(line.hop_ns);
        self.frame_ns.push(line.frame_ns);
    }

    fn row(&self, rows: &mut Rows, what: &str, goal: Goal) {
        let hop = Sample::new(self.hop_ns.clone());
        let frame = Sample::new(self.frame_ns.clone()).median();
        rows.row(what, hop.median(), &format!("{}, frame {frame:.0}", hop.text(1, "ns")), goal);
    }
}

/// Adds a row with one ratio per round.
fn ratio(rows: &mut Rows, what: &str, ours: &Rounds, peer: &[f64], goal: Goal) {
    let ratios = ours.hop_ns.iter().zip(peer).map(|(ours, peer)| ours / peer).collect();
    let ratios = Sample::new(ratios);
    rows.row(what, ratios.median(), &ratios.text(2, "x"), goal);
}

/// Nanoseconds of one send and receive of a bounded channel, both ends in one thread that never sleeps.
fn channel_ns(messages: u64) -> f64 {
    let (sender, receiver) = crossbeam_channel::bounded::<Small>(16);
    let began = now();
    for k in 0..messages {
        let _ = sender.send(black_box([k; 8]));
        black_box(receiver.recv().ok());
    }
    began.elapsed().as_nanos() as f64 / messages as f64
}

fn main() {
    if !is_asked_to_measure() {
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (mut passed, mut made) = (Rounds::default(), Rounds::default());
    let (mut off, mut mock, mut logged) = (Rounds::default(), Rounds::default(), Rounds::default());
    let (mut channel, mut reading) = (vec![], vec![]);
    for _ in 0..ROUNDS {
        passed.push(&line(LENGTHS.map(|n| ours::frame_ns(|| ours::Through, n, 0))));
        off.push(&line(copper::frames_ns(copper::Clock::Real)));
        made.push(&line(LENGTHS.map(|n| ours::frame_ns(|| ours::Change, n, n))));
        mock.push(&line(copper::frames_ns(copper::Clock::Mock)));
        channel.push(channel_ns(500_000));
        reading.push(copper::reading_ns(500_000));
        logged.push(&line(copper::logged_frames_ns(folder)));
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "hops");
    let goal = Goal::Most(50.0);
    passed.row(&mut rows, "swerve: added inline hop, 64 B passed on", goal);
    made.row(&mut rows, "swerve: added inline hop, 64 B made anew, digested", goal);
    off.row(&mut rows, "copper: added hop, 64 B copied, log off", Goal::None);
    mock.row(&mut rows, "copper: the same, its clock a mock", Goal::None);
    logged.row(&mut rows, "copper: the same, its log on", Goal::None);
    let reading = Sample::new(reading);
    let what = "  one reading of copper's clock, two a task";
    rows.row(what, reading.median(), &reading.text(1, "ns"), Goal::None);
    let bare = Sample::new(channel.clone());
    let what = "crossbeam bounded, send and receive of 64 B, one thread";
    rows.row(what, bare.median(), &bare.text(1, "ns"), Goal::None);
    let goal = Goal::Most(2.5);
    ratio(&mut rows, "swerve passed on / copper, log off", &passed, &off.hop_ns, goal);
    ratio(&mut rows, "swerve made anew / copper, log off", &made, &off.hop_ns, goal);
    ratio(&mut rows, "swerve passed on / copper, mock clock", &passed, &mock.hop_ns, Goal::None);
    ratio(&mut rows, "swerve made anew / copper, mock clock", &made, &mock.hop_ns, Goal::None);
    ratio(&mut rows, "swerve passed on / one message of the channel", &passed, &channel, Goal::None);
    rows.finish();
}
