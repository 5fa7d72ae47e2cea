//! Words for what a caption or a colour says about a thing: `color`, `material`, `function`. The prompt and the reasoner
//! match instructions like "the red chair" against them.

use std::collections::BTreeMap;

#[rustfmt::skip]
const COLORS: &[&str] = &[
    "red", "green", "blue", "yellow", "orange", "purple", "pink", "brown", "black", "white", "grey", "gray", "beige",
    "turquoise", "cyan", "silver", "golden", "cream", "navy", "teal", "violet", "maroon", "tan",
];

#[rustfmt::skip]
const MATERIALS: &[(&str, &str)] = &[
    ("wooden", "wood"),
    ("wood", "wood"),
    ("oak", "wood"),
    ("pine", "wood"),
    ("bamboo", "wood"),
    ("metallic", "metal"),
    ("metal", "metal"),
    ("steel", "metal"),
    ("iron", "metal"),
    ("aluminium", "metal"),
    ("aluminum", "metal"),
    ("plastic", "plastic"),
    ("glass", "glass"),
    ("ceramic", "ceramic"),
    ("porcelain", "ceramic"),
    ("fabric", "fabric"),
    ("cloth", "fabric"),
    ("cotton", "fabric"),
    ("wool", "fabric"),
    ("leather", "leather"),
    ("paper", "paper"),
    ("cardboard", "cardboard"),
    ("stone", "stone"),
    ("marble", "stone"),
    ("concrete", "concrete"),
    ("rubber", "rubber"),
    ("wicker", "wicker"),
];

/// Phrases after which a caption says what a thing is for.
const PURPOSES: &[&str] =
    &["used for ", "used to ", "meant for ", "intended for ", "suitable for ", "its purpose is ", "for "];

/// What the caption says in words, and the name of the measured colour where the caption names none.
pub fn attributes_of(caption: &str, color: Option<[u8; 3]>) -> BTreeMap<String, String> {
    let lower = caption.to_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let said = words.iter().find_map(|word| COLORS.iter().find(|color| *color == word));
    let named = said.map(|word| if *word == "gray" { "grey" } else { word }).or(color.map(color_name));
    let material = material_of(&lower);
    let mut attributes = BTreeMap::new();
    if let Some(color) = named {
        attributes.insert("color".to_owned(), color.to_owned());
    }
    if let Some(material) = material {
        attributes.insert("material".to_owned(), material.to_owned());
    }
    if let Some(function) = function_of(&lower) {
        attributes.insert("function".to_owned(), function);
    }
    attributes
}

/// What the thing itself is made of: named before its surroundings are, or after "made of" or "surface is".
fn material_of(lower: &str) -> Option<&'static str> {
    /// Words after which a caption speaks of something else.
    const ELSEWHERE: [&str; 9] = ["on", "in", "near", "next", "beside", "with", "under", "above", "there"];
    let name = |word: &str| MATERIALS.iter().find(|(said, _)| *said == word).map(|(_, name)| *name);
    let is_word = |c: char| c.is_alphanumeric();
    let words = |text: &'static str| lower.split_once(text).map(|(_, rest)| rest.split(|c| !is_word(c)));
    let own = lower.split(['.', ',', ';']).next().unwrap_or("").split(|c| !is_word(c));
    own.take_while(|word| !ELSEWHERE.contains(word)).find_map(name).or_else(|| {
        let after = ["made of ", "surface is "].into_iter().filter_map(words);
        after.into_iter().find_map(|mut words| words.find(|word| !word.is_empty()).and_then(name))
    })
}

fn function_of(lower: &str) -> Option<String> {
    let start = PURPOSES.iter().find_map(|purpose| {
        let at = lower.find(purpose)?;
        let is_word = at == 0 || lower[..at].ends_with(' ');
        is_word.then_some(at + purpose.len())
    })?;
    let phrase = lower[start..].split(['.', ',', ';', '(']).next()?.trim();
    (!phrase.is_empty()).then(|| phrase.chars().take(60).collect())
}

/// The everyday word for a colour (sRGB), from hue, saturation and value.
pub fn color_name(rgb: [u8; 3]) -> &'static str {
    let [r, g, b] = rgb.map(f64::from);
    let value = r.max(g).max(b);
    let chroma = value - r.min(g).min(b);
    let saturation = if value > 0.0 { chroma / value } else { 0.0 };
    if value < 45.0 {
        return "black";
    }
    if saturation < 0.16 {
        return if value > 200.0 {
            "white"
        } else if value < 75.0 {
            "black"
        } else {
            "grey"
        };
    }
    let hue_deg = if value == r {
        60.0 * ((g - b) / chroma).rem_euclid(6.0)
    } else if value == g {
        60.0 * ((b - r) / chroma + 2.0)
    } else {
        60.0 * ((r - g) / chroma + 4.0)
    };
    match hue_deg {
        h if !(15.0..345.0).contains(&h) && saturation < 0.5 && value > 180.0 => "pink",
        h if !(12.0..345.0).contains(&h) => "red",
        // Dark orange is what people call brown, pale orange beige.
        h if h < 45.0 && saturation < 0.35 && value > 170.0 => "beige",
        h if h < 45.0 && value < 190.0 => "brown",
        h if h < 42.0 => "orange",
        h if h < 70.0 => "yellow",
        h if h < 165.0 => "green",
        h if h < 195.0 => "turquoise",
        h if h < 255.0 => "blue",
        h if h < 300.0 => "purple",
        _ => "pink",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_have_everyday_names() {
        let check = |rgb, expected| assert_eq!(color_name(rgb), expected, "{rgb:?}");
        check([0, 0, 0], "black");
        check([250, 250, 250], "white");
        check([128, 128, 128], "grey");
        check([200, 30, 30], "red");
        check([30, 160, 40], "green");
        check([30, 60, 200], "blue");
        check([120, 75, 35], "brown");
        check([240, 210, 40], "yellow");
        check([250, 150, 30], "orange");
    }

    #[test]
    fn a_caption_says_colour_material_and_function() {
        let found =
            attributes_of("A Red mug made of ceramic, used for drinking coffee, with a handle.", Some([9, 9, 9]));
        assert_eq!(found["color"], "red");
        assert_eq!(found["material"], "ceramic");
        assert_eq!(found["function"], "drinking coffee");
        let window = attributes_of(
            "A white window on the wall. It is next to a brown paper stack. Its purpose is letting in light.",
            None,
        );
        assert!(!window.contains_key("material"), "the stack is of paper: {window:?}");
        assert_eq!(window["function"], "letting in light");
        assert_eq!(
            attributes_of("the picture shows a desk, on the floor. The surface is wood and looks clean.", None)["material"],
            "wood"
        );
        assert_eq!(attributes_of("", Some([30, 60, 200]))["color"], "blue");
        assert!(attributes_of("", None).is_empty());
    }
}
