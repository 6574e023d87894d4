//! What a search allocates once its memory has grown, counted. One test in a program of its own: nothing else runs
//! beside it.

#![expect(unsafe_code, reason = "a counting allocator has to implement an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use swerve_planning::Unlimited;
use swerve_pylot::Preset;
use swerve_pylot::posed::{
    HybridAstarConfig, HybridAstarProblem, Outcome, RrtStarConfig, RrtStarProblem, hybrid_astar, rrt_star,
};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: `place` came from `alloc` with this layout.
        unsafe { System.dealloc(place, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Allocations of the second call.
fn second(mut call: impl FnMut() -> Outcome) -> usize {
    assert_eq!(call(), Outcome::Found);
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    assert_eq!(call(), Outcome::Found);
    ALLOCATIONS.load(Ordering::Relaxed) - before
}

#[test]
fn searches_allocate_nothing_once_grown() {
    let obstacles = vec![[13.75, -0.75, 14.25, 1.95], [20.0, -4.0, 22.0, -2.5]];
    let problem = RrtStarProblem {
        start: [0.0, 0.0],
        goal: [30.0, 0.0],
        obstacles: obstacles.clone(),
        ..Default::default()
    };
    let config = RrtStarConfig {
        step_size: 0.5,
        max_iterations: 2000,
        end_dist_threshold: 2.0,
        obstacle_clearance: 1.0,
        lane_width: 5.0,
    };
    for preset in [Preset::Paper, Preset::Best] {
        let mut solver = rrt_star::Solver::default();
        let count = second(|| solver.search(&problem, &config, preset, &mut Unlimited::default()));
        assert_eq!(count, 0, "RRT*, {preset:?}");
    }
    let problem = HybridAstarProblem {
        start: [0.0, 0.0, 0.0],
        goal: [30.0, 0.0, 0.0],
        obstacles,
        ..Default::default()
    };
    let config = HybridAstarConfig {
        step_size: 3.0,
        max_iterations: 500,
        completion_threshold: 1.0,
        angle_completion_threshold: 100.0,
        rad_step: 0.75,
        rad_upper_range: 4.0,
        rad_lower_range: 4.0,
        obstacle_clearance: 0.5,
        lane_width: 6.0,
        radius: 6.0,
        car_length: 4.8,
        car_width: 1.8,
    };
    for preset in [Preset::Paper, Preset::Best] {
        let mut solver = hybrid_astar::Solver::default();
        let count = second(|| solver.search(&problem, &config, preset, &mut Unlimited::default()));
        assert_eq!(count, 0, "Hybrid A*, {preset:?}");
    }
}
