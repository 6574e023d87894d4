//! README, ARCHITECTURE, CONTRIBUTING and the how-to pages are correct: commands parse, files exist, settings are valid,
//! code is quoted literally.
//!
//! Fenced blocks: `sh` holds commands; `toml KIND` (`scenario`, `config`, `study`, `timing`) a whole file; `rust PATH`
//! literal lines of that file; `python FILE` a whole file beside those of settings; `json problems` a file of
//! `swerve plan`. Tutorials are run as they are written: `crates/swerve/tests/it/tutorials.rs`.
//! Names with `my_` are the reader's.

use std::path::{Path, PathBuf};

use swerve::cli;

pub(crate) fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// A page: path relative to the root, and text.
fn pages() -> Vec<(PathBuf, String)> {
    let mut paths: Vec<PathBuf> =
        ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "docs/README.md"].map(PathBuf::from).into();
    paths.extend(markdown("docs/howto"));
    paths.sort();
    assert!(paths.len() >= 9, "pages are missing: {paths:?}");
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(root().join(&path)).unwrap();
        (path, text)
    };
    paths.into_iter().map(read).collect()
}

/// Pages in a folder.
fn markdown(folder: &str) -> impl Iterator<Item = PathBuf> {
    let files = std::fs::read_dir(root().join(folder)).unwrap();
    let files = files.map(move |entry| Path::new(folder).join(entry.unwrap().file_name()));
    files.filter(|path| path.extension().is_some_and(|extension| extension == "md"))
}

/// All pages of the site: those of `docs/` and its folders.
pub(crate) fn site() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap());
    let folders = entries.filter(|entry| entry.path().is_dir());
    let folders = folders.map(|folder| format!("docs/{}", folder.file_name().to_string_lossy()));
    let folders: Vec<String> = folders.chain(["docs".to_owned()]).collect();
    let mut pages: Vec<PathBuf> = folders.iter().flat_map(|folder| markdown(folder)).collect();
    pages.sort();
    pages
}

/// A fenced block: location, info string, text.
struct Block {
    place: String,
    info: String,
    text: String,
}

fn blocks() -> Vec<Block> {
    blocks_of(pages())
}

fn blocks_of(pages: Vec<(PathBuf, String)>) -> Vec<Block> {
    let mut blocks = Vec::new();
    for (path, text) in pages {
        let mut open: Option<Block> = None;
        for (i, line) in text.lines().enumerate() {
            match (line.strip_prefix("```"), &mut open) {
                (Some(_), Some(_)) => blocks.extend(open.take()),
                (Some(info), None) => {
                    let place = format!("{}:{}", path.display(), i + 1);
                    open = Some(Block { place, info: info.trim().to_owned(), text: String::new() });
                }
                (None, Some(block)) => block.text += &format!("{line}\n"),
                (None, None) => {}
            }
        }
        assert!(open.is_none(), "{}: a fence is never closed", path.display());
    }
    blocks
}

/// Words of a shell line, as far as pages need it: quotes, comments; variables are replaced by 1.
pub(crate) fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for c in line.chars() {
        match (c, quote) {
            ('"' | '\'', None) => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            (c, Some(q)) if c == q => quote = None,
            ('#', None) if word.is_none() => break,
            (c, None) if c.is_whitespace() => words.extend(word.take()),
            (c, _) => word.get_or_insert_default().push(c),
        }
    }
    words.extend(word);
    words.iter().map(|word| filled(word)).collect()
}

/// Fills in `{}` and `$NAME`.
fn filled(word: &str) -> String {
    let mut parts = word.split('$');
    let first = parts.next().unwrap_or_default().to_owned();
    let rest = parts
        .map(|part| format!("1{}", part.trim_start_matches(|c: char| c.is_ascii_uppercase() || c == '_')));
    rest.fold(first, |all, part| all + &part).replace("{}", "1")
}

/// Swerve command lines in a shell line, each split into words.
fn calls(line: &str) -> Vec<Vec<String>> {
    const ENDS: [&str; 8] = ["|", "||", "&", "&&", ";", ">", "<", ":::"];
    let words = words(line);
    let parts = words.split(|word| ENDS.contains(&word.as_str()));
    let call = |part: &[String]| {
        let at = part.iter().position(|word| word == "swerve")?;
        let rest = &part[at + 1..];
        // As in `cargo run -p swerve -- run`, but not `cargo test -p swerve -- --ignored`.
        let cargo = part[..at].iter().position(|word| word == "cargo");
        if cargo.is_some_and(|cargo| part[cargo + 1] != "run") {
            return None;
        }
        let rest = match rest.iter().position(|word| word == "--") {
            Some(dashes) => &rest[dashes + 1..],
            None => rest,
        };
        Some(std::iter::once("swerve".to_owned()).chain(rest.iter().cloned()).collect())
    };
    parts.filter_map(call).collect()
}

