//! The program as a person meets it: bad input ends with exit code 2, one clear sentence and nothing overwritten; a thing that is not
//! there ends with exit code 1 and says so.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

struct Said {
    code: Option<i32>,
    out: String,
    err: String,
}

/// Runs the robot in `folder`.
fn robot(folder: &Path, arguments: &[&str]) -> Said {
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_omnivln-ground"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("it starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("the robot speaks UTF-8");
    let said = Said { code: status.code(), out: text(stdout), err: text(stderr) };
    assert!(!said.err.contains("panicked"), "{arguments:?}: {}", said.err);
    said
}

/// Refused before anything moves: exit code 2, a sentence with `words`, an empty stdout, and the folder as it was.
fn check_refused(folder: &Path, arguments: &[&str], words: &[&str]) {
    let before = listing(folder);
    let said = robot(folder, arguments);
    assert_eq!(said.code, Some(2), "{arguments:?}: {} {}", said.out, said.err);
    assert!(said.err.starts_with("error: "), "{arguments:?}: {}", said.err);
    for word in words {
        assert!(said.err.contains(word), "{arguments:?} says nothing of {word:?}: {}", said.err);
    }
    assert_eq!(said.out, "", "{arguments:?}: results go to stdout, complaints to stderr");
    let after = listing(folder);
    let files = |listing: &[(String, Vec<u8>)]| -> Vec<(String, Vec<u8>)> {
        listing.iter().filter(|(name, _)| !name.ends_with('/')).cloned().collect()
    };
    assert_eq!(files(&after), files(&before), "{arguments:?} changed something");
}

/// Names and contents of everything in a folder; names of folders end with a slash.
fn listing(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).expect("readable") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                found.push((format!("{}/", path.display()), Vec::new()));
                open.push(path);
            } else {
                found.push((path.display().to_string(), fs::read(&path).expect("readable")));
            }
        }
    }
    found.sort();
    found
}

const FIND: &str = "find the sofa";

#[test]
fn help_reads_well_and_names_every_option() {
    let folder = tempfile::tempdir().unwrap();
    let said = robot(folder.path(), &["--help"]);
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""));
    for option in [
        "--scene",
        "--seed",
        "--urdf",
        "--out",
        "--known",
        "--start",
        "--llm",
        "--model",
        "--vlm",
        "--vlm-model",
        "--rig",
        "--lidar",
        "--zones",
        "--commands",
        "--max-time",
        "--quiet",
        "Exit codes",
    ] {
        assert!(said.out.contains(option), "{option}");
    }
}

#[test]
fn help_fits_the_width_it_promises() {
    let folder = tempfile::tempdir().unwrap();
    let said = robot(folder.path(), &["--help"]);
    let wide: Vec<&str> = said.out.lines().filter(|line| line.chars().count() > 110).collect();
    assert!(wide.is_empty(), "{wide:#?}");
}

#[test]
fn a_refusal_leaves_no_empty_folder_behind() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [[FIND, "--scene", "castle"], ["please", "--scene", "spin"]] {
        assert_eq!(robot(folder.path(), &arguments).code, Some(2));
        assert_eq!(listing(folder.path()), [], "{arguments:?}");
    }
}

#[test]
fn unknown_options_and_values_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], words: &[&str]| check_refused(folder.path(), arguments, words);
    refused(&[FIND, "--frobnicate"], &["--frobnicate"]);
    refused(&[], &["INSTRUCTION"]);
    refused(&[FIND, "--seed", "minus one"], &["minus one"]);
    refused(&[FIND, "--max-time", "0"], &["positive"]);
    refused(&[FIND, "--max-time", "NaN"], &["NaN"]);
    refused(&[FIND, "--lidar", "sideways"], &["rotating", "fixed"]);
    refused(&[FIND, "--lidar", "fixed", "--rig", "fixed"], &["--rig", "--lidar"]);
    refused(&[FIND, "--llm", "http://127.0.0.1:1/v1"], &["--model"]);
    refused(&[FIND, "--vlm", "http://127.0.0.1:1/v1"], &["--vlm-model"]);
}

