//! Solutions written and read again, and damaged ones.

use swerve_geom::Point2;

use crate::{CostFunction, Driven, Model, Solution, SolutionState, VehicleKind, misses};

fn driven(model: Model, problem: u32) -> Driven {
    let state = |step: u32| SolutionState {
        step,
        position: Point2::new(f64::from(step) * 1.0 / 3.0, 0.1),
        speed_mps: 10.0 / 3.0,
        ..SolutionState::default()
    };
    let states = (0..4).map(state).collect();
    Driven { problem, model, vehicle: VehicleKind::Bmw320i, cost: CostFunction::Sm1, states }
}

#[test]
fn written_solution_is_read_with_the_same_values() {
    for model in [Model::Pm, Model::Ks, Model::St] {
        let solution =
            Solution { benchmark: "A-1_1_T-1".to_owned(), driven: vec![driven(model, 3), driven(model, 4)] };
        let again = Solution::read("again.xml", &solution.to_xml()).unwrap();
        assert_eq!(again, solution, "{}", solution.to_xml());
    }
}

#[test]
fn damaged_solutions_are_refused() {
    let solution = Solution { benchmark: "A-1_1_T-1".to_owned(), driven: vec![driven(Model::Ks, 3)] };
    let text = solution.to_xml();
    let cases = [
        ("KS2:", "MB2:", "expected a vehicle PM, KS or ST"),
        ("KS2:", "KS9:", "expected a vehicle PM, KS or ST"),
        (":SM1:", ":SM9:", "expected one of JB1, SA1"),
        ("KS2:", "[KS2,KS2]:", "expected as many vehicles as trajectories, found 2 and 1"),
        ("<time>1</time>", "<time>9</time>", "one for each time step"),
        ("<time>1</time>", "<time>NaN</time>", "whole number of time steps"),
        ("<velocity>", "<speed>", "it is not XML"),
        ("ksTrajectory", "stTrajectory", "it is not XML"),
        (":2020a", ":2024a", "expected version 2020a"),
    ];
    for (from, to, message) in cases {
        let error = Solution::read("bad.xml", &text.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(message) && error.starts_with("bad.xml:"), "{from}: {error}");
    }
}

#[test]
fn straight_drive_is_feasible_and_a_jump_states_step_and_distance() {
    for model in [Model::Pm, Model::Ks, Model::St] {
        let mut driven = driven(model, 3);
        assert_eq!(misses(&driven, 0.1), [], "{model:?}");
        driven.states[2].position.y_m += 0.5;
        let missed = misses(&driven, 0.1);
        assert_eq!(missed.first().map(|miss| miss.step), Some(2), "{model:?}");
        assert!((0.3..=0.5).contains(&missed[0].distance_m()), "{model:?}: {missed:?}");
    }
}