#[test]
fn every_command_parses() {
    let mut seen = 0;
    let mut pages = pages();
    let known: Vec<PathBuf> = pages.iter().map(|(path, _)| path.clone()).collect();
    let more = site().into_iter().filter(|path| !known.contains(path));
    pages.extend(more.map(|path| (path.clone(), std::fs::read_to_string(root().join(path)).unwrap())));
    for block in blocks_of(pages).iter().filter(|block| block.info.split(' ').next() == Some("sh")) {
        for line in block.text.replace("\\\n", " ").lines() {
            for call in calls(line) {
                let parsed = cli::parse(&call);
                assert!(parsed.is_ok(), "{}: {line}\n{}", block.place, parsed.unwrap_err());
                seen += 1;
            }
        }
    }
    assert!(seen >= 20, "only {seen} commands found");
}

/// The README names every required argument of its commands; names in capitals are placeholders.
#[test]
fn commands_in_the_text_of_the_readme_parse() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let mut seen = 0;
    for quoted in readme.split('`').skip(1).step_by(2).filter(|quoted| quoted.starts_with("swerve ")) {
        let words: Vec<&str> = quoted.split_whitespace().collect();
        // A command's name alone is not a call.
        if words.len() > 2 && words[1] != "help" {
            let parsed = cli::parse(&words);
            assert!(parsed.is_ok(), "README.md: `{quoted}`\n{}", parsed.unwrap_err());
            seen += 1;
        }
    }
    assert!(seen >= 10, "only {seen} commands found");
}

/// The texts compared by `.ci/figures` are in the pages, and its commands parse.
#[test]
fn listed_figures_are_in_their_pages() {
    let list = std::fs::read_to_string(root().join("tests/reference/figures.toml")).unwrap();
    let list: toml::Table = list.parse().unwrap();
    let text_of =
        |entry: &toml::Value, key: &str| entry.get(key).map(|text| text.as_str().unwrap().to_owned());
    let entries = |command: &toml::Value, key: &str| -> Vec<toml::Value> {
        command.get(key).map_or_else(Vec::new, |entries| entries.as_array().unwrap().clone())
    };
    let mut seen = 0;
    for command in list["command"].as_array().unwrap() {
        let before = entries(command, "before");
        let lines = before.iter().map(|line| line.as_str().unwrap()).chain(command["run"].as_str());
        for line in lines {
            let call = std::iter::once("swerve".to_owned()).chain(words(line)).collect::<Vec<_>>();
            assert!(cli::parse(&call).is_ok(), "{line}: {}", cli::parse(&call).unwrap_err());
        }
        for entry in entries(command, "figure").iter().chain(&entries(command, "table")) {
            let name = text_of(entry, "page").unwrap();
            let page = std::fs::read_to_string(root().join(&name)).unwrap();
            let rows = entry.get("rows").and_then(toml::Value::as_table).into_iter().flatten();
            if entry.get("made").is_some() {
                continue;
            }
            let mut texts: Vec<String> = rows.map(|(label, _)| format!("| {label} |")).collect();
            texts.extend(["text", "block", "after"].iter().filter_map(|key| text_of(entry, key)));
            assert!(!texts.is_empty(), "{name}: an entry without a text: {entry}");
            for text in texts {
                let plain = text.replace(['{', '}'], "");
                assert!(page.contains(&plain), "{name} does not contain `{plain}`");
                seen += 1;
            }
        }
    }
    assert!(seen >= 20, "only {seen} figures found");
}

/// `swerve keys --markdown > docs/keys.md` updates it.
#[test]
fn page_of_keys_equals_the_programs_output() {
    let page = std::fs::read_to_string(root().join("docs/keys.md")).unwrap_or_default();
    assert!(
        page == swerve_reference::keys::whole_page(&swerve::Registry::standard()),
        "swerve keys --markdown > docs/keys.md"
    );
}

