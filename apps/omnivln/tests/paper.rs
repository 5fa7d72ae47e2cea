//! `omnivln paper` as a person meets it: a page that is whole, work that goes on, and sections that do not exist.

mod support;

use support::omnivln;

#[test]
fn the_page_grows_and_what_is_done_is_not_done_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("UTF-8");
    let run = |sections: &str| omnivln(&["paper", "--quick", "--out", out, "--only", sections]);
    let (code, _, said) = run("tokens,tiers,datasets");
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("omnivln bench tokens --seeds 3") && said.contains("omnivln bench tiers --seeds 3"),
        "{said}"
    );

    let page = std::fs::read_to_string(folder.path().join("tokens-tiers-datasets.html")).expect("a page");
    for wanted in
        ["Table II", "3556.0", "61.7 %", "11.68 %", "<code>omnivln bench tokens --seeds 3</code>", "quick version"]
    {
        assert!(page.contains(wanted), "no {wanted:?} on the page");
    }
    // Self-contained: the only address is the name of SVG.
    assert_eq!(page.matches("http").count(), page.matches("http://www.w3.org/2000/svg").count());
    assert!(!page.contains("<script") && !page.contains("NaN") && !page.contains("class=\"missing\""));

    let (code, _, said) = run("tokens");
    assert!(code == Some(0) && !said.contains("omnivln bench"), "{said}");

    // What was kept of another program is not taken.
    for entry in std::fs::read_dir(folder.path().join("data")).expect("a folder").flatten() {
        let text = std::fs::read_to_string(entry.path()).expect("a file");
        let program = text.split("\"program\":\"").nth(1).and_then(|rest| rest.split('"').next()).expect("its program");
        std::fs::write(entry.path(), text.replace(program, "another")).expect("written");
    }
    let (_, _, said) = run("tokens");
    assert!(said.contains("omnivln bench tokens"), "{said}");
}

#[test]
fn sections_that_do_not_exist_are_named_with_those_that_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let (code, _, said) = omnivln(&["paper", "--out", folder.path().to_str().expect("UTF-8"), "--only", "tokenz"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("tokenz") && said.contains("tokens") && said.contains("patrol"), "{said}");
}
