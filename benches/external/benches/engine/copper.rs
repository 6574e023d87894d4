//! The same chains on copper: task lists, each compiled in from a file; all tasks run in every iteration.

use std::hint::black_box;
use std::path::Path;

use cu29::prelude::*;
use swerve_benches::now;

use crate::{LENGTHS, Small, changed, check, see};

#[derive(Reflect)]
struct Source(u64);
impl Freezable for Source {}
impl CuSrcTask for Source {
    type Resources<'r> = ();
    type Output<'m> = output_msg!(Small);
    fn new(_: Option<&ComponentConfig>, (): ()) -> CuResult<Self> {
        Ok(Self(0))
    }
    fn process(&mut self, _: &CuContext, output: &mut Self::Output<'_>) -> CuResult<()> {
        output.set_payload([self.0; 8]);
        self.0 += 1;
        Ok(())
    }
}

#[derive(Reflect)]
struct Hop;
impl Freezable for Hop {}
impl CuTask for Hop {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(Small);
    type Output<'m> = output_msg!(Small);
    fn new(_: Option<&ComponentConfig>, (): ()) -> CuResult<Self> {
        Ok(Self)
    }
    fn process<'i, 'o>(
        &mut self,
        _: &CuContext,
        input: &Self::Input<'i>,
        output: &mut Self::Output<'o>,
    ) -> CuResult<()> {
        if let Some(small) = input.payload() {
            output.set_payload(changed(small));
        }
        Ok(())
    }
}

#[derive(Reflect)]
struct Sink;
impl Freezable for Sink {}
impl CuSinkTask for Sink {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(Small);
    fn new(_: Option<&ComponentConfig>, (): ()) -> CuResult<Self> {
        Ok(Self)
    }
    fn process(&mut self, _: &CuContext, input: &Self::Input<'_>) -> CuResult<()> {
        if let Some(small) = input.payload() {
            see(small);
        }
        Ok(())
    }
}

/// Clock that copper reads twice around each task.
#[derive(Clone, Copy)]
pub enum Clock {
    /// Processor counter, as in any application.
    Real,
    /// A variable: cost of a hop without clock readings.
    Mock,
}

/// One chain: copper supports one runtime per module, with its configuration at compile time.
macro_rules! chain {
    ($name:ident, $hops:literal, $config:tt, |$builder:ident, $with:ident: $kind:ty| $built:expr) => {
        mod $name {
            use super::*;

            #[copper_runtime(config = $config)]
            struct App {}

            /// Nanoseconds per iteration.
            pub(super) fn frame_ns(frames: u64, $with: $kind) -> CuResult<f64> {
                let $builder = App::builder();
                let mut app = $built.build()?.start()?;
                let began = now();
                for _ in 0..frames {
                    app.run_one_iteration()?;
                }
                let ns = began.elapsed().as_nanos() as f64;
                app.stop()?;
                check(frames, $hops);
                Ok(ns / frames as f64)
            }
        }
    };
}

macro_rules! silent {
    ($name:ident, $hops:literal, $config:tt) => {
        chain!($name, $hops, $config, |builder, clock: Clock| match clock {
            Clock::Real => builder,
            Clock::Mock => builder.with_clock(RobotClock::mock().0),
        });
    };
}

macro_rules! logged {
    ($name:ident, $hops:literal, $config:tt) => {
        chain!($name, $hops, $config, |builder, file: &Path| builder.with_log_path(file, Some(64 << 20))?);
    };
}

silent!(chain_1, 1, "benches/engine/copper/chain_1.ron");
silent!(chain_2, 2, "benches/engine/copper/chain_2.ron");
silent!(chain_4, 4, "benches/engine/copper/chain_4.ron");
silent!(chain_8, 8, "benches/engine/copper/chain_8.ron");
logged!(logged_1, 1, "benches/engine/copper/logged_1.ron");
logged!(logged_2, 2, "benches/engine/copper/logged_2.ron");
logged!(logged_4, 4, "benches/engine/copper/logged_4.ron");
logged!(logged_8, 8, "benches/engine/copper/logged_8.ron");

/// Nanoseconds per iteration of each length, without logging.
pub fn frames_ns(clock: Clock) -> [f64; LENGTHS.len()] {
    [chain_1::frame_ns, chain_2::frame_ns, chain_4::frame_ns, chain_8::frame_ns]
        .map(|frame_ns| frame_ns(100_000, clock).expect("copper runs"))
}

/// Same as [`frames_ns`], with copper's log of every message in a temporary file in `folder`.
pub fn logged_frames_ns(folder: &Path) -> [f64; LENGTHS.len()] {
    [logged_1::frame_ns, logged_2::frame_ns, logged_4::frame_ns, logged_8::frame_ns].map(|frame_ns| {
        let folder = folder.join("copper");
        std::fs::create_dir_all(&folder).expect("Cargo's folder takes files");
        let ns = frame_ns(20_000, &folder.join("log.copper")).expect("copper runs");
        std::fs::remove_dir_all(&folder).expect("the log's folder is ours");
        ns
    })
}

/// Nanoseconds of one reading of copper's clock.
pub fn reading_ns(readings: u64) -> f64 {
    let clock = RobotClock::new();
    let began = now();
    for _ in 0..readings {
        black_box(clock.now());
    }
    began.elapsed().as_nanos() as f64 / readings as f64
}