#[test]
fn commands_in_running_text_exist() {
    for (path, text) in pages() {
        for quoted in text.split('`').skip(1).step_by(2) {
            let mut words = quoted.split_whitespace();
            let (Some("swerve"), Some(command)) = (words.next(), words.next()) else { continue };
            let unknown = cli::parse(["swerve", "help", &command.to_lowercase()]).unwrap_err();
            let known = unknown.exit_code() == 0 || command == "help";
            assert!(known, "{}: `{quoted}`: no such command", path.display());
            for flag in words.filter(|word| word.starts_with("--")) {
                let help = unknown.to_string();
                let name = flag.split('=').next().unwrap();
                assert!(help.contains(name), "{}: `{quoted}`: no flag {flag}", path.display());
            }
        }
    }
}

#[test]
fn every_named_file_exists() {
    let top = [
        "README.md",
        "ARCHITECTURE.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "crates/",
        "configs/",
        "scenarios/",
        "docs/",
        "tests/",
        "benches/",
        ".ci/",
    ];
    let mut seen = 0;
    for (path, text) in pages() {
        let folder = root().join(&path).parent().unwrap().to_path_buf();
        let mut exists = |from: &Path, name: &str| {
            let name = name.trim_end_matches(['.', ',', ':', ')']);
            if name.contains("my_")
                || name.contains(['*', '<', '{'])
                || name.chars().any(char::is_uppercase) && !name.ends_with(".md")
            {
                return;
            }
            assert!(from.join(name).exists(), "{}: there is no {name}", path.display());
            seen += 1;
        };
        for link in text.split("](").skip(1) {
            let link = link.split([')', '#']).next().unwrap_or_default();
            if !link.is_empty() && !link.contains("://") {
                exists(&folder, link);
            }
        }
        for word in text.split(|c: char| c.is_whitespace() || "`\"'()[]=".contains(c)) {
            if top.iter().any(|top| word.starts_with(top)) && word.contains(['/', '.']) {
                let from_root = root().join(word.trim_end_matches(['.', ',', ':', ';'])).exists();
                exists(if from_root { root() } else { &folder }, word);
            }
        }
    }
    assert!(seen >= 40, "only {seen} files found");
}

/// Links lead to existing pages, pictures and headings, on the site as in the folder: the site contains `docs/`, and
/// gives headings the same anchors as the folder (mdBook's and GitHub's slugs).
#[test]
fn links_lead_to_existing_targets_and_leave_the_site_only_by_https() {
    let root = root().canonicalize().unwrap();
    let mut anchors = 0;
    let top = ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"];
    let mut pages = top.map(|page| root.join(page)).to_vec();
    pages.extend(site().iter().map(|page| root.join(page)));
    for page in pages {
        let name = page.strip_prefix(&root).unwrap().display();
        for link in links(&std::fs::read_to_string(&page).unwrap()) {
            if link.contains("://") {
                assert!(link.starts_with("https://"), "{name}: {link}: expected https");
                continue;
            }
            let (file, anchor) = link.split_once('#').map_or((&*link, None), |(file, a)| (file, Some(a)));
            let target =
                if file.is_empty() { Ok(page.clone()) } else { page.with_file_name(file).canonicalize() };
            let target = target.unwrap_or_else(|e| panic!("{name}: {link}: {e}"));
            let leaves = page.starts_with(root.join("docs")) && !target.starts_with(root.join("docs"));
            assert!(!leaves, "{name}: {link} is not on the site: expected a link by https");
            let Some(anchor) = anchor else { continue };
            let there = slugs(&std::fs::read_to_string(&target).unwrap());
            assert!(there.iter().any(|slug| slug == anchor), "{name}: {link}: expected one of {there:?}");
            anchors += 1;
        }
    }
    assert!(anchors >= 5, "only {anchors} links to headings found");
}

/// Lines of a page outside fenced blocks.
fn running_text(page: &str) -> impl Iterator<Item = &str> {
    let mut fenced = false;
    page.lines().filter(move |line| {
        let is_fence = line.starts_with("```");
        fenced ^= is_fence;
        !fenced && !is_fence
    })
}

/// Targets of a page's links and pictures.
pub(crate) fn links(page: &str) -> Vec<String> {
    let of = |line: &str| {
        // Text between backticks is code.
        let text: String = line.split('`').step_by(2).collect::<Vec<_>>().join("`");
        let links = text.split("](").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0.to_owned()));
        links.collect::<Vec<_>>()
    };
    running_text(page).flat_map(of).collect()
}

