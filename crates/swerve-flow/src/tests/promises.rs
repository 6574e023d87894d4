//! Work that a step passes to other threads does not affect the result.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use swerve_core::{Digest, Time};

use super::net::*;
use crate::*;

/// Number of frames of one camera being made, and its maximum.
#[derive(Clone, Default)]
struct Making(Arc<(AtomicUsize, AtomicUsize)>);

/// Outcome of the frame at 100 ms.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Drawn,
    Fails,
    Panics,
}

/// Publishes an image and a sum at every tick, computed by other threads of the run if there are any.
struct Camera {
    making: Making,
    fate: Fate,
}

/// Takes a while to compute an image, a function of the stamp alone.
fn drawn(stamp: Time) -> Vec<u64> {
    let mut x = stamp.ns() as u64;
    for k in 0..50_000 {
        x = (x ^ k).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 3;
    }
    (0..100).map(|k| k * (x % 1_000_000)).collect()
}

impl Operator for Camera {
    type In = Every;
    type Out = (Port<Vec<u64>>, Port<u64>);

    fn step(&mut self, cx: &mut Context<'_>, _: &Every, (image, sum): &mut Self::Out) {
        let stamp = cx.stamp();
        let Some(workers) = cx.workers() else {
            let made = drawn(stamp);
            sum.send(made.iter().sum());
            return image.send(made);
        };
        let (image, sum) = (workers.promise(image), workers.promise(sum));
        let Making(making) = self.making.clone();
        making.1.fetch_max(making.0.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
        let fate = if stamp == at(100) { self.fate } else { Fate::Drawn };
        workers.spawn(move || {
            let made = drawn(stamp);
            assert!(fate != Fate::Panics, "a panic that is wanted");
            if fate == Fate::Fails {
                sum.fail("no light");
                return image.fail("no light");
            }
            making.0.fetch_sub(1, Ordering::SeqCst);
            sum.keep(Arc::new(made.iter().sum()));
            image.keep(Arc::new(made));
        });
    }
}

/// Reads an image in a heavy step with a run time.
struct Looks;

impl Operator for Looks {
    type In = At<Vec<u64>>;
    type Out = Port<u64>;

    fn step(&mut self, _: &mut Context<'_>, image: &At<Vec<u64>>, out: &mut Port<u64>) {
        out.send(image.get().map_or(0, |image| image[99]));
    }
}

struct Glances;

impl Operator for Glances {
    type In = (Every, Window<Vec<u64>, 3>, Latest<u64>);
    type Out = Port<u64>;

    fn step(&mut self, _: &mut Context<'_>, (_, images, sum): &Self::In, out: &mut Port<u64>) {
        let seen: u64 = images.get().iter().map(|image| image[99]).sum();
        out.send(seen + sum.get().map_or(0, |sum| **sum));
    }
}

/// Three cameras, of which two tick together.
fn cameras(is_read: bool, fate: Fate) -> (Graph, Vec<Making>) {
    let (mut graph, mut all) = (Graph::new(), Vec::new());
    for (k, phase) in [0, 0, 7].into_iter().enumerate() {
        let making = Making::default();
        all.push(making.clone());
        let tick = every(ms(20)).phase(ms(phase));
        let (image, sum) = graph.add(format!("camera{k}"), Camera { making, fate }, tick).out();
        if is_read {
            let _read_by_none = graph.add(format!("looks{k}"), Looks, image).runtime(fixed(15)).heavy().out();
            graph.add(format!("glances{k}"), Glances, (every(ms(9)), image, sum));
        }
    }
    (graph, all)
}

/// Stream, stamp and digest of every publication.
type Publications = Vec<(String, Option<Time>, Option<Digest>)>;

#[test]
fn s3_work_on_other_threads_does_not_change_the_result() {
    let run = |is_read: bool, threads: usize, with_observer: bool| {
        let (graph, all) = cameras(is_read, Fate::Drawn);
        let mut seen = Publications::new();
        let mut see = |event: &Event<'_>| {
            if let Event::Publication(p) = event {
                seen.push((p.stream.to_owned(), p.stamp, p.payload.map(Sent::digest)));
            }
        };
        let observers: Vec<&mut dyn Observer> = if with_observer { vec![&mut see] } else { vec![] };
        let options = RunOptions::until(at(400)).threads(threads);
        let report = run_virtual(graph, &options, observers).unwrap();
        let most = all.iter().map(|making| making.0.1.load(Ordering::SeqCst)).max();
        (report.digest, report.operators, seen, most)
    };
    for is_read in [false, true] {
        let (digest, operators, seen, most) = run(is_read, 1, true);
        assert_eq!(most, Some(0), "one thread leaves nothing to others");
        assert!(seen.len() > 100);
        for threads in [2, 3, 8] {
            let (other, others, all_seen, most) = run(is_read, threads, true);
            assert_eq!((other, &others, &all_seen), (digest, &operators, &seen), "{threads} threads");
            assert!((1..=2).contains(&most.unwrap()), "what waits is bounded: {most:?}");
            assert_eq!(run(is_read, threads, false).0, digest);
        }
    }
}

#[test]
fn s3_a_session_returns_promised_payloads() {
    let newest = |threads: usize| {
        let (graph, _) = cameras(false, Fate::Drawn);
        let mut session = Session::new(graph, &RunOptions::until(at(200)).threads(threads), vec![]).unwrap();
        let stream = session.watch("camera0.0", 1).unwrap();
        assert_eq!(session.advance_to(at(100)), Reached::Instant);
        let (header, image) = session.newest(stream).unwrap();
        assert_eq!(header.stamp, at(100));
        let image: Vec<u64> = (**image).as_any().downcast_ref::<Vec<u64>>().unwrap().clone();
        session.advance();
        (image, session.finish().unwrap().digest)
    };
    assert_eq!(newest(1), newest(3));
    assert_eq!(newest(1).0, drawn(at(100)));
}

#[test]
fn s3_a_promise_that_is_not_kept_ends_the_run_by_name() {
    for (is_read, fate, why) in [
        (false, Fate::Fails, "no light"),
        (true, Fate::Fails, "no light"),
        (false, Fate::Panics, "panicked there"),
        (true, Fate::Panics, "panicked there"),
    ] {
        let (graph, _) = cameras(is_read, fate);
        let error = run_virtual(graph, &RunOptions::until(at(2000)).threads(3), vec![]).unwrap_err();
        let RunError::Panic { operator, message } = &error else { panic!("{error}") };
        assert!(operator.starts_with("camera") && message.contains(why), "{error}");
    }
}
