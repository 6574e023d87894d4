//! What is not there: a file that is named, a key, anything to check.

use crate::support::Bench;

#[test]
fn a_route_that_is_missing_is_told_with_what_else_is_wrong() {
    let bench = Bench::new();
    bench.write(
        "car.toml",
        "[live]\nroute = \"none.toml\"\nplan_timeout_s = 99\n[control]\ncontroller = \"mpc\"\n",
    );
    for args in [&["live", "car.toml", "--out", "o"][..], &["check", "car.toml"]] {
        let says = [
            "car.toml:3: live.plan_timeout_s: expected 0.05 to 10, found 99\n",
            "car.toml:2: live.route: there is no file none.toml: expected a scenario\n",
        ];
        let said = bench.swerve(args);
        says.iter().for_each(|says| {
            assert!(
                format!("{}\n", said.stderr).contains(says),
                "{args:?} does not say `{says}`: {}",
                said.stderr
            )
        });
    }
}

/// A configuration may leave out every key, and is one to every command.
#[test]
fn an_empty_configuration_is_taken() {
    let bench = Bench::new();
    bench.write("empty.toml", "# nothing yet\n");
    assert_eq!(bench.good(&["check", "empty.toml"]), "1 file, no problem\n");
    bench.good(&["graph", "short.toml", "-c", "empty.toml"]);
}

#[test]
fn check_says_what_to_check_where_there_is_nothing() {
    let bench = Bench::new();
    let said = bench.shell("mkdir nothing && cd nothing && swerve check");
    for says in ["error: there is no folder scenarios and no folder configs", "`swerve new my_project`"] {
        assert!(said.code == Some(1) && said.stderr.contains(says), "{said:?}");
    }
}

#[test]
fn check_names_the_files_of_a_folder_of_ones_own() {
    let bench = Bench::new();
    let said = bench.shell("swerve new mine && cd mine && swerve check");
    assert!(said.stderr.contains("(`swerve check config.toml own.toml scenario.toml`)"), "{said:?}");
}

/// Who pipes standard error into `head` gets what he asked for, and the program ends in order.
#[test]
fn standard_error_that_nobody_reads_any_more_is_no_panic() {
    let bench = Bench::new();
    let said = bench.shell("(swerve check /nowhere.toml /nowhere2.toml 2>&1 >/dev/null; echo $? >code) | true; sleep 0.2; cat code");
    assert_eq!(said.stdout.trim(), "1", "{said:?}");
}
