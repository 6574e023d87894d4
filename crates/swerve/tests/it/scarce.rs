//! Oversized inputs and scarce resources: messages stay short and clear, and time is bounded.

use std::fmt::Write as _;

use crate::support::{Bench, Said};

/// Processor time on a busy host relative to an idle one.
const BUSY: u32 = 5;

/// Runs the program with limited processor time, in seconds of an idle host.
fn within_s(bench: &Bench, seconds: u32, args: &str) -> Said {
    let line = format!("ulimit -t {}; ulimit -c 0; exec swerve {args}", BUSY * seconds);
    Said::of(&bench.shell_command(&line).output().unwrap())
}

const ROAD: &str = "description = 'A road.'\n[road]\nsegments = [{ length_m = 1000.0 }]\nlane_width_m = 4.0\n\
                    left_m = 90.0\nright_m = 90.0\n[ego]\ntarget_speed_mps = 8.0\nend_m = 900.0\n[end]\ntimeout_s = 1.0\n";

fn actor(name: &str, kind: &str, s_m: f64, d_m: f64) -> String {
    format!("[[actor]]\nname = \"{name}\"\nkind = \"{kind}\"\ns_m = {s_m:.3}\nd_m = {d_m:.3}\n")
}

#[test]
fn names_of_a_megabyte_are_refused_at_once_in_a_short_message() {
    let bench = Bench::new();
    let long = "x".repeat(1 << 20);
    let scenario = |name: &str, more: &str| format!("name = \"{name}\"\n{ROAD}{more}");
    let files = [
        (scenario(&long, ""), 1, "name: "),
        (scenario("n", &actor(&long, "car", 50.0, 2.0)), 14, "actor[0].name: "),
        (scenario("n", &actor("a", &long, 50.0, 2.0)), 15, "actor[0].kind: "),
        (scenario("n", &format!("{long} = 1\n")), 13, "end.xxx"),
        (scenario("n", &format!("[{long}]\n")), 13, "xxx"),
        (scenario("n", "").replace("A road.", &long), 2, "description: "),
        (format!("[operator.{long}]\nkind = \"tracker\"\n"), 1, "operator."),
        (format!("[operator.a]\nkind = \"{long}\"\n"), 2, "operator.a.kind: "),
        (format!("[operator.a]\nreads = {{ x = \"{long}\" }}\n"), 2, "operator.a.reads.x: "),
        (format!("[process.{long}]\noperators = [\"planner\"]\n"), 1, "process."),
        (format!("[process.a]\noperators = [\"{long}\"]\n"), 2, "process.a.operators[0]: "),
        (format!("[fault.a]\nstream = \"{long}\"\ndrop = true\n"), 2, "fault.a.stream: "),
        (format!("[fault.{long}]\nstream = \"obstacles\"\ndrop = true\n"), 1, "fault."),
        (format!("[camera.{long}]\n"), 1, "camera."),
        (format!("[planning]\nplanner = \"{long}\"\n"), 2, "planning.planner: "),
        (format!("{long} = 1\n"), 1, "xxx"),
    ];
    for (text, line, key) in files {
        bench.write("long.toml", &text);
        let said = within_s(&bench, 1, "check long.toml");
        assert!(said.code == Some(1), "{key}: {:?}", said.code);
        let place = format!("long.toml:{line}: {key}");
        assert!(said.stderr.starts_with(&place), "{place}: {}", &said.stderr[..said.stderr.len().min(300)]);
        let bound = said.stderr.contains("has 1048576 characters: expected at most ");
        assert!(bound && said.stderr.len() < 600, "{} bytes: {:.700}", said.stderr.len(), said.stderr);
    }
}

#[test]
fn names_within_the_text_limit_are_refused_in_a_short_message_too() {
    let bench = Bench::new();
    let long = "x".repeat(9_000);
    let actors: String = (0..10_000).map(|i| actor(&format!("{i}{long:.900}"), "car", 50.0, 2.0)).collect();
    bench.write("many.toml", &format!("name = 'n'\n{ROAD}{actors}"));
    let said = within_s(&bench, 2, "check many.toml");
    let first = said.stderr.lines().next().unwrap_or_default();
    assert!(first.starts_with("many.toml:14: actor"), "{first}");
    assert!(first.ends_with(": has 901 characters: expected at most 200") && first.len() < 600, "{first}");
    for text in [format!("[operator.a]\nkind = \"{long}\"\n"), format!("[planning]\nplanner = \"{long}\"\n")]
    {
        bench.write("long.toml", &text);
        let said = within_s(&bench, 1, "check long.toml");
        assert!(said.code == Some(1) && said.stderr.len() < 4_000, "{said:?}");
        assert!(said.stderr.starts_with("long.toml:2: "), "{said:?}");
    }
}

