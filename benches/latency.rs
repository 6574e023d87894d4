//! Latency study: effect of run-time model and busy policy on the latency of a pipeline, in virtual time.
//!
//! A camera at 20 Hz, a detector of about 80 ms under the model and policy of each row, a tracker of 10 ms, a planner
//! of 20 ms, a controller at 100 Hz. The latency of an operator is the age of the stamp at its publication; end to end
//! is the age of the newest frame behind a command, for every command. All except `measured` give the same figures on
//! any host. `timing` is the speed of `swerve timing`; `--bench latency -- timing` measures it alone.

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

use swerve_benches::{Goal, Rows, Sample, is_asked, is_asked_to_measure, now, print, resident_kib};
use swerve_core::{Rng, Span, Time};
use swerve_draw::{Axes, Canvas, Picture, Style, Text, color};
use swerve_flow::{
    At, Context, Event, Every, Graph, Late, Latest, Observer, Operator, Policy, Port, RecordedTimes,
    RunOptions, RuntimeModel, every, run_virtual,
};
use swerve_report::output::align;

/// Twenty minutes: 24,000 frames, so that p99.9 is based on some two dozen.
const UNTIL_MS: i64 = 1_200_000;
const OPERATORS: [&str; 5] = ["camera", "detector", "tracker", "planner", "controller"];
const SHARES: [f64; 3] = [0.5, 0.99, 0.999];
/// Ratio of modelled to host time of the measured detector, whose steps take about 20 us.
const SCALE: f64 = 4000.0;
/// Number of bins of a histogram, and its range, milliseconds.
const BINS: usize = 40;
const RANGE_MS: f64 = 600.0;

struct Camera;
impl Operator for Camera {
    type In = Every;
    type Out = Port<u64>;
    fn step(&mut self, cx: &mut Context<'_>, _: &Every, out: &mut Port<u64>) {
        out.send(cx.rng().bits());
    }
}

/// Reports 300 to 1,100 units of work; if measured, computes for some microseconds.
struct Detector {
    measured: bool,
}
impl Operator for Detector {
    type In = At<u64>;
    type Out = Port<u64>;
    fn step(&mut self, cx: &mut Context<'_>, input: &At<u64>, out: &mut Port<u64>) {
        let Some(frame) = input.get() else { return };
        let units = cx.rng().uniform(300.0, 1100.0) as u64;
        cx.spend(units);
        if self.measured {
            let began = now();
            while began.elapsed().as_nanos() < 12_000 + 12 * u128::from(units) {
                black_box(units);
            }
        }
        out.send(**frame ^ units);
    }
}

struct Next;
impl Operator for Next {
    type In = At<u64>;
    type Out = Port<u64>;
    fn step(&mut self, _: &mut Context<'_>, input: &At<u64>, out: &mut Port<u64>) {
        if let Some(message) = input.get() {
            out.pass_on(message);
        }
    }
}

struct Controller;
impl Operator for Controller {
    type In = (Every, Latest<u64>);
    type Out = Port<u64>;
    fn step(&mut self, _: &mut Context<'_>, (_, plan): &Self::In, out: &mut Port<u64>) {
        if let Some(plan) = plan.get() {
            out.pass_on(plan);
        }
    }
}

/// Ages at publication, milliseconds, by operator.
#[derive(Default)]
struct Ages {
    ms: [Vec<f64>; 5],
    /// The newest frame that a plan derives from, and the number of such plans.
    plans: usize,
}

impl Observer for Ages {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let (Some(stamp), Some(operator)) =
            (publication.stamp, OPERATORS.iter().position(|name| *name == publication.operator))
        else {
            return;
        };
        self.plans += usize::from(operator == 3);
        let from = if operator == 4 { publication.origin } else { Some(stamp) };
        let age = from.map(|from| (publication.visible_at - from).ns() as f64 * 1e-6);
        self.ms[operator].extend(age);
    }
}

fn models() -> Vec<(&'static str, RuntimeModel)> {
    let ms = Span::from_ms;
    let mut rng = Rng::keyed(7, "recorded", &[]);
    let recorded: RecordedTimes = (0..UNTIL_MS / 100)
        .map(|k| (Time::from_ms(100 * k), Span::from_us(rng.uniform(50_000.0, 110_000.0) as i64)))
        .collect();
    vec![
        ("zero", RuntimeModel::Zero),
        ("fixed", RuntimeModel::Fixed(ms(80))),
        ("cycle", RuntimeModel::Cycle(vec![ms(60), ms(60), ms(120)])),
        ("normal", RuntimeModel::Normal { mean: ms(80), deviation: ms(15) }),
        ("log-normal", RuntimeModel::LogNormal { median: ms(75), sigma: 0.35 }),
        (
            "percentiles",
            RuntimeModel::Percentiles(vec![(0.0, ms(60)), (50.0, ms(75)), (99.0, ms(160)), (99.9, ms(300))]),
        ),
        ("work", RuntimeModel::Work { base: ms(10), per_unit_ns: 100_000.0 }),
        ("recorded", RuntimeModel::Recorded(Arc::new(recorded))),
        ("measured", RuntimeModel::Measured { scale: SCALE }),
    ]
}

