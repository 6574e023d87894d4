use super::*;

#[test]
fn every_file_of_the_folders_is_built_in() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let mut there = Vec::new();
    for folder in ["scenarios", "configs"] {
        let files = swerve_report::files::toml_files(&root.join(folder)).unwrap();
        there.extend(files.iter().map(|file| file.strip_prefix(root).unwrap().to_path_buf()));
    }
    let problems = std::fs::read_dir(root.join("configs/problems")).unwrap();
    there.extend(problems.map(|file| Path::new("configs/problems").join(file.unwrap().file_name())));
    let mut shipped: Vec<_> = FILES.iter().map(|file| Path::new(file.path).to_path_buf()).collect();
    shipped.sort();
    let maps = std::fs::read_dir(root.join(MAPS)).unwrap().map(|file| file.unwrap().file_name());
    let maps = maps.filter(|name| name.to_string_lossy().ends_with(".xodr"));
    there.extend(maps.map(|name| Path::new(MAPS).join(name)));
    there.sort();
    assert_eq!(shipped, there, "the list at the top of shipped.rs is not that of the folders");
    for file in FILES {
        assert_eq!(file.text, std::fs::read_to_string(root.join(file.path)).unwrap(), "{}", file.path);
    }
}

#[test]
fn swapped_scenario_and_configuration_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let (scenario, config) = (Kind::Scenario.text(Path::new("lane")), Kind::Config.text(Path::new("paper")));
    let (scenario, config) = (file("s", &scenario.unwrap()), file("c", &config.unwrap()));
    let as_config = |path: &Path| Kind::Config.layers(&[path.to_owned()]).err().unwrap().to_string();
    let as_scenario = |path: &Path| Kind::scenario(path).unwrap_err().to_string();
    for path in [scenario.as_path(), Path::new("lane")] {
        let expected = "it is a scenario, expected a configuration: a scenario is given without `-c`";
        assert_eq!(as_config(path), format!("{}: {expected}", path.display()));
    }
    for path in [config.as_path(), Path::new("paper")] {
        let expected = "it is a configuration, expected a scenario: a configuration is given after `-c`";
        assert_eq!(as_scenario(path), format!("{}: {expected}", path.display()));
    }
    // A file with keys of neither is reported by its other errors.
    assert!(Kind::scenario(&file("other", "[rod]\n")).is_ok());
    assert!(Kind::scenario(&scenario).is_ok() && Kind::Config.layers(&[config]).is_ok());
}

#[test]
fn scenarios_in_a_subfolder_are_listed_with_it_and_suggested() {
    let names: Vec<&str> = Kind::Scenario.all().map(|(name, _)| name).collect();
    let everyday = Kind::Scenario.in_folder(Path::new("everyday"));
    assert!(everyday.len() >= 24 && everyday.iter().all(|name| names.contains(name)), "{everyday:?}");
    assert_eq!(Kind::Scenario.in_folder(Path::new("./scenarios/everyday/")), everyday);
    for other in ["every", "", "lane", "/everyday"] {
        assert_eq!(Kind::Scenario.in_folder(Path::new(other)), Vec::<&str>::new(), "{other}");
    }
    assert!(Kind::Config.all().all(|(name, _)| !name.contains('/')), "its folders hold other kinds");
    let said = Kind::Scenario.text(Path::new("everyday/start_in_jamm")).unwrap_err().to_string();
    assert!(said.contains("did you mean the scenario `everyday/start_in_jam`"), "{said}");
}

#[test]
fn name_is_found_in_any_notation() {
    let path = |kind: Kind, given: &str| kind.find(Path::new(given)).map(|file| file.path);
    let lane = Some("scenarios/lane.toml");
    for given in [
        "lane",
        "lane.toml",
        "scenarios/lane.toml",
        "./scenarios/lane",
        "configs/live/../../scenarios/lane.toml",
    ] {
        assert_eq!(path(Kind::Scenario, given), lane, "{given}");
    }
    assert_eq!(path(Kind::Config, "paper"), Some("configs/paper.toml"));
    assert_eq!(path(Kind::Config, "live/autoware"), Some("configs/live/autoware.toml"));
    assert_eq!(path(Kind::Live, "autoware"), Some("configs/live/autoware.toml"));
    assert_eq!(path(Kind::Config, "autoware"), Some("configs/live/autoware.toml"));
    assert_eq!(path(Kind::Study, "planners"), Some("configs/studies/planners.toml"));
    for given in ["detour", "detour.json", "configs/problems/detour.json"] {
        assert_eq!(path(Kind::Problems, given), Some("configs/problems/detour.json"), "{given}");
    }
    let jam = Some("scenarios/everyday/start_in_jam.toml");
    for given in ["everyday/start_in_jam", "scenarios/everyday/start_in_jam.toml"] {
        assert_eq!(path(Kind::Scenario, given), jam, "{given}");
    }
    assert_eq!(path(Kind::Scenario, "start_in_jam"), None, "the folder is part of the name");
    for given in ["", "lan", "../lane", "/scenarios/lane.toml", "configs/paper.toml.toml"] {
        assert_eq!(path(Kind::Scenario, given), None, "{given}");
    }
}
