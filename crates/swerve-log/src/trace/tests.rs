//! Tests of the trace writer.

use serde_json::Value;

use super::*;

const fn ms(ms: i64) -> Time {
    Time::from_ms(ms)
}

fn none<'a>() -> impl Iterator<Item = (&'a str, Option<Time>)> {
    core::iter::empty()
}

fn parsed(text: &[u8]) -> Vec<Value> {
    let mut trace: Value = serde_json::from_slice(text).unwrap();
    let Value::Array(events) = trace["traceEvents"].take() else { panic!("an array of events") };
    events
}

fn of<'a>(events: &'a [Value], phase: &'a str) -> impl Iterator<Item = &'a Value> {
    events.iter().filter(move |e| e["ph"] == phase)
}

/// Start and end of a slice, ns.
fn bounds(slice: &Value) -> (i64, i64) {
    let ns = |value: &Value| (value.as_f64().unwrap() * 1000.0).round() as i64;
    (ns(&slice["ts"]), ns(&slice["ts"]) + ns(&slice["dur"]))
}

#[test]
fn trace_puts_overlapping_steps_on_separate_tracks() {
    let mut text = Vec::new();
    let mut trace = TraceWriter::to(Path::new("t"), &mut text, &[]);
    for k in 0..40 {
        if k >= 11 {
            trace.step_end("planner", ms(50 * (k - 11)), ms(50 * k), 9, false);
        }
        trace.step_start("planner", ms(50 * k), ms(50 * k), none());
    }
    trace.dropped("planner", ms(1), ms(2000), "skipped");
    trace.finish().unwrap();
    let events = parsed(&text);
    let slices: Vec<_> = of(&events, "X").collect();
    assert_eq!(slices.len(), 40, "eleven of them unfinished");
    let mut last = BTreeMap::new();
    for slice in &slices {
        let (start, end) = bounds(slice);
        let free = last.insert(slice["tid"].as_i64().unwrap(), end).unwrap_or(0);
        assert!(start >= free, "slices of a track do not overlap");
    }
    assert_eq!(last.len(), 11, "550 ms at 50 ms take eleven lanes");
    let names: Vec<_> = of(&events, "M").filter(|e| e["name"] == "thread_name").collect();
    assert_eq!((names.len(), &names[1]["args"]["name"]), (11, &Value::from("planner (2)")));
    assert_eq!(slices[0]["args"]["run_time_ms"], 550.0);
    assert_eq!(slices[0]["args"]["units"], 9);
    assert_eq!(of(&events, "i").count(), 1);
}

#[test]
fn trace_is_valid_json_when_dropped_early() {
    let mut text = Vec::new();
    let mut trace = TraceWriter::to(Path::new("t"), &mut text, &[]);
    trace.step_start("a \"quoted\" name", ms(0), ms(3), none());
    trace.trace.instant("b", ms(5), "missed, skip", ms(1));
    drop(trace);
    let events = parsed(&text);
    let slice = of(&events, "X").next().unwrap();
    assert_eq!((&slice["name"], &slice["args"]["note"]), (&"a \"quoted\" name".into(), &"unfinished".into()));
    assert_eq!(bounds(slice), (3_000_000, 5_000_000));
}

#[test]
fn trace_times_have_nanosecond_resolution() {
    assert_eq!(Micros(1_234_567).to_string(), "1234.567");
    assert_eq!(Micros(5).to_string(), "0.005");
    assert_eq!(Micros(-1_001).to_string(), "-1.001");
}

#[test]
fn trace_writer_reports_a_full_disk_on_finish() {
    struct Full;
    impl Write for Full {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::Error::other("no space left"))
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let error = TraceWriter::to(Path::new("out/trace.json"), Full, &[]).finish().unwrap_err();
    assert_eq!(error.to_string(), "out/trace.json: cannot write: no space left");
}
