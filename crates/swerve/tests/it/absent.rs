//! Missing inputs: a named file, a key, a folder with nothing to check.

use crate::support::Bench;

#[test]
fn missing_route_is_reported_with_all_other_problems() {
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

/// A configuration may omit every key; every command accepts it.
#[test]
fn empty_configuration_is_accepted_by_every_command() {
    let bench = Bench::new();
    bench.write("empty.toml", "# nothing yet\n");
    assert_eq!(bench.good(&["check", "empty.toml"]), "1 file, no problem\n");
    bench.good(&["graph", "short.toml", "-c", "empty.toml"]);
}

#[test]
fn check_suggests_a_command_in_a_folder_without_files() {
    let bench = Bench::new();
    let said = bench.shell("mkdir nothing && cd nothing && swerve check");
    for says in ["error: there is no folder scenarios and no folder configs", "`swerve new my_project`"] {
        assert!(said.code == Some(1) && said.stderr.contains(says), "{said:?}");
    }
}

#[test]
fn check_names_the_files_of_a_custom_folder() {
    let bench = Bench::new();
    let said = bench.shell("swerve new mine && cd mine && swerve check");
    assert!(said.stderr.contains("(`swerve check config.toml own.toml scenario.toml`)"), "{said:?}");
}

/// Closing the pipe of standard error (`2>&1 | head`) ends the program in order.
#[test]
fn closed_standard_error_does_not_panic() {
    let bench = Bench::new();
    let said = bench.shell("(swerve check /nowhere.toml /nowhere2.toml 2>&1 >/dev/null; echo $? >code) | true; sleep 0.2; cat code");
    assert_eq!(said.stdout.trim(), "1", "{said:?}");
}