/// Anchors of a page's headings: letters, digits, `-` and `_` in lower case, blanks as `-`, all else left out;
/// duplicates get a number.
fn slugs(page: &str) -> Vec<String> {
    let mut slugs: Vec<String> = Vec::new();
    for line in running_text(page).filter(|line| line.starts_with('#')) {
        let heading = line.trim_start_matches('#').trim().to_lowercase();
        let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        let slug: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
        let again = slugs.iter().filter(|before| **before == slug).count();
        slugs.push(if again == 0 { slug } else { format!("{slug}-{again}") });
    }
    slugs
}

#[test]
fn headings_have_the_anchors_of_the_site() {
    let page = "# The `data` flow, 2.5\n```sh\n# no heading\n```\n## RRT\\*: *why*?\n### Run_times\n## RRT\\*: why\n";
    assert_eq!(slugs(page), ["the-data-flow-25", "rrt-why", "run_times", "rrt-why-1"]);
    let page = "see [a](b.md#c), `x[0](1)` and ![d](e.svg)\n```sh\n[f](g)\n```\n[`h`](i.md)";
    assert_eq!(links(page), ["b.md#c", "e.svg", "i.md"]);
}

#[test]
fn every_setting_shown_is_valid() {
    let top = tempfile::tempdir().unwrap();
    copy_toml(&root().join("scenarios"), &top.path().join("scenarios"));
    copy_toml(&root().join("configs"), &top.path().join("configs"));
    let programs =
        std::fs::read_dir(root().join("examples/python")).unwrap().map(|entry| entry.unwrap().path());
    // Python keeps compiled modules in a folder beside them.
    for program in programs.filter(|path| path.is_file()) {
        std::fs::copy(&program, top.path().join("configs").join(program.file_name().unwrap())).unwrap();
    }
    let blocks = blocks();
    for (file, block) in blocks.iter().filter_map(|block| Some((block.info.strip_prefix("python ")?, block)))
    {
        std::fs::write(top.path().join("configs").join(file), &block.text).unwrap();
    }
    let mut seen = 0;
    for (i, block) in blocks.iter().enumerate() {
        if block.info == "json problems" {
            let file = top.path().join("my_problems.json");
            std::fs::write(&file, &block.text).unwrap();
            let read = swerve::plan::read(&file);
            assert!(read.is_ok(), "{}: {:#}", block.place, read.unwrap_err());
            seen += 1;
        }
        let Some(kind) = block.info.strip_prefix("toml") else { continue };
        let folder = match kind.trim() {
            "scenario" => "scenarios",
            "config" => "configs",
            "study" => "configs/studies",
            "timing" => "configs/timing",
            other => panic!("{}: a toml block is of no known kind: `{other}`", block.place),
        };
        let folder = top.path().join(folder);
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join(format!("my_{i}.toml"));
        std::fs::write(&file, &block.text).unwrap();
        let check = cli::parse([Path::new("swerve"), Path::new("check"), &file]).unwrap();
        let checked = cli::main(&check, &swerve::Registry::standard());
        assert!(checked.is_ok(), "{}: {:#}\n(the problems are above)", block.place, checked.unwrap_err());
        seen += 1;
    }
    assert!(seen >= 4, "only {seen} files of settings found");
}

fn copy_toml(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            std::fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
        }
    }
}

#[test]
fn code_is_quoted_literally() {
    /// Lines without doc comment markers and indentation; blank lines left out.
    fn plain(text: &str) -> String {
        let bare = |line: &str| {
            let line = line.trim();
            let line = line.strip_prefix("//!").or(line.strip_prefix("///")).unwrap_or(line);
            line.trim().to_owned()
        };
        text.lines().map(bare).filter(|line| !line.is_empty()).map(|line| line + "\n").collect()
    }
    let mut seen = 0;
    for block in blocks() {
        let Some(file) = block.info.strip_prefix("rust") else { continue };
        let file = file.trim();
        assert!(!file.is_empty(), "{}: whose lines are these? expected ```rust PATH", block.place);
        let source = std::fs::read_to_string(root().join(file))
            .unwrap_or_else(|e| panic!("{}: {file}: {e}", block.place));
        assert!(
            plain(&source).contains(&plain(&block.text)),
            "{}: not in {file}:\n{}",
            block.place,
            block.text
        );
        seen += 1;
    }
    assert!(seen >= 3, "only {seen} pieces of code found");
}