#[test]
fn an_instruction_that_names_nothing_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |text: &str| check_refused(folder.path(), &[text, "--scene", "spin"], &["find the"]);
    refused("");
    refused("   ");
    refused("please");
    refused("go to the");
    let long = "find the mug ".repeat(1000);
    check_refused(folder.path(), &[&long, "--scene", "spin"], &["2000"]);
}

#[test]
fn a_missing_or_broken_urdf_is_refused_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let refused =
        |file: &str, words: &[&str]| check_refused(folder.path(), &[FIND, "--scene", "spin", "--urdf", file], words);
    refused("nowhere.urdf", &["nowhere.urdf"]);
    refused(".", &["URDF"]);
    for (name, text) in [
        ("empty.urdf", ""),
        ("prose.urdf", "this is no robot"),
        ("cut.urdf", "<robot name=\"cut\"><link name=\"base\"><inertial>"),
        ("other.urdf", "<html><body/></html>"),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
        refused(name, &[name]);
    }
    fs::write(folder.path().join("bytes.urdf"), [0xff, 0xfe, 0x00, 0x80]).unwrap();
    refused("bytes.urdf", &["bytes.urdf"]);
    // A sound URDF of a robot nobody has numbers for: the sentence names the missing keys.
    let sound = "<robot name=\"stranger\"><link name=\"base\"><inertial><mass value=\"5\"/>\
        <inertia ixx=\"0.1\" iyy=\"0.1\" izz=\"0.1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>\
        <collision><geometry><box size=\"0.4 0.3 0.2\"/></geometry></collision></link></robot>";
    fs::write(folder.path().join("stranger.urdf"), sound).unwrap();
    refused("stranger.urdf", &["stranger.toml", "max_speed_mps"]);
}

#[test]
fn a_missing_or_broken_rig_is_refused_with_what_would_be_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let refused =
        |rig: &str, words: &[&str]| check_refused(folder.path(), &[FIND, "--scene", "spin", "--rig", rig], words);
    refused("nowhere.toml", &["nowhere.toml", "rotating", "fixed", "fisheyes"]);
    fs::write(folder.path().join("loose.toml"), "version = 1\n[lidar]\nmount = \"loose\"\n[[camera]]\n").unwrap();
    refused("loose.toml", &["loose.toml", "lidar.mount", "rotating"]);
    let normal = "version = 1\n[lidar]\nmount = \"fixed\"\n[[camera]]\nname = \"normal\"\nmodel = \"pinhole-radtan\"\n\
        width_px = 64\nheight_px = 48\nintrinsics = [40, 40, 31.5, 23.5]\ndistortion = [0, 0, 0, 0]\n";
    fs::write(folder.path().join("normal.toml"), normal).unwrap();
    refused("normal.toml", &["normal", "kannala-brandt"]);
}

#[test]
fn zones_and_commands_that_cannot_be_are_refused_with_file_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |option: &str, name: &str, text: &str, words: &[&str]| {
        fs::write(folder.path().join(name), text).unwrap();
        check_refused(folder.path(), &[FIND, "--scene", "spin", option, name], &[&[name], words].concat());
    };
    let zone = |corners: &str| format!("{{\"keep_out\": [{{\"name\": \"pool\", \"corners_m\": {corners}}}]}}");
    refused("--zones", "prose.json", "keep out of the kitchen", &["line 1", "keep_out"]);
    refused("--zones", "nan.json", &zone("[[5,0],[6,0],[NaN,1]]"), &["line 1, column"]);
    refused("--zones", "line.json", &zone("[[5,0],[6,0]]"), &["keep_out[0] \"pool\"", "2 corners"]);
    refused("--zones", "bow.json", &zone("[[5,0],[6,1],[6,0],[5,1]]"), &["keep_out[0] \"pool\"", "sides 0 and 2"]);
    refused("--zones", "here.json", &zone("[[-1,-1],[1,-1],[1,1],[-1,1]]"), &["stands in the keep-out zone \"pool\""]);
    refused("--zones", "map.json", "{\"frame\": \"map\"}", &["--known"]);
    let slow = "{\"speed\": [{\"corners_m\": [[5,0],[6,0],[6,1]], \"max_mps\": -1}]}";
    refused("--zones", "slow.json", slow, &["speed[0]", "-1 m/s"]);
    refused("--commands", "late.txt", "5 pause\n4 resume\n", &["line 2"]);
    refused("--commands", "timeless.txt", "pause\n", &["line 1", "12.5 pause"]);
    check_refused(folder.path(), &[FIND, "--scene", "spin", "--zones", "nowhere.json"], &["nowhere.json"]);
    check_refused(folder.path(), &[FIND, "--scene", "spin", "--commands", "nowhere.txt"], &["nowhere.txt"]);
}

