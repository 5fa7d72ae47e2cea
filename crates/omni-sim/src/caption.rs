//! Captions: 20 to 40 words about a thing's looks, where it stands, what is near it and what it is for.
//!
//! They read like the output of a captioning model: true to the truth, varied in form, and silent about the room's name (a
//! robot has to find that out by itself).

use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, RngExt};

use crate::building::ObjectTruth;
use crate::catalog::{Mount, class};

/// Fewest words of a caption.
pub const WORDS_MIN: usize = 20;
/// Most words of a caption.
pub const WORDS_MAX: usize = 40;

/// Writes the captions of all objects. Support and neighbours are taken from the objects' boxes.
pub fn write_captions(rng: &mut impl Rng, objects: &mut [ObjectTruth]) {
    for i in 0..objects.len() {
        objects[i].caption = caption(rng, objects, i);
    }
}

/// The caption that a model writes when it takes the object for something of class `label`.
pub fn misread(object: &ObjectTruth, label: &str) -> String {
    let function = class(label).map_or("some purpose", |c| c.function);
    let swapped = object.caption.replace(&object.function, function);
    // Only whole words: the "box" in "boxes" stays.
    let words: Vec<String> = swapped.split(' ').map(str::to_string).collect();
    let from: Vec<&str> = object.class.split(' ').collect();
    let mut out: Vec<String> = Vec::new();
    let mut k = 0;
    while k < words.len() {
        let bare = |w: &str| w.trim_end_matches([',', '.', ';']).to_string();
        let matches = k + from.len() <= words.len() && from.iter().enumerate().all(|(j, f)| bare(&words[k + j]) == *f);
        if matches {
            let last = &words[k + from.len() - 1];
            let tail = &last[bare(last).len()..];
            out.push(format!("{label}{tail}"));
            k += from.len();
        } else {
            out.push(words[k].clone());
            k += 1;
        }
    }
    articles(&out.join(" "))
}

fn caption(rng: &mut impl Rng, objects: &[ObjectTruth], i: usize) -> String {
    let o = &objects[i];
    let mut neighbours: Vec<(f64, &ObjectTruth)> = objects
        .iter()
        .filter(|p| p.id != o.id && p.room == o.room && Some(p.id) != o.supported_by && p.class != "window")
        .map(|p| (o.bounds.gap_m(&p.bounds), p))
        .filter(|(gap, _)| *gap <= 1.0)
        .collect();
    neighbours.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
    neighbours.truncate(4);
    let mut sentences = vec![opening(rng, o, objects)];
    let mut more: Vec<String> = Vec::new();
    if let Some(s) = surroundings(rng, &neighbours) {
        more.push(s);
    }
    more.push(purpose(rng, o));
    let order = rng.random_bool(0.5);
    if order {
        more.reverse();
    }
    sentences.extend(more);
    let mut remarks = remarks(o);
    remarks.shuffle(rng);
    let words = |s: &[String]| s.iter().map(|t| t.split_whitespace().count()).sum::<usize>();
    while words(&sentences) < WORDS_MIN {
        let Some(remark) = remarks.pop() else { break };
        sentences.push(remark);
    }
    while words(&sentences) > WORDS_MAX && sentences.len() > 1 {
        sentences.pop();
    }
    articles(&sentences.join(" "))
}

/// What it is and where: the first sentence always names colour and class.
fn opening(rng: &mut impl Rng, o: &ObjectTruth, objects: &[ObjectTruth]) -> String {
    let adjective = size_word(o);
    let looks = match rng.random_range(0..4) {
        0 => format!("a {adjective}{} {}", o.color, o.class),
        1 => format!("a {} {} {}", o.color, o.material, o.class),
        2 => format!("a {adjective}{} {} {}", o.color, o.material, o.class),
        _ => format!("a {adjective}{} {} made of {}", o.color, o.class, o.material),
    };
    let support = o.supported_by.and_then(|s| objects.iter().find(|p| p.id == s));
    let place = match (support, class(&o.class).map(|c| c.mount)) {
        (Some(s), _) if s.class == "bookshelf" || s.class == "storage rack" => {
            format!("{} on a board of a {} {}", pick(rng, &["lying", "placed", "kept"]), s.color, s.class)
        }
        (Some(s), _) => format!("{} on a {} {}", pick(rng, &["standing", "resting", "placed"]), s.color, s.class),
        (None, Some(Mount::Wall(_))) => {
            pick(rng, &["fixed to the wall", "mounted on the wall", "on the wall at eye level"]).to_string()
        }
        _ => pick(
            rng,
            &[
                "standing on the floor",
                "placed on the floor",
                "seen from the front",
                "with some free space in front of it",
            ],
        )
        .to_string(),
    };
    match rng.random_range(0..3) {
        0 => capital(&format!("{looks} {place}.")),
        1 => capital(&format!("the picture shows {looks}, {place}.")),
        _ => capital(&format!("{looks}, {place}.")),
    }
}