fn policies() -> [(&'static str, Policy); 4] {
    [
        ("skip_to_latest", Policy::SkipToLatest),
        ("queue(2)", Policy::queue(2)),
        ("pipelined(4)", Policy::pipelined(4)),
        ("pipelined(4, overtaking)", Policy::Pipelined { places: 4, late: Late::Overtaken }),
    ]
}

/// One row: model, policy, ages, and the number of camera frames that led to a plan.
struct Case {
    model: &'static str,
    policy: &'static str,
    ages: Vec<Sample>,
    through: f64,
}

fn run(model: (&'static str, RuntimeModel), policy: (&'static str, Policy)) -> Case {
    let ms = Span::from_ms;
    let mut graph = Graph::new();
    let fixed = |n| RuntimeModel::Fixed(ms(n));
    let image = graph.add("camera", Camera, every(ms(50))).runtime(fixed(5)).origin().out();
    let detector = Detector { measured: model.0 == "measured" };
    let boxes = graph.add("detector", detector, image).runtime(model.1).policy(policy.1).out();
    let tracks = graph.add("tracker", Next, boxes).runtime(fixed(10)).policy(policy.1).out();
    let plan = graph.add("planner", Next, tracks).runtime(fixed(20)).policy(policy.1).out();
    graph.add("controller", Controller, (every(ms(10)), plan)).out();
    let mut ages = Ages::default();
    let options = RunOptions::until(Time::from_ms(UNTIL_MS));
    run_virtual(graph, &options, vec![&mut ages]).expect("a sound graph");
    let frames = ages.ms[0].len().max(1);
    let through = ages.plans as f64 / frames as f64;
    Case { model: model.0, policy: policy.0, ages: ages.ms.into_iter().map(Sample::new).collect(), through }
}

/// Shares of the end-to-end ages by bin; values beyond the range count in the last bin.
fn histogram(case: &Case) -> Vec<f64> {
    let mut bins = vec![0.0; BINS];
    let figures = case.ages[4].figures();
    for ms in figures {
        let bin = (ms / RANGE_MS * BINS as f64) as usize;
        bins[bin.min(BINS - 1)] += 1.0 / figures.len() as f64;
    }
    bins
}

fn sparkline(bins: &[f64]) -> String {
    const LEVELS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let most = bins.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let level = |share: f64| if share > 0.0 { (share / most * 7.0).ceil() as usize + 1 } else { 0 };
    bins.iter().map(|share| LEVELS[level(*share).min(8)]).collect()
}

fn table(cases: &[Case]) -> String {
    let mut head = vec!["model".to_owned(), "policy".to_owned()];
    head.extend(
        [
            "camera",
            "detector",
            "tracker",
            "planner",
            "end to end",
            "frames through",
            "end to end, 0 to 600 ms",
        ]
        .map(str::to_owned),
    );
    let mut lines = vec![head];
    for case in cases {
        let three = |sample: &Sample| SHARES.map(|share| format!("{:.0}", sample.at(share))).join(" / ");
        let mut line = vec![case.model.to_owned(), case.policy.to_owned()];
        line.extend(case.ages.iter().map(three));
        line.push(format!("{:.1} %", 100.0 * case.through));
        line.push(format!("|{}|", sparkline(&histogram(case))));
        lines.push(line);
    }
    align(&lines)
}

/// Small multiples: a histogram of the end-to-end latency for each model (row) and policy (column).
fn picture(cases: &[Case]) -> Picture {
    const W: f64 = 270.0;
    const H: f64 = 92.0;
    const LEFT: f64 = 100.0;
    const TOP: f64 = 62.0;
    const NAME: Text = Text { bold: true, ..Text::PLAIN };
    let columns = policies().len();
    let (width, height) = (LEFT + W * columns as f64 + 10.0, TOP + H * (cases.len() / columns) as f64 + 10.0);
    let title = "End-to-end latency by run-time model and busy policy";
    let mut canvas = Canvas::default();
    canvas.text((10.0, 20.0), title, Text::TITLE);
    let what = "age of the newest frame behind each command, 0 to 600 ms; lines: p50, p99, p99.9";
    canvas.text((10.0, 36.0), what, Text::SOFT);
    for (k, case) in cases.iter().enumerate() {
        let (x, y) = (LEFT + W * (k % columns) as f64, TOP + H * (k / columns) as f64);
        if k < columns {
            canvas.text((x, TOP - 8.0), case.policy, NAME);
        }
        if k % columns == 0 {
            canvas.text((10.0, y + 40.0), case.model, NAME);
        }
        panel(&mut canvas, case, (x, y), (W - 18.0, H - 28.0));
    }
    canvas.finish(width, height, title)
}

fn panel(canvas: &mut Canvas, case: &Case, corner: (f64, f64), size: (f64, f64)) {
    let bins = histogram(case);
    let most = bins.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let axes = Axes { corner, size, x: (0.0, RANGE_MS), y: (0.0, most) };
    axes.ground(canvas);
    let step = RANGE_MS / BINS as f64;
    for (bin, share) in bins.iter().enumerate().filter(|(_, share)| **share > 0.0) {
        let (left, bottom) = axes.at(step * bin as f64, 0.0);
        let (right, top) = axes.at(step * (bin + 1) as f64, *share);
        let tall = (bottom - top).max(1.0);
        canvas.rect((left, bottom - tall), (right - left - 0.6, tall), Style::fill(color::EGO));
    }
    let figures = SHARES.map(|share| case.ages[4].at(share));
    for (ms, paint) in figures.iter().zip([color::PLAN, color::SIGHT, color::ALARM]) {
        let at = ms.min(RANGE_MS);
        canvas.line(axes.at(at, 0.0), axes.at(at, most), Style::line(paint, 1.4).dashed(3.0, 2.0));
    }
    axes.frame(canvas);
    let [p50, p99, p999] = figures;
    let through = 100.0 * case.through;
    let text = format!("p50 {p50:.0}  p99 {p99:.0}  p99.9 {p999:.0} ms, {through:.0} % of frames");
    canvas.text((corner.0, corner.1 + size.1 + 12.0), &text, Text { size: 10.0, ..Text::SOFT });
}

/// `swerve timing` of a chain of 20 operators, 2 million steps, including its output.
fn timing(rows: &mut Rows) {
    const STEPS: f64 = 2e6;
    const ROUNDS: usize = 7;
    let mut text = "span_ms = 1999999\n".to_owned();
    for k in 0..20 {
        let reads = if k == 0 { "every_ms = 20".to_owned() } else { format!("at = [\"operator{}\"]", k - 1) };
        let _infallible =
            write!(text, "[[operator]]\nname = \"operator{k}\"\n{reads}\nruntime = {{ fixed_ms = 1 }}\n");
    }
    let pipeline = swerve_timing::parse("chain", &text).expect("a sound pipeline");
    let (mut rates, mut bytes) = (vec![], 0.0_f64);
    for _ in 0..ROUNDS {
        let (before_kib, began) = (resident_kib(), now());
        let tally = swerve_timing::tally(&pipeline, 1, 1).expect("a sound run");
        let table = swerve_timing::table(&pipeline, &tally);
        rates.push(STEPS / began.elapsed().as_secs_f64() * 1e-6);
        // Later rounds reuse the memory of the first.
        bytes = bytes.max(resident_kib().saturating_sub(before_kib) as f64 * 1024.0 / STEPS);
        assert_eq!(tally.operators.iter().map(|operator| operator.steps).sum::<u64>(), STEPS as u64);
        black_box(table);
    }
    let rates = Sample::new(rates);
    let what = "swerve timing, chain of 20: steps per second";
    rows.row(what, rates.median(), &rates.text(2, "M"), Goal::Least(2.0));
    let what = "  memory that it takes, per step";
    match bytes {
        0.0 => rows.skipped(what, "the system does not report it"),
        _ => rows.row(what, bytes, &format!("{bytes:.0} bytes"), Goal::Most(32.0)),
    }
}

fn main() -> std::io::Result<()> {
    if !is_asked_to_measure() {
        return Ok(());
    }
    let folder = env!("CARGO_TARGET_TMPDIR");
    let mut rows = Rows::new(folder, "latency");
    if is_asked("timing") {
        timing(&mut rows);
    }
    if !is_asked("policies") {
        rows.finish();
        return Ok(());
    }
    let mut cases = Vec::new();
    for model in models() {
        for policy in policies() {
            cases.push(run(model.clone(), policy));
        }
    }
    print(
        "milliseconds, p50 / p99 / p99.9: age of the stamp at publication; end to end: age of the frame behind a command",
    );
    print(&table(&cases));
    let path = Path::new(folder).join("latency.svg");
    std::fs::write(&path, picture(&cases).svg())?;
    for case in cases.iter().filter(|case| case.model == "log-normal") {
        let [p50, p99, p999] = SHARES.map(|share| case.ages[4].at(share));
        let what = format!("end to end, detector log-normal 75 ms, {}", case.policy);
        rows.row(&what, p99, &format!("p50 {p50:.0} p99 {p99:.0} p99.9 {p999:.0} ms"), Goal::None);
    }
    rows.finish();
    print(&format!("drawn in {}", path.display()));
    Ok(())
}