#[test]
fn an_unknown_scene_is_refused_with_the_known_names() {
    let folder = tempfile::tempdir().unwrap();
    for scene in ["castle", "-7", "1e3", ""] {
        check_refused(folder.path(), &[FIND, &format!("--scene={scene}")], &["flat", "office"]);
    }
}

#[test]
fn a_foreign_out_folder_is_refused_and_stays_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("photos")).unwrap();
    fs::write(folder.path().join("photos/cat.png"), "meow").unwrap();
    fs::write(folder.path().join("letter.txt"), "dear").unwrap();
    check_refused(folder.path(), &[FIND, "--scene", "spin", "--out", "photos"], &["photos", "--out"]);
    check_refused(folder.path(), &[FIND, "--scene", "spin", "--out", "letter.txt"], &["letter.txt", "--out"]);
    check_refused(folder.path(), &[FIND, "--scene", "spin", "--out", "letter.txt/run"], &["letter.txt"]);
}

#[test]
fn a_known_folder_without_files_or_with_broken_ones_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |known: &str, words: &[&str]| {
        check_refused(folder.path(), &[FIND, "--scene", "spin", "--known", known, "--start", "0,0,0.3,0"], words);
    };
    refused("nowhere", &["nowhere"]);
    fs::create_dir(folder.path().join("empty")).unwrap();
    refused("empty", &["empty"]);
    fs::create_dir(folder.path().join("broken")).unwrap();
    fs::write(folder.path().join("broken/graph.json"), "{\"format\": \"omni-dsg\", \"version\": ").unwrap();
    refused("broken", &["broken"]);
}

#[test]
fn a_start_that_is_no_pose_is_refused_with_an_example() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |start: &str, words: &[&str]| {
        check_refused(folder.path(), &[FIND, "--scene", "spin", "--known", "x", &format!("--start={start}")], words);
    };
    refused("here", &["x,y,z,yaw", "example"]);
    refused("1,2,3", &["3 numbers"]);
    refused("1,2,3,inf", &["finite"]);
    refused("", &["x,y,z,yaw"]);
    check_refused(folder.path(), &[FIND, "--start", "1,2,0.3,0"], &["--known"]);
    check_refused(folder.path(), &[FIND, "--known", "x"], &["x/graph.json"]);
}

#[test]
fn a_full_search_for_a_unicorn_ends_with_a_sentence_and_exit_code_one_and_the_folder_is_replaced_whole() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["find the unicorn", "--scene", "spin", "--seed", "1", "--out", "run", "--max-time", "120"];
    let said = robot(folder.path(), &arguments);
    assert_eq!(said.code, Some(1), "{} {}", said.out, said.err);
    let sentence = said.out.lines().next().unwrap_or_default();
    assert!(sentence.contains("gave up") && sentence.contains("unicorn"), "{sentence}");
    let summary: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("run/summary.json")).unwrap()).unwrap();
    assert_eq!(summary["success"], false);
    assert_eq!(summary["reason"], sentence);
    assert!(summary["sim_s"].as_f64().unwrap() < 120.0, "it ended by itself");

    // A later, shorter run into the same place replaces it.
    fs::write(folder.path().join("run/left-over.txt"), "old").unwrap();
    let said =
        robot(folder.path(), &["find the unicorn", "--scene", "spin", "--out", "run", "--max-time", "1", "--quiet"]);
    assert_eq!(said.code, Some(1));
    assert_eq!((said.err.as_str(), said.out.lines().count()), ("", 1), "quiet: the sentence alone");
    assert!(!folder.path().join("run/left-over.txt").exists());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no rests");
}