/// Things close by.
fn surroundings(rng: &mut impl Rng, neighbours: &[(f64, &ObjectTruth)]) -> Option<String> {
    let (gap, first) = neighbours.first()?;
    let name = |o: &ObjectTruth| format!("a {} {}", o.color, o.class);
    let second = neighbours[1..].iter().find(|n| n.1.class != first.class).map(|n| n.1);
    let near =
        if *gap < 0.3 { ["right beside", "next to", "close to"] } else { ["near", "not far from", "in sight of"] };
    Some(match (second, rng.random_range(0..3)) {
        (Some(s), 0) => format!("It is {} {} and {}.", pick(rng, &near), name(first), name(s)),
        (Some(s), 1) => capital(&format!("{} and {} are close by.", name(first), name(s))),
        (Some(s), _) => format!("There are {} and {} nearby.", name(first), name(s)),
        (None, 0) => format!("There is {} close by.", name(first)),
        (None, _) => format!("It is {} {}.", pick(rng, &near), name(first)),
    })
}

fn purpose(rng: &mut impl Rng, o: &ObjectTruth) -> String {
    match rng.random_range(0..4) {
        0 => format!("It is used for {}.", o.function),
        1 => format!("People use it for {}.", o.function),
        2 => format!("It serves for {}.", o.function),
        _ => format!("Its purpose is {}.", o.function),
    }
}

/// Harmless remarks that fill up a short caption.
fn remarks(o: &ObjectTruth) -> Vec<String> {
    vec![
        format!("The surface is {} and looks clean.", o.material),
        "It looks well kept and is clearly visible.".to_string(),
        format!("Its {} colour stands out from the wall behind it.", o.color),
        "Nothing covers it, so its whole shape can be made out.".to_string(),
        "The light falls on it evenly from above.".to_string(),
    ]
}

/// An adjective with a trailing blank, or nothing, from the thing's place in its class's range of sizes.
fn size_word(o: &ObjectTruth) -> &'static str {
    let Some(c) = class(&o.class) else { return "" };
    let height = o.bounds.max.z - o.bounds.min.z;
    let (low, high) = c.size_m[2];
    match (height - low) / (high - low).max(1e-9) {
        f if high - low < 0.02 || !(0.25..=0.75).contains(&f) && high < 0.2 => "",
        f if f > 0.75 => {
            if high > 0.9 {
                "tall "
            } else {
                "large "
            }
        }
        f if f < 0.25 => {
            if high > 0.9 {
                "low "
            } else {
                "small "
            }
        }
        _ => "",
    }
}

fn pick<'a>(rng: &mut impl Rng, words: &[&'a str]) -> &'a str {
    words.choose(rng).copied().unwrap_or("")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |f| f.to_uppercase().collect::<String>() + letters.as_str())
}

/// Turns "a orange" into "an orange".
fn articles(text: &str) -> String {
    let words: Vec<&str> = text.split(' ').collect();
    let vowel = |w: &str| w.starts_with(['a', 'e', 'i', 'o', 'u']) && !w.starts_with("use") && !w.starts_with("one");
    let fixed = words.iter().enumerate().map(|(k, w)| {
        let next = words.get(k + 1).copied().unwrap_or("");
        match *w {
            "a" | "an" => {
                if vowel(next) {
                    "an"
                } else {
                    "a"
                }
            }
            "A" | "An" => {
                if vowel(next) {
                    "An"
                } else {
                    "A"
                }
            }
            other => other,
        }
    });
    fixed.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misread_mug_has_the_caption_of_a_vase() {
        let b = crate::scenes::named_scene("flat").expect("a named scene");
        let mug = b.objects.iter().find(|o| o.class == "mug").expect("the flat has mugs");
        let caption = misread(mug, "vase");
        assert!(caption.contains("vase") && caption.contains("holding flowers"), "{caption}");
        assert!(caption.contains(&mug.color) && !caption.contains(&mug.function));
        assert_ne!(caption, mug.caption);
    }

    #[test]
    fn articles_follow_the_next_word() {
        assert_eq!(
            articles("A orange mug beside an blue bowl, a oak desk"),
            "An orange mug beside a blue bowl, an oak desk"
        );
    }
}
