use super::*;

fn study(text: &str) -> Result<Study, Problems> {
    let document = Document::parse("s.toml", text).unwrap();
    let place = (Path::new("dir"), "s".to_owned());
    document.to_checked(|file| Study::checked(&document, file, place, &[])).map(Study::expand)
}

#[test]
fn axes_multiply_and_the_last_is_fastest() {
    let study = study(
        "base = { scenario = \"a.toml\", set = { \"x.y\" = 1 } }\n\
         [[axis]]\nkey = \"planning.planner\"\nvalues = [\"fot\", \"rrt_star\"]\n\
         [[axis]]\nname = \"load\"\n[[axis.settings]]\nname = \"high\"\nset = { operator.planner.runtime.fixed_ms = 5 }\n\
         [[axis]]\nkey = \"seed\"\nvalues = [1, 2, 3]\n",
    )
    .unwrap();
    assert_eq!(study.axes, ["planner", "load", "seed"]);
    assert_eq!(study.cells.len(), 6);
    assert_eq!(study.cells[4].labels, ["rrt_star", "high", "2"]);
    let keys: Vec<&str> = study.cells[4].sets.iter().map(|(k, _)| k.as_str()).collect();
    assert_eq!(keys, ["x.y", "planning.planner", "operator.planner.runtime", "seed"]);
    assert_eq!(
        study.command(&study.cells[0]),
        "swerve run dir/a.toml --set x.y=1 --set 'planning.planner=\"fot\"' --set 'operator.planner.runtime={ fixed_ms = 5 }' --set seed=1"
    );
}

#[test]
fn what_is_in_the_program_goes_by_its_name_where_no_file_is_beside() {
    let text = "base = { scenario = \"lane\", config = \"best\" }\n[[axis]]\nkey = \"seed\"\nvalues = [1]\n";
    let study = study(text).unwrap();
    assert_eq!(study.command(&study.cells[0]), "swerve run lane -c best --set seed=1");
}

#[test]
fn nonsense_names_its_place() {
    let wrong = |text: &str| {
        let problems = study(text).expect_err("wrong on purpose");
        problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    assert_eq!(
        wrong("base = { scenario = \"a\" }\n[[axis]]\nkey = \"seed\"\nvalues = [3, 1, 3]\n"),
        "s.toml:2: axis[0]: `3` stands twice"
    );
    assert!(wrong("base = { scenario = \"a\" }\naxis = []\n").contains("at least one axis"));
    assert_eq!(
        wrong(
            "base = { scenario = \"a\" }\n[[axis]]\nkey = \"seed\"\n[[axis]]\nvalues = [1]\n\
             [budget]\nmax_ms = 1e308\nlimit = \"planer\"\n"
        ),
        "s.toml:2: axis[0]: expected `values` or `settings` that are not empty\n\
         s.toml:4: axis[1]: `values` need a `key`\n\
         s.toml:8: budget.limit: no axis of the name `planer`\n\
         s.toml:7: budget.max_ms: expected milliseconds above 0 and at most 100000, found 1e308"
    );
    let budget = |keys: &str| {
        wrong(&format!(
            "base = {{ scenario = \"a\" }}\naxis = [{{ key = \"seed\", values = [1] }}]\n[budget]\n{keys}"
        ))
    };
    for (keys, said) in [
        (
            "max_ms = 300\nscan_ms = 301\n",
            "5: budget.scan_ms: expected milliseconds above 0 and at most 300 (budget.max_ms), found 301",
        ),
        (
            "max_ms = 30\n",
            "3: budget.scan_ms: expected milliseconds above 0 and at most 30 (budget.max_ms), found 50",
        ),
        (
            "max_ms = 300\nscan_ms = 5\nresolution_ms = 6\n",
            "6: budget.resolution_ms: expected milliseconds above 0 and at most 5 (budget.scan_ms), found 6",
        ),
    ] {
        assert_eq!(budget(keys), format!("s.toml:{said}"));
    }
    assert_eq!(
        wrong("base = { scenari = \"a\" }\n[[axis]]\nkey = \"seed\"\nvalues = 3\n"),
        "s.toml:1: base.scenari: unknown key; did you mean \"scenario\"?\n\
         s.toml:4: axis[0].values: expected an array, found 3"
    );
}
