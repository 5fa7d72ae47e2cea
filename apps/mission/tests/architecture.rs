//! The arrows of ARCHITECTURE.md: who may depend on whom. A new arrow is a design change.

use std::collections::BTreeMap;
use std::path::Path;

/// Crate -> our crates that it may depend on.
const ARROWS: [(&str, &[&str]); 14] = [
    ("topo-ph", &[]),
    ("dsg", &[]),
    ("octant-prompt", &["dsg"]),
    ("robot-model", &[]),
    ("omni-sim", &[]),
    ("omni-perception", &[]),
    ("volumetric-map", &[]),
    ("planner", &[]),
    ("robot-link", &[]),
    (
        "mission",
        &[
            "topo-ph",
            "dsg",
            "octant-prompt",
            "robot-model",
            "omni-perception",
            "volumetric-map",
            "planner",
            "robot-link",
        ],
    ),
    ("arena", &["mission", "omni-sim"]),
    ("omnivln-aerial", &["arena"]),
    ("omnivln-ground", &["arena"]),
    ("omnivln", &["arena", "mission", "omni-sim"]),
];

/// Crates that may not reach for the outside world at all.
const WORDS_FORBIDDEN_IN_CRATES: [&str; 6] =
    ["std::net", "Instant::now", "SystemTime::now", "println!", "eprintln!", "thread_rng"];

#[test]
fn manifests_have_only_the_arrows_of_the_house() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut found: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for folder in ["crates", "apps"] {
        for entry in std::fs::read_dir(root.join(folder)).unwrap() {
            let manifest = entry.unwrap().path().join("Cargo.toml");
            let Ok(text) = std::fs::read_to_string(&manifest) else { continue };
            let table: toml::Table = text.parse().unwrap();
            let name = table["package"]["name"].as_str().unwrap().to_owned();
            let ours: Vec<String> = table
                .get("dependencies")
                .and_then(|d| d.as_table())
                .into_iter()
                .flat_map(|d| d.keys().cloned())
                .filter(|dependency| ARROWS.iter().any(|(ours, _)| ours == dependency))
                .collect();
            found.insert(name, ours);
        }
    }
    assert_eq!(found.len(), ARROWS.len(), "a crate was added or removed: change ARCHITECTURE.md and this test");
    for (name, allowed) in ARROWS {
        for dependency in &found[name] {
            assert!(allowed.contains(&dependency.as_str()), "{name} -> {dependency} is no arrow of the house");
        }
    }
}

#[test]
fn crates_read_no_clock_open_no_socket_and_print_nothing() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../crates");
    let mut faults = Vec::new();
    for entry in std::fs::read_dir(root).unwrap() {
        check_folder(&entry.unwrap().path().join("src"), &mut faults);
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

fn check_folder(folder: &Path, faults: &mut Vec<String>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries {
        let path = entry.unwrap().path();
        if path.is_dir() {
            check_folder(&path, faults);
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        // A module of tests, from its mark to the brace at the margin, may print why it skips.
        let (mut is_marked, mut is_test) = (false, false);
        for (number, line) in text.lines().enumerate() {
            is_test |= is_marked && line.starts_with("mod ");
            is_marked = line == "#[cfg(test)]";
            if is_test || line.trim_start().starts_with("//") {
                is_test &= line != "}";
                continue;
            }
            for word in WORDS_FORBIDDEN_IN_CRATES {
                if line.contains(word) {
                    faults.push(format!("{}:{}: {word}", path.display(), number + 1));
                }
            }
        }
    }
}
