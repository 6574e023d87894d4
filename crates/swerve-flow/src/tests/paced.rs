//! Runs paced by simulated time.

use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use swerve_core::Time;

use super::net::*;
use crate::*;

/// Keeps the instants of its steps.
struct Note(Arc<Mutex<Vec<Time>>>);

impl Operator for Note {
    type In = Every;
    type Out = ();
    fn step(&mut self, cx: &mut Context<'_>, _: &Every, _: &mut ()) {
        self.0.lock().unwrap().push(cx.stamp());
    }
}

#[test]
fn paced_run_executes_the_instants_that_simulated_time_has_reached_and_no_others() {
    let (noted, clock) = (Arc::default(), SimulatedTime::new());
    let mut graph = Graph::new();
    graph.add("note", Note(Arc::clone(&noted)), every(ms(10))).out();
    let stop = graph.stop_handle();
    let runs = clock.clone();
    let run = thread::spawn(move || run_paced(graph, &RunOptions::default(), vec![], &runs));
    let steps = |n: usize| {
        let begin = crate::host::now();
        while noted.lock().unwrap().len() < n && crate::host::ns_since(begin) < 10_000_000_000 {
            thread::park_timeout(Duration::from_millis(1));
        }
        // Real time passes, simulated time does not.
        thread::park_timeout(Duration::from_millis(50));
        noted.lock().unwrap().clone()
    };
    assert_eq!(steps(1), [Time::ZERO]);
    clock.advance(Time::from_ms(25));
    assert_eq!(steps(3), [0, 10, 20].map(Time::from_ms));
    // An earlier time does not change it.
    clock.advance(Time::from_ms(5));
    clock.advance(Time::from_ms(30));
    assert_eq!(steps(4).last(), Some(&Time::from_ms(30)));
    assert_eq!(clock.now(), Time::from_ms(30));
    stop.stop();
    let report = run.join().unwrap().unwrap();
    assert_eq!(report.end, EndReason::Interrupted);
    assert_eq!(noted.lock().unwrap().len(), 4);
}
