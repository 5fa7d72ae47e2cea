//! The toolbox as a program meets it.
#![allow(dead_code)] // each test file uses its part

use std::collections::BTreeSet;
use std::process::Command;

use serde_json::Value;

/// Runs the toolbox: exit code, stdout, stderr. It never panics, whatever it is given.
pub fn omnivln(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_omnivln")).args(arguments).output().expect("it starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("it speaks UTF-8");
    let (out, err) = (text(output.stdout), text(output.stderr));
    assert!(!err.contains("panicked"), "{arguments:?}: {err}");
    (output.status.code(), out, err)
}

/// One JSON object on stdout, nothing else.
pub fn json(arguments: &[&str]) -> Value {
    let (code, out, err) = omnivln(arguments);
    assert_eq!(code, Some(0), "{arguments:?}: {err}");
    serde_json::from_str(&out).unwrap_or_else(|error| panic!("{arguments:?}: {error}: {out}"))
}

/// The keys of an object.
pub fn keys(value: &Value) -> BTreeSet<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}