/// A crowd of actors on a grid.
fn crowd(count: usize, kind: &str, spacing_m: f64, beside_m: f64) -> String {
    (0..count).fold(format!("name = 'crowd'\n{ROAD}"), |mut text, i| {
        let (row, column) = (i / 100, i % 100);
        let s_m = 10.0 + spacing_m * column as f64;
        text.write_str(&actor(&format!("a{i}"), kind, s_m, beside_m + spacing_m * 0.5 * row as f64)).unwrap();
        text
    })
}

#[test]
fn ten_thousand_actors_are_checked_apart_and_overlapping() {
    let bench = Bench::new();
    bench.write("apart.toml", &crowd(10_000, "pedestrian", 1.6, 6.0));
    assert_eq!(within_s(&bench, 2, "check apart.toml").stdout, "1 file, no problem\n");
    for spacing_m in [0.0, 0.01, 1.0] {
        bench.write("over.toml", &crowd(10_000, "car", spacing_m, 8.0));
        let said = within_s(&bench, 2, "check over.toml");
        assert!(said.code == Some(1) && said.stderr.lines().count() < 200, "{:.600}", said.stderr);
        assert!(said.stderr.contains("more start inside others"), "{:.600}", said.stderr);
    }
    bench.write("more.toml", &crowd(100_000, "car", 1.0, 8.0));
    let said = within_s(&bench, 4, "check more.toml");
    assert!(
        said.stderr
            .contains("more.toml:13: actor: expected at most 20000 tables, found an array of 100000\n"),
        "{:.600}",
        said.stderr
    );
}

/// Each person is visible over those in front: 10,000 lines of sight to nine points each, 20 times a second.
#[test]
fn ten_thousand_people_can_be_simulated() {
    let bench = Bench::new();
    bench.write("crowd.toml", &crowd(10_000, "pedestrian", 1.6, 6.0));
    let said = within_s(&bench, 24, "run crowd.toml --out o --overwrite");
    assert!(matches!(said.code, Some(0 | 1)) && said.stdout.contains("digest"), "{said:?}");
}

#[test]
fn descriptor_shortage_is_named() {
    let bench = Bench::new();
    bench.write("two.toml", "[process.perception]\noperators = [\"tracker\"]\n");
    bench.write("car.toml", "[live]\nroute = \"short.toml\"\n");
    let (mut refused, mut driven) = (0, 0);
    for most in [4, 5, 6, 7, 8, 10, 12, 16, 20, 24, 32, 48] {
        for args in [
            "run short.toml --out o --overwrite",
            "run short.toml -c two.toml --out o --overwrite",
            "live car.toml --out o --overwrite",
            "suite short.toml --seeds 1",
            "check short.toml",
        ] {
            let line = format!("ulimit -n {most}; ulimit -c 0; exec timeout -k 5 20 swerve {args}");
            let said = Said::of(&bench.shell_command(&line).output().unwrap());
            let is_named = said.stderr.contains("Too many open files") || said.stderr.contains("`ulimit -n`");
            match said.code {
                Some(0) => driven += 1,
                Some(1) if is_named => refused += 1,
                // It waits for a vehicle.
                Some(124) if args.starts_with("live") => driven += 1,
                _ => panic!("{most} descriptors, {args}: {said:?}"),
            }
        }
    }
    assert!(refused >= 20 && driven >= 20, "{refused} refused, {driven} driven");
}

/// In a separate mount namespace, as root of a user namespace; skipped if the system does not allow it.
#[test]
fn unavailable_shared_memory_is_named_by_run_and_doctor() {
    let bench = Bench::new();
    bench.write("two.toml", "[process.perception]\noperators = [\"tracker\"]\n");
    let with = |mount: &str, args: &str| {
        bench.shell(&format!("unshare --map-root-user --mount sh -c '{mount} && swerve {args}'"))
    };
    if with("true", "check short.toml").code != Some(0) {
        return;
    }
    let absent = "mount -t tmpfs tmpfs /dev && ln -s /proc/self/fd /dev/fd && : > /dev/null";
    for (mount, says) in [
        ("mount -t tmpfs -o ro tmpfs /dev/shm", "Read-only file system"),
        (absent, "No such file or directory"),
    ] {
        let run = with(mount, "run short.toml -c two.toml --out o --overwrite");
        let expected = format!("shared memory in /dev/shm: {says}");
        assert!(run.code == Some(1) && run.stderr.contains(&expected), "{run:?}");
    }
    let doctor = with("mount -t tmpfs -o ro tmpfs /dev/shm", "doctor").stdout;
    assert!(doctor.contains("/dev/shm: this user may not write there (Read-only file system"), "{doctor}");
}
